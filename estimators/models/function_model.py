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

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, Measurement

from .base import Linearised
from .chain import chain_of
from .columns import Columns
from .filtering import AidTable, Dynamics
from .flat_state import FlatStateModel
from .moving_chain import MovingChain, MovingModel, States
from .propagation import NO_SAMPLES

__all__ = ["FunctionChain", "FunctionModel"]

_NOTHING = np.empty(0)


class FunctionModel(FlatStateModel, MovingModel):
    """The model of the module; a subclass defines `begin`, `observes`, `table`, `estimate` and `equations`.

    Attributes
    ----------
    equations, numbers, names
        As of `FlatStateModel`.
    constants : (c,) array
        Figures of the motion.
    """

    state = ("numbers",)
    constants: Array = _NOTHING

    @abstractmethod
    def table(self, names: Sequence[str]) -> AidTable:
        """The instruments in the order of their names (`simnav.estimators.models.filtering.aid_table`)."""

    def dynamics(self, covariance: Array, names: Sequence[str]) -> Dynamics:
        """As `ErrorModel.dynamics`."""
        n = len(covariance)
        return Dynamics(
            numbers=self.numbers, covariance=covariance, transition=np.eye(n), process_noise=np.zeros((n, n)),
            constants=self.constants, decay=_NOTHING, density=_NOTHING, first_variances=covariance.diagonal().copy(),
            correction=np.empty(n), next_sample=np.zeros(1, np.int64), aids=self.table(names), moving=self.moving,
        )  # fmt: skip

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error, or several in columns, through the last propagation, in place."""
        error[...] = self._room.dynamics.transition @ error

    def _at(self, numbers: Array) -> Dynamics:
        """Another flat state as the functions take it."""
        own = self._room.dynamics
        there: Dynamics | None = vars(self).get("_elsewhere")
        if there is None or there.aids is not own.aids:
            there = self._elsewhere = replace(own, numbers=own.numbers.copy(), transition=own.transition.copy())
        there.numbers[:] = numbers
        return there

    def linearise(self, name: str, time: float, value: Array, numbers: Array) -> Linearised | None:
        """Linearise a measurement of an instrument at another flat state."""
        return self._linearised(self._at(numbers), Measurement(time, name, "", value))

    def move_all(self, states: States, elapsed: Array, jacobian: Array | None = None) -> None:
        """As `MovingModel.move_all`."""
        for k, (numbers, time) in enumerate(zip(states[0], elapsed.tolist(), strict=True)):
            there = self._at(numbers)
            there.transition[...] = np.eye(self.size)
            self.equations.propagate(there, NO_SAMPLES, float(numbers[0]) + time)
            numbers[:] = there.numbers
            if jacobian is not None:
                jacobian[k] = there.transition

    def difference_all(self, states: States, others: States) -> Array:
        """As `MovingModel.difference_all`."""
        assert self.equations.difference is not None  # its chain asks
        errors = np.empty((len(states[0]), self.size))
        for numbers, other, error in zip(states[0], others[0], errors, strict=True):
            self.equations.difference(numbers, other, error)
        return errors

    def retract_all(self, states: States, steps: Array) -> None:
        """As `MovingModel.retract_all`."""
        for numbers, step in zip(states[0], steps, strict=True):
            there = self._at(numbers)
            there.correction[:] = step
            self.equations.retract(there)
            numbers[:] = there.numbers


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
        for i in (first + np.flatnonzero(row[first:] >= 0)).tolist():
            name = self.names[aids["instrument"][i]]
            found = self.front.linearise(name, aids["time"][i], aids["value"][i], numbers[row[i]])
            self._note(i, None if found is None else (found.innovation, found.jacobian), jacobian)


@chain_of.register
def _(model: FunctionModel) -> FunctionChain:
    if model.equations.difference is None:
        raise TypeError(
            f"{type(model).__name__} has no function `difference` of two states, so that no graph can be made of it"
        )
    return FunctionChain(model)
