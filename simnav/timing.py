"""What a datasheet says of the clock of an instrument: how late its readings come, and how wrong their stamps are.

A reading is taken at its time of validity t. It arrives at ``t + latency + r``, where r is zero, or is drawn for each
reading from an exponential distribution of the mean ``latency_random``, cut off at `TAIL` times this mean. So a reading
may overtake an earlier one. Its time stamp is ::

    s = round((c + offset + drift c + j) / resolution) * resolution

c is the time at which the stamp is set, t or the time of arrival (``stamped``), and j is white. The figures of offset,
drift and j are one sigma. An estimator sees s, and the step in which the reading arrives.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import Literal

__all__ = ["TAIL", "TIME_TOLERANCE", "Stamped", "TimingSheet"]

#: Times closer than this are one and the same [s]: they are multiples of the sample interval up to rounding.
TIME_TOLERANCE = 0.5e-6

#: When the stamp is set.
Stamped = Literal["validity", "arrival"]
#: The longest random latency, as a multiple of its mean. One reading in 150 would have a longer one.
TAIL = 5.0
#: Mean of an exponential distribution of the mean 1 that is cut off there.
_MEAN = 1.0 - TAIL * exp(-TAIL) / (1.0 - exp(-TAIL))
#: How many sigma an unknown offset is taken into account.
_SIGMAS = 5.0


@dataclass(frozen=True)
class TimingSheet:
    """The part of a datasheet about time; see the module.

    Attributes
    ----------
    stamped : "validity" or "arrival"
        When the stamp is set.
    latency, latency_random : float
        Constant part of the time from validity to arrival, and mean of the random part [s].
    offset, drift : float
        Offset of the stamps at the start of a run [s], and its growth with time [-]; one sigma, constant in a run.
    jitter : float
        White error of each stamp, one sigma [s].
    resolution : float
        Step of the stamps [s]; 0: none.
    """

    stamped: Stamped = "validity"
    latency: float = 0.0
    latency_random: float = 0.0
    offset: float = 0.0
    drift: float = 0.0
    jitter: float = 0.0
    resolution: float = 0.0

    @property
    def expected(self) -> float:
        """By how much a stamp is later than the time of validity, on average [s]."""
        return self.latency + _MEAN * self.latency_random if self.stamped == "arrival" else 0.0

    @property
    def longest(self) -> float:
        """How long after its expected time of validity a reading may arrive [s]."""
        spread = TAIL * self.latency_random
        return self.latency + spread + _SIGMAS * (self.offset + self.jitter) + 0.5 * self.resolution
