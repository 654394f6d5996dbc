"""Channels that are contradicted by their siblings: one satellite against the others, without any search.

Where a new measurement is an outlier, a window does not know whether the measurement is wrong or the window itself, and
a weighting searches (`simnav.estimators.weightings.graduated_non_convexity`). The channels of an instrument answer this
question, because more than half of them are taken to be right. As in fault exclusion by a receiver, the channel with
the largest residual is left out, and the window is solved again with the others in full weight, until they agree. If
that takes more than `MOST` channels, or half of the channels of an instrument at one time, or if a measurement of
another instrument is still an outlier, there is no answer.

Source: the exclusion of one satellite after the other by the largest normalised residual is in H. Kuusniemi, A. Wieser,
G. Lachapelle and J. Takala, *User-level reliability monitoring in urban personal satellite-navigation*, IEEE
Transactions on Aerospace and Electronic Systems 43(4), 2007.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simnav.estimators.models.channels import owners
from simnav.types import Array, Instruments

from .base import Factors

__all__ = ["ChannelVote"]

#: Largest number of channels that are left out, each in one iteration.
MOST = 4


class ChannelVote:
    """The vote of the module. While it lasts, it sets the weights of the new measurements at each iteration."""

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        owner = owners(instruments)
        numbers = {instrument: k for k, instrument in enumerate(dict.fromkeys(owner.values()))}
        #: Number of the instrument of each channel.
        self._number = {channel: numbers[instrument] for channel, instrument in owner.items()}
        self.begin()

    def begin(self) -> None:
        """Start an epoch."""
        #: Whether the vote goes on; index of the first new measurement; those that were left out.
        self.asked, self._first, self._out = False, 0, np.empty(0, dtype=bool)

    def ask(self, factors: Factors, square: Array, first: int) -> bool:
        """Begin a vote if a channel is among the new outliers; return whether it goes on.

        Parameters
        ----------
        factors : Factors
            Factors of the window; the weights of the new measurements are set.
        square : (M,) array
            u^2 of each measurement, 1 at the limit.
        first : int
            Index of the first new measurement.
        """
        if not self._number:
            return False
        self._first, self._out = first, np.zeros(len(square) - first, dtype=bool)
        self.asked = True
        return self.answer(factors, square) is None

    def answer(self, factors: Factors, square: Array) -> bool | None:
        """Whether the siblings tell which measurements are wrong; None if that takes another iteration."""
        new, out = square[self._first :], self._out
        instrument = self._instruments(factors)
        outlying = (new > 1.0) & ~out
        suspects = np.flatnonzero(outlying & (instrument >= 0))
        self.asked = False
        if not len(suspects):
            return not np.any(outlying)
        worst = suspects[np.argmax(new[suspects])]
        out[worst] = True
        time = factors.time[self._first :]
        siblings = (time == time[worst]) & (instrument == instrument[worst])
        if np.count_nonzero(out) > MOST or 2 * np.count_nonzero(out & siblings) >= np.count_nonzero(siblings):
            return False
        self.asked = True
        factors.weight[self._first :] = ~out
        return None

    def _instruments(self, factors: Factors) -> NDArray[np.intp]:
        """Number of the instrument of each new measurement; -1 where it is not of a channel."""
        names = factors.names
        return np.array([self._number.get(names[i], -1) for i in factors.instrument[self._first :]], dtype=np.intp)
