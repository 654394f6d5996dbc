"""Pings one after the other: the next one begins when the one before has come back."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array

__all__ = ["Pings"]

_TOLERANCE = 1e-9


class Pings:
    """The pings of one instrument in one run.

    Examples
    --------
    >>> pings = Pings()
    >>> pings.begin(np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.5, 1.5, 0.5, 0.5]))
    array([ True, False,  True,  True])
    """

    def __init__(self) -> None:
        self._next = -inf

    def begin(self, time: Array, takes: Array) -> NDArray[np.bool_]:
        """At which of the next sample times a ping begins.

        Parameters
        ----------
        time : (n,) array
            Sample times, ascending from block to block [s].
        takes : (n,) array
            How long a ping that begins then takes [s].
        """
        begins = np.ones(len(time), np.bool_)
        for i, (t, length) in enumerate(zip(time.tolist(), takes.tolist(), strict=True)):
            if t < self._next - _TOLERANCE:
                begins[i] = False
            else:
                self._next = t + length
        return begins
