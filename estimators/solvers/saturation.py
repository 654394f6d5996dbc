"""Gyroscopes that saturate: their readings say so themselves.

At the end of its range a gyroscope gives the same number again and again, while its noise makes any two other readings
differ. So a reading far above its noise that is repeated is no measurement of the rate, which is larger than it by an
unknown amount. A gyroscope of coarse resolution repeats itself at any rate. It is known by that it does so before the
run is trusted, and then only the range of its datasheet counts.
"""

from __future__ import annotations

import numpy as np

from simnav.types import ImuDatasheet, ImuSamples

__all__ = ["Saturation"]

#: So many equal readings in a row show that a gyroscope saturates.
REPEATED = 3
#: A reading is far above its noise if it is larger by this than bias and white noise of a sample.
FAR = 10.0


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
        rates = np.concatenate([self._before, imu.angular_rate])
        self._before = rates[1 - REPEATED :].copy()
        size = np.abs(rates[REPEATED - 1 :])
        repeated = np.all([rates[k : len(size) + k] == rates[REPEATED - 1 :] for k in range(REPEATED - 1)], axis=0)
        if imu.time[0] < self._until:
            self._coarse |= repeated.any(axis=0)
        saturated = (repeated & ~self._coarse & (size > self._least)) | (size >= self._range)
        return float(np.max(size, where=saturated, initial=0.0))
