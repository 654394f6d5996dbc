"""Gyroscopes that saturate: their readings say so themselves.

At the end of its range a gyroscope gives the same number again and again, while its noise makes any two other readings
differ. So a reading far above its noise that is repeated is no measurement of the rate, which is larger than it by an
unknown amount. A gyroscope of coarse resolution repeats itself at any rate. It is known by that it does so before the
run is trusted, and then only the range of its datasheet counts.
"""

from __future__ import annotations

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.kernel_types import FlagVector, Matrix
from simnav.types import ImuDatasheet, ImuSamples

__all__ = ["Saturation"]

#: So many equal readings in a row show that a gyroscope saturates.
REPEATED = 3
#: A reading is far above its noise if it is larger by this than bias and white noise of a sample.
FAR = 10.0


@helper
def _repeats(rates: Matrix, before: Matrix, k: int, i: int) -> bool:
    """Whether a reading of a gyroscope equals all of those before it that are kept."""
    for j in range(1, before.shape[0] + 1):
        if (rates[k - j, i] if k >= j else before[before.shape[0] + k - j, i]) != rates[k, i]:
            return False
    return True


@kernel
def largest_saturated(
    rates: Matrix, before: Matrix, coarse: FlagVector, begins: bool, least: float, limit: float
) -> float:
    """The largest rate of (N, 3) ``rates`` at which a gyroscope saturates [rad/s]; 0 where none does.

    Parameters
    ----------
    rates : (N, 3) array
        Angular rates [rad/s].
    before : (r, 3) array
        The readings before, newest last; those of ``rates`` take their place.
    coarse : (3,) bool array
        Gyroscopes that repeat themselves at any rate; more are found while the run ``begins``.
    begins : bool
        Whether a repeated reading shows a coarse gyroscope.
    least, limit : float
        A repeated reading counts above the first, any reading from the second on [rad/s].
    """
    count, r, largest = rates.shape[0], before.shape[0], 0.0
    for i in range(3):
        for k in range(count):
            coarse[i] |= begins and _repeats(rates, before, k, i)
        for k in range(count):
            size = abs(rates[k, i])
            if size > largest:
                saturated = size > least and not coarse[i] and _repeats(rates, before, k, i)
                largest = size if saturated or size >= limit else largest
    for j in range(r):
        at = count - r + j
        for i in range(3):
            before[j, i] = rates[at, i] if at >= 0 else before[j + count, i]
    return largest


class Saturation:
    """Finds the readings of a run that are saturated.

    Parameters
    ----------
    sheet : ImuDatasheet or None
        The IMU.
    until : float
        A gyroscope that repeats a reading before this time is coarse [s].
    """

    def __init__(self, sheet: ImuDatasheet | None, until: float):
        self._range = self._least = np.inf
        if sheet is not None:
            own = sheet.gyroscope
            self._range = own.range
            self._least = FAR * (own.bias + own.bias_instability + own.random_walk * np.sqrt(sheet.rate))
        self._until, self._coarse = until, np.zeros(3, dtype=np.bool_)
        self._before = np.full((REPEATED - 1, 3), np.nan)

    def largest(self, imu: ImuSamples | None) -> float:
        """The largest rate at which a gyroscope saturates in the samples of a step [rad/s]; 0 where none does."""
        if imu is None or len(imu) == 0:
            return 0.0
        begins = bool(imu.time[0] < self._until)
        found: float = largest_saturated.unchecked(
            ready(imu.angular_rate), self._before, self._coarse, begins, self._least, self._range
        )
        return found
