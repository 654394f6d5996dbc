"""A model as functions over one flat state: all that solvers ask of it follows from these functions.

A subclass names its functions (`ModelFunctions`), sets the flat state at the start of a run, and describes it. The
blocks of the state have names by a structure (`simnav.structures`). If the functions are kernels, the whole step of a
filter is compiled code; if they are plain Python, the same loop runs in Python, with the same numbers
(`simnav.estimators.solvers.filter_step`).

`simnav.estimators.models.kinematic` is the smallest of such models.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from simnav.types import Array, Measurement

from .base import ErrorModel, Linearised
from .filtering import AidTable, Dynamics, ModelFunctions, Prediction, ReadingsOfSteps

__all__ = ["FunctionModel"]

_NOTHING = np.empty(0)


class FunctionModel(ErrorModel):
    """The model of the module; a subclass defines `begin`, `observes`, `table`, `estimate` and `equations`.

    Attributes
    ----------
    equations : ModelFunctions
        Its functions.
    numbers : (s,) array
        The flat state. Its first number is the time.
    constants : (c,) array
        Figures of the motion.
    names : sequence of str
        The observed instruments of the run.
    """

    state = ("numbers",)
    equations: ClassVar[ModelFunctions]
    numbers: Array
    constants: Array = _NOTHING
    names: Sequence[str]

    @abstractmethod
    def table(self, names: Sequence[str]) -> AidTable:
        """The instruments in the order of their names (`simnav.estimators.models.filtering.aid_table`)."""

    @property
    def time(self) -> float:
        """Time of the state [s]."""
        return float(self.numbers[0])

    @time.setter
    def time(self, time: float) -> None:
        self.numbers[0] = time

    def functions(self) -> ModelFunctions:
        """As `ErrorModel.functions`."""
        return self.equations

    def dynamics(self, covariance: Array, names: Sequence[str]) -> Dynamics:
        """As `ErrorModel.dynamics`."""
        n = len(covariance)
        return Dynamics(
            numbers=self.numbers, covariance=covariance, transition=np.eye(n), process_noise=np.zeros((n, n)),
            constants=self.constants, decay=_NOTHING, density=_NOTHING, first_variances=covariance.diagonal().copy(),
            correction=np.empty(n), next_sample=np.zeros(1, np.int64), aids=self.table(names),
            moving=self.moving,
        )  # fmt: skip

    def _alone(self) -> Dynamics:
        """Room for calls from outside of the loop, over the same state."""
        found: Dynamics | None = vars(self).get("_room")
        if found is None or found.numbers is not self.numbers:
            found = self._room = self.dynamics(np.eye(self.size), self.names)
            self._readings = ReadingsOfSteps(dict(zip(self.names, found.aids.components.tolist(), strict=True)))
        return found

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        room = self._alone()
        room.covariance[...] = covariance
        self.equations.propagate(room, self.samples, until)
        covariance[...] = room.covariance

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[...] = self._alone().transition @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement: with the covariance 1, P H' is the Jacobian."""
        room = self._alone()
        room.covariance[...] = np.eye(self.size)
        readings, d = self._readings.fill([measurement]), int(self._readings.components(measurement.instrument))
        found = Prediction(np.empty(d), np.empty((self.size, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d)))
        if not self.equations.predict(room, readings, 0, found):
            return None
        return Linearised(found.innovation, np.ascontiguousarray(found.cross.T), found.nominal)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        room = self._alone()
        room.correction[:] = dx
        self.equations.retract(room)
