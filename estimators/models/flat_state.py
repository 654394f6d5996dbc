"""A model over one flat state: its equations are functions, and the methods of the model call them.

The loop of a filter calls the functions (`simnav.estimators.solvers.filter_step`). Smoothers, iterated filters and
windows call the methods, at a state of the model or at another one. So an equation is written once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from simnav.types import Array, Measurement

from .base import ErrorModel, Linearised
from .filtering import Dynamics, ModelFunctions, Prediction, Readings, ReadingsOfSteps

__all__ = ["FlatStateModel"]

#: What is made for calls from outside of the loop.
_ROOM = ("_own_dynamics", "_elsewhere", "_readings", "_unit")


class FlatStateModel(ErrorModel):
    """The model of the module; a subclass defines `dynamics` and ``equations``.

    Attributes
    ----------
    equations : ModelFunctions
        Its functions.
    numbers : (s,) array
        The flat state, of the present run.
    names : sequence of str
        The instruments of the run that the functions predict.
    """

    equations: ClassVar[ModelFunctions]
    names: Sequence[str]

    def functions(self) -> ModelFunctions | None:
        """As `ErrorModel.functions`."""
        return self.equations

    def __getstate__(self) -> dict[str, Any]:
        """A copy makes the room for its calls itself."""
        return {name: value for name, value in vars(self).items() if name not in _ROOM}

    def _outside(self) -> Dynamics:
        """The state as the functions take it, for calls from outside of the loop; its covariance is work space."""
        found: Dynamics | None = vars(self).get("_own_dynamics")
        if found is None or found.numbers is not self.numbers:
            found = self._own_dynamics = self.dynamics(np.eye(self.size), self.names)
            self._unit = np.eye(self.size)
            self._elsewhere = replace(found, numbers=self.numbers.copy(), transition=found.transition.copy())
            self._readings = ReadingsOfSteps(dict(zip(self.names, found.aids.components.tolist(), strict=True)))
        return found

    def _at(self, numbers: Array) -> Dynamics:
        """The same at another flat state."""
        self._outside()
        self._elsewhere.numbers[:] = numbers
        return self._elsewhere

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        if until <= self.time:
            return
        own = self._outside()
        own.covariance[...] = covariance
        self.equations.propagate(own, self.samples, until)
        covariance[...] = own.covariance

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement."""
        own = self._outside()
        return self._linearised(own, self._readings.fill([measurement]))

    def linearise(self, name: str, time: float, value: Array, numbers: Array) -> Linearised | None:
        """Linearise a measurement of an instrument at another flat state."""
        there = self._at(numbers)
        return self._linearised(there, self._readings.fill([Measurement(time, name, "", value)]))

    def _linearised(self, dynamics: Dynamics, readings: Readings) -> Linearised | None:
        """Predict the first reading: with the covariance 1, P H' is the Jacobian."""
        dynamics.covariance[...] = self._unit
        d = int(readings.components[0])
        found = Prediction(np.empty(d), np.empty((self.size, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d)))
        if not self.equations.predict(dynamics, readings, 0, found):
            return None
        return Linearised(found.innovation, np.ascontiguousarray(found.cross.T), found.nominal)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        own = self._outside()
        own.correction[:] = dx
        self.equations.retract(own)
