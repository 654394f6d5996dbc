"""The blocks of states of a model: the errors of its instruments, and what instruments bring along (`simnav.blocks`).

A model appends blocks here, and learns their places and rates. Its compiled loops get the places, and a vector of decay
and one of noise density: all components but those of a clock are independent. A clock's bias is coupled to its drift,
and its noise is correlated: that is done here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from simnav.blocks import Rates, StateBlock, blocks_of
from simnav.declared_process import DeclaredProcess
from simnav.types import Array, Datasheet, Instruments

from .channels import instrument_of

__all__ = ["Reported", "StateBlocks", "without_shared_blocks"]

#: Value and standard deviation of blocks of states, by label.
Reported: TypeAlias = dict[str, tuple[Array, Array]]


def without_shared_blocks(instruments: Instruments) -> Instruments:
    """The datasheets, with a block of its own for each instrument in place of a shared one.

    For estimators whose parts have only the motion in common: each part then estimates the block from its own
    instrument, which gives away what the others know of it.
    """
    if not any(block.shared for sheet in instruments.values() for block in sheet.blocks):
        return instruments
    return instruments.changed(
        lambda sheet: replace(sheet, blocks=tuple(replace(block, shared="") for block in sheet.blocks))
    )


class StateBlocks:
    """The blocks of states of a model: which places of the error they have, and how they move.

    Parameters
    ----------
    first : int
        Index of the first component of the first block in the error state.

    Attributes
    ----------
    at : dict of str to slice
        Places of each block in the error state, by label: that of `StateBlock.label`, or ``SOURCE.NAME`` of an error of
        a datasheet, where a channel is a source of its own.
    states : list of Rates
        Of each component; the noise of a clock is added by `add_noise`.
    brought : Mapping of str to StateBlock
        The blocks that instruments bring along, by label.
    clocks : list of int
        Indices of the biases of the clocks; the drift of each follows it.
    """

    def __init__(self, first: int):
        self.first = first
        self.at: dict[str, slice] = {}
        self.states: list[Rates] = []
        self.brought: Mapping[str, StateBlock] = {}
        self._of: dict[str, dict[str, slice]] = {}
        self._names: dict[str, tuple[str, ...]] = {}
        self.clocks: list[int] = []
        self._clocks: list[tuple[int, StateBlock]] = []
        self._coupled: list[tuple[int, int, DeclaredProcess]] = []
        self._columns: Array | None = None
        self._step: tuple[float, Array, Array] | None = None

    def __deepcopy__(self, memo: object) -> StateBlocks:
        """Itself: a model makes it at the start of a run. An estimator with late readings is copied in each step."""
        return self

    @property
    def size(self) -> int:
        """Number of components of the error state up to the last block."""
        return self.first + len(self.states)

    def add(self, source: str, name: str, rates: Sequence[Rates]) -> int:
        """Append a block of an instrument or channel; the index of its first component."""
        first = self.size
        self._of.setdefault(source, {})[name] = self._append(f"{source}.{name}", rates)
        return first

    def add_second_order(self, source: str, name: str, process: DeclaredProcess, component: int) -> int:
        """Append value and rate of a second-order process; the index of the value. They move by `couple`."""
        value, rate = process.covariance(component).diagonal().tolist()
        first = self.add(source, name, [Rates(value, 0.0, 0.0), Rates(rate, 0.0, 0.0)])
        self._coupled.append((first, component, process))
        return first

    def couple(self, transition: Array, elapsed: float) -> None:
        """Write the second-order processes into an (n, n) transition matrix."""
        for at, _, process in self._coupled:
            transition[at : at + 2, at : at + 2] = process.transition(elapsed)

    def bring(self, sheets: Iterable[Datasheet]) -> None:
        """Append the blocks that instruments bring along.

        Raises
        ------
        ValueError
            If two of them do not agree, or one has the name of an error that is a state already.
        """
        sheets = list(sheets)
        self.brought = blocks_of((instrument_of(s), s.blocks) for s in sheets)
        for label, block in self.brought.items():
            at = self._append(label, block.rates())
            if block.process == "clock":
                self.clocks.append(at.start)
                self._clocks.append((at.start, block))
        for sheet in sheets:
            known = self._of.setdefault(sheet.name, {})
            for block in sheet.blocks:
                if block.name in known:
                    raise ValueError(
                        f"instrument {instrument_of(sheet)!r}: its block of states {block.name!r} has the name of an "
                        f"error of its datasheet; give the block another name, or set {block.name} to 0"
                    )
                known[block.name] = self.at[block.label(instrument_of(sheet))]
            self._names[sheet.name] = tuple(block.name for block in sheet.blocks)

    def _append(self, label: str, rates: Sequence[Rates]) -> slice:
        at = self.at[label] = slice(self.size, self.size + len(rates))
        self.states += rates
        self._columns = self._step = None
        return at

    def step(self, elapsed: float) -> tuple[Array, Array]:
        """What a time [s] does to the components: factors by which they decay, and variances that are added to them.

        What belongs to clocks beyond that is done by `carry` and `add_noise`. Both arrays are kept until another time
        is asked for; they are not to be changed.
        """
        if self._step is None or self._step[0] != elapsed:
            _, rate, density = self.columns(self.first)
            decay, noise, moving = np.exp(-rate * elapsed), density * elapsed, rate > 0.0
            noise[moving] = density[moving] * (1.0 - decay[moving] ** 2) / (2.0 * rate[moving])
            self._step = elapsed, decay, noise
        return self._step[1:]

    def columns(self, first: int) -> tuple[Array, Array, Array]:
        """Initial variance, decay and noise density of the components from an index of the error state on."""
        if self._columns is None:
            self._columns = np.array(self.states, dtype=np.float64).reshape(-1, 3).T.copy()
        variance, decay, noise = self._columns[:, first - self.first :]
        return variance, decay, noise

    def places(self, name: str, offset: int) -> dict[str, int]:
        """By name, the index of the first state of each block that an instrument brings along, less an offset."""
        return {block: self._of[name][block].start - offset for block in self._names.get(name, ())}

    def of(self, source: str) -> list[slice]:
        """Places of all blocks that an instrument or channel depends on."""
        return list(self._of.get(source, {}).values())

    def carry(self, error: Array, elapsed: float) -> None:
        """Move the biases of clocks by their drifts in an (n,) or (n, k) array of errors, in place."""
        for at, _ in self._clocks:
            error[at] += elapsed * error[at + 1]

    def carry_values(self, values: Array, offset: int, elapsed: float) -> None:
        """Move the biases of clocks by their drifts in the array of values, in place.

        Parameters
        ----------
        values : (m,) array
            Values of the states from the index ``offset`` of the error state on.
        offset : int
            Index in the error state of the first value.
        elapsed : float
            Time [s].
        """
        for at, _ in self._clocks:
            values[at - offset] += elapsed * values[at + 1 - offset]

    def carry_covariance(self, covariance: Array, elapsed: float) -> None:
        """Move the clocks in an (n, n) covariance, and add their noise, in place."""
        for at, _ in self._clocks:
            covariance[at] += elapsed * covariance[at + 1]
            covariance[:, at] += elapsed * covariance[:, at + 1]
        self.add_noise(covariance, elapsed)

    def add_noise(self, covariance: Array, elapsed: float) -> None:
        """Add the noise of clocks and second-order processes to an (n, n) covariance, in place."""
        for at, block in self._clocks:
            covariance[at : at + 2, at : at + 2] += block.noise(elapsed)
        for at, component, process in self._coupled:
            covariance[at : at + 2, at : at + 2] += process.noise(component, elapsed)

    def report(self, values: Array, offset: int, covariance: Array, everything: bool) -> Reported:
        """Value and standard deviation of blocks, by label (`simnav.types.Estimate.states`).

        Parameters
        ----------
        values : (m,) array
            Values of the states from the index ``offset`` of the error state on.
        offset : int
            Index in the error state of the first value.
        covariance : (n, n) array
            Covariance of the error state.
        everything : bool
            False: the blocks that instruments bring along. True: those of their datasheets, too.
        """
        labels = self.at if everything else self.brought
        sigma = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        found = {}
        for label in labels:
            at = self.at[label]
            found[label] = values[at.start - offset : at.stop - offset].copy(), sigma[at]
        return found
