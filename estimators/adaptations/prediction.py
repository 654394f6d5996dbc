"""Test of the prediction: if fixes and velocities disagree with it together, the prediction is wrong."""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.models.roles import fixes_and_logs
from simnav.types import Array, Instruments

from .base import Innovation

__all__ = ["PredictionTest", "standardised"]


@kernel("UniTuple(f8, 3)(f8[::1], f8[:, ::1], f8[:, ::1])")
def standardised(residual: Array, predicted: Array, noise: Array) -> tuple[float, float, float]:
    """The components of an innovation, each divided by its sigma in ``H P H' + R``, with zeros up to three."""
    m = residual.size
    u0 = residual[0] / sqrt(predicted[0, 0] + noise[0, 0])
    u1 = residual[1] / sqrt(predicted[1, 1] + noise[1, 1]) if m > 1 else 0.0
    u2 = residual[2] / sqrt(predicted[2, 2] + noise[2, 2]) if m > 2 else 0.0
    return u0, u1, u2


class PredictionTest:
    """Chi-square tests of fixes and logs, which fail together if the prediction is wrong.

    An adaptation gives less weight to measurements that do not fit the prediction. If the prediction itself is wrong (a
    disturbed IMU), no measurement fits, and the filter does not recover. Zhan et al. (2026) separate the two cases by
    the chi-square tests of GNSS and DVL: if one of them fails, that instrument is wrong; if both fail, the prediction
    is. Gross errors of both may coincide by chance, so both tests must fail ``together`` times in a row.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.
    together : int
        Number of times in a row that both tests must fail before the prediction is taken as wrong; 0: never.
    probability : float
        Probability that a good measurement passes its test.
    """

    RECENT = 5.0  # s; an older failure of another instrument does not count
    LARGEST, TOTAL = 100.0, 1e8

    def __init__(self, instruments: Instruments, together: int = 3, probability: float = 0.999):
        self.together = together
        self._limits = chi_square_limits(probability)
        self._group = fixes_and_logs(instruments)
        if len(set(self._group.values())) < 2 or not together:
            self._group = {}
        self._failures: dict[str, tuple[int, float]] = {}
        self._first: Array | None = None
        self._blamed = 0

    def fails(self, innovation: Innovation) -> bool:
        """Whether this instrument and one of the other group have failed often enough in a row, this time included.

        The statistic is the sum of the squared standardised components of the innovation.
        """
        name, time = innovation.measurement.instrument, innovation.measurement.time
        group = self._group.get(name)
        if group is None:
            return False
        u0, u1, u2 = standardised(innovation.residual, innovation.predicted, innovation.noise)
        if u0 * u0 + u1 * u1 + u2 * u2 <= self._limits[len(innovation.residual)]:
            self._failures[name] = 0, time
            self._blamed = 0
            return False
        count = self._failures.get(name, (0, time))[0] + 1
        self._failures[name] = count, time
        return count >= self.together and any(
            self._group[other] != group and n >= self.together and time - t <= self.RECENT
            for other, (n, t) in self._failures.items()
        )

    def inflation(self, innovation: Innovation) -> float:
        """Factor of P after a failure of the prediction: once for every ``together`` failures.

        The root of the mean squared standardised component, over 2 (eqs. 28 and 34 of Zhan et al. 2026), within
        `limited`.
        """
        self._blamed += 1
        if (self._blamed - 1) % (self.together * len(self._group)):
            return 1.0
        components = standardised(innovation.residual, innovation.predicted, innovation.noise)
        return self.limited(0.5 * sqrt(sum(u * u for u in components) / len(innovation.residual)), innovation)

    def limited(self, inflation: float, innovation: Innovation) -> float:
        """Limit an inflation. Without the limit, the variances of unobserved states would grow without bound.

        A single inflation is at most `LARGEST`, and no variance exceeds `TOTAL` times its value before the first one.
        """
        if inflation <= 1.0 or innovation.covariance is None:
            return 1.0
        variances = innovation.covariance.diagonal()
        if self._first is None:
            self._first = np.maximum(variances, 1e-30)
        grown = float(np.max(variances / self._first))
        return max(1.0, min(inflation, self.LARGEST, self.TOTAL / grown))
