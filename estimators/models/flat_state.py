"""A model over one flat state: its equations are functions, and the methods of the model call them.

The loop of a filter calls the functions (`simnav.estimators.solvers.filter_step`). Smoothers, iterated filters and
windows call the methods, at a state of the model or at another one. So an equation is written once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from simnav.types import Array, Measurement

from .base import ErrorModel, Linearised
from .filtering import Dynamics, ModelFunctions, Prediction, ReadingsOfSteps

__all__ = ["FlatStateModel"]


class _Room(NamedTuple):
    """What calls from outside of the loop work on.

    Attributes
    ----------
    dynamics : Dynamics
        The state as the functions take it; its covariance is work space.
    readings : ReadingsOfSteps
        Makes arrays of a measurement.
    unit : (n, n) array
        The identity.
    """

    dynamics: Dynamics
    readings: ReadingsOfSteps
    unit: Array


class FlatStateModel(ErrorModel):
    """The model of the module; a subclass defines `dynamics` and ``equations``.

    Attributes
    ----------
    equations : ModelFunctions
        Its functions.
    numbers : (s,) array
        The flat state, of the present run. The first is the time, unless a subclass says otherwise.
    names : sequence of str
        The instruments of the run that the functions predict.
    """

    equations: ClassVar[ModelFunctions]
    names: Sequence[str]

    def functions(self) -> ModelFunctions | None:
        """As `ErrorModel.functions`."""
        return self.equations

    @property
    def time(self) -> float:
        """Time of the state [s]."""
        return float(self.numbers[0])

    @time.setter
    def time(self, time: float) -> None:
        self.numbers[0] = time

    def _bind(self) -> None:
        """Name the blocks of the flat state; a hook."""

    def __getstate__(self) -> dict[str, Any]:
        """A copy makes the room for its calls itself."""
        return {name: value for name, value in vars(self).items() if name != "_made_room"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """A copy: the named blocks of its state are views of the flat one."""
        vars(self).update(state)
        if "numbers" in state:
            self._bind()

    @property
    def _room(self) -> _Room:
        """Made at the first call of a run."""
        found: _Room | None = vars(self).get("_made_room")
        if found is None or found.dynamics.numbers is not self.numbers:
            unit = np.eye(self.size)
            dynamics = self.dynamics(unit.copy(), self.names)
            components = dict(zip(self.names, dynamics.aids.components.tolist(), strict=True))
            found = self._made_room = _Room(dynamics, ReadingsOfSteps(components), unit)
        return found

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        if until <= self.time:
            return
        own = self._room.dynamics
        own.covariance[...] = covariance
        self.equations.propagate(own, self.samples, until)
        covariance[...] = own.covariance

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement."""
        return self._linearised(self._room.dynamics, measurement)

    def _linearised(self, dynamics: Dynamics, measurement: Measurement) -> Linearised | None:
        """Predict a reading: with the covariance 1, P H' is the Jacobian."""
        room = self._room
        dynamics.covariance[...] = room.unit
        readings = room.readings.fill([measurement])
        d = int(readings.components[0])
        found = Prediction(np.empty(d), np.empty((self.size, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d)))
        if not self.equations.predict(dynamics, readings, 0, found):
            return None
        return Linearised(found.innovation, np.ascontiguousarray(found.cross.T), found.nominal)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        own = self._room.dynamics
        own.correction[:] = dx
        self.equations.retract(own)
