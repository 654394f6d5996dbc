"""A model as functions over one flat state: all that solvers ask of it follows from these functions.

A subclass names its functions (`ModelFunctions`), sets the flat state at the start of a run, and describes it. The
blocks of the state have names by a structure (`simnav.structures`). If the functions are kernels, the whole step of a
filter is compiled code; if they are plain Python, the same loop runs in Python, with the same numbers
(`simnav.estimators.solvers.filter_step`). With a `difference` it also has a window, whose motion factors are the
function `propagate` at each node.

`simnav.estimators.models.kinematic` is the smallest of such models.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, Measurement

from .base import NO_SAMPLES, Linearised
from .chain import chain_of
from .columns import Columns
from .filtering import AidTable, Dynamics, ModelFunctions, Prediction, Readings, ReadingsOfSteps
from .moving_chain import MovingChain, MovingModel, States

__all__ = ["FunctionChain", "FunctionModel"]

_NOTHING = np.empty(0)


class FunctionModel(MovingModel):
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
            correction=np.empty(n), next_sample=np.zeros(1, np.int64), aids=self.table(names), moving=self.moving,
        )  # fmt: skip

    def _room(self) -> tuple[Dynamics, Dynamics]:
        """For calls from outside of the loop: over the state of the model, and over a state of its own."""
        found: tuple[Dynamics, Dynamics] | None = vars(self).get("_rooms")
        if found is None or found[0].numbers is not self.numbers:
            own = self.dynamics(np.eye(self.size), self.names)
            found = self._rooms = own, replace(own, numbers=self.numbers.copy(), transition=np.eye(self.size))
            self._readings = ReadingsOfSteps(dict(zip(self.names, own.aids.components.tolist(), strict=True)))
        return found

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        room, _ = self._room()
        room.covariance[...] = covariance
        self.equations.propagate(room, self.samples, until)
        covariance[...] = room.covariance

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[...] = self._room()[0].transition @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise a measurement."""
        room, _ = self._room()
        return self._linearised(room, self._readings.fill([measurement]))

    def linearise(self, name: str, time: float, value: Array, numbers: Array) -> Linearised | None:
        """Linearise a measurement of an instrument at any (s,) state."""
        _, room = self._room()
        room.numbers[:] = numbers
        return self._linearised(room, self._readings.fill([Measurement(time, name, "", value)]))

    def _linearised(self, room: Dynamics, readings: Readings) -> Linearised | None:
        """Predict the first reading: with the covariance 1, P H' is the Jacobian."""
        room.covariance[...] = np.eye(self.size)
        d = int(readings.components[0])
        found = Prediction(np.empty(d), np.empty((self.size, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d)))
        if not self.equations.predict(room, readings, 0, found):
            return None
        return Linearised(found.innovation, np.ascontiguousarray(found.cross.T), found.nominal)

    def correct(self, dx: Array) -> None:
        """Add a correction to the state."""
        room, _ = self._room()
        room.correction[:] = dx
        self.equations.retract(room)

    def move_all(self, states: States, elapsed: Array, jacobian: Array | None = None) -> None:
        """As `MovingModel.move_all`."""
        _, room = self._room()
        for k, (numbers, time) in enumerate(zip(states[0], elapsed.tolist(), strict=True)):
            room.numbers[:], room.transition[...] = numbers, np.eye(self.size)
            self.equations.propagate(room, NO_SAMPLES, float(numbers[0]) + time)
            numbers[:] = room.numbers
            if jacobian is not None:
                jacobian[k] = room.transition

    def difference_all(self, states: States, others: States) -> Array:
        """As `MovingModel.difference_all`."""
        if self.equations.difference is None:
            raise TypeError(f"{type(self).__name__} has no function `difference`, which a window needs")
        errors = np.empty((len(states[0]), self.size))
        for numbers, other, error in zip(states[0], others[0], errors, strict=True):
            self.equations.difference(numbers, other, error)
        return errors

    def retract_all(self, states: States, steps: Array) -> None:
        """As `MovingModel.retract_all`."""
        _, room = self._room()
        for numbers, step in zip(states[0], steps, strict=True):
            room.numbers[:], room.correction[:] = numbers, step
            self.equations.retract(room)
            numbers[:] = room.numbers


class FunctionChain(MovingChain):
    """The chain of a model as functions.

    Parameters
    ----------
    front : FunctionModel
        The model that runs ahead and leaves the nodes behind.
    """

    front: FunctionModel

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`."""
        aids, numbers = self.aids, states[f"{prefix}numbers"]
        for i in first + np.flatnonzero(row[first:] >= 0):
            aids["residual"][i], jacobian[i], aids["components"][i] = 0.0, 0.0, 0
            name = self.names[aids["instrument"][i]]
            found = self.front.linearise(name, aids["time"][i], aids["value"][i], numbers[row[i]])
            if found is not None:
                d = len(found.innovation)
                aids["residual"][i, :d], jacobian[i, :d], aids["components"][i] = found.innovation, found.jacobian, d


@chain_of.register
def _(model: FunctionModel) -> FunctionChain:
    return FunctionChain(model)
