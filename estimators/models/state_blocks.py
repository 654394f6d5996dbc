"""The blocks of states that the instruments of a run bring along (`simnav.blocks`), behind the states of a model.

All components but those of a clock are independent, and a model moves them like its own calibration states, by decay
and noise density. A clock's bias is coupled to its drift, and its noise is correlated: that is done here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from simnav.blocks import StateBlock, blocks_of
from simnav.types import Array, Datasheet, Instruments

from .channels import instrument_of

__all__ = ["StateBlocks", "without_shared_blocks"]


def without_shared_blocks(instruments: Instruments) -> Instruments:
    """The datasheets, with a block of its own for each instrument in place of a shared one.

    For estimators whose parts have only the motion in common: each part then estimates the block from its own
    instrument, which gives away what the others know of it.
    """
    if not any(block.shared for sheet in instruments.values() for block in sheet.blocks):
        return instruments
    sheets = [
        replace(sheet, blocks=tuple(replace(block, shared="") for block in sheet.blocks))
        for sheet in instruments.values()
    ]
    return Instruments(sheets, instruments.imu, instruments.step)


class StateBlocks:
    """The blocks of some instruments, and their places in an error state.

    Parameters
    ----------
    sheets : iterable of Datasheet
        Datasheets of the instruments whose blocks become states.
    first : int
        Index of the first component of the first block in the error state.

    Attributes
    ----------
    at : dict of str to slice
        Places of each block in the error state, by label (`StateBlock.label`).
    states : list of (float, float, float)
        Initial variance, decay and noise density of each component; the noise of a clock is added by `add_noise`.
    """

    def __init__(self, sheets: Iterable[Datasheet], first: int):
        self._sheets = {sheet.name: sheet for sheet in sheets}
        self.blocks: Mapping[str, StateBlock] = blocks_of((instrument_of(s), s.blocks) for s in self._sheets.values())
        self.at: dict[str, slice] = {}
        self.states: list[tuple[float, float, float]] = []
        self._clocks: list[tuple[int, StateBlock]] = []
        for label, block in self.blocks.items():
            begin = first + len(self.states)
            self.at[label] = slice(begin, begin + block.size)
            self.states += block.rates()
            if block.process == "clock":
                self._clocks.append((begin, block))

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def clocks(self) -> list[int]:
        """Indices of the biases of the clocks; the drift of each follows it."""
        return [at for at, _ in self._clocks]

    def places(self, name: str, offset: int) -> dict[str, int]:
        """By name of the block, the index of the first state of each block of an instrument, less an offset."""
        sheet = self._sheets.get(name)
        if sheet is None:
            return {}
        return {b.name: self.at[b.label(instrument_of(sheet))].start - offset for b in sheet.blocks}

    def of(self, name: str) -> list[slice]:
        """Places of the blocks of an instrument in the error state."""
        sheet = self._sheets.get(name)
        return [] if sheet is None else [self.at[b.label(instrument_of(sheet))] for b in sheet.blocks]

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
        """Add the noise of the clocks to an (n, n) covariance, in place."""
        for at, block in self._clocks:
            covariance[at : at + 2, at : at + 2] += block.noise(elapsed)

    def report(self, values: Array, offset: int, covariance: Array) -> dict[str, tuple[Array, Array]]:
        """Value and standard deviation of each block, by label (`simnav.types.Estimate.states`).

        Parameters
        ----------
        values : (m,) array
            Values of the states from the index ``offset`` of the error state on.
        offset : int
            Index in the error state of the first value.
        covariance : (n, n) array
            Covariance of the error state.
        """
        sigma = np.sqrt(np.maximum(covariance.diagonal(), 0.0))
        return {
            label: (values[at.start - offset : at.stop - offset].copy(), sigma[at]) for label, at in self.at.items()
        }
