"""Whether the innovations of an instrument persist: the sign of a wrong prediction.

The noise of an instrument is independent from one measurement to the next. If its covariance R is larger than the
filter assumes, the filter follows the noise too closely, and successive innovations have a correlation below zero. If
the covariance of the prediction is too small instead (the IMU is worse than its datasheet, or disturbed), the filter
follows the motion too slowly, and the error of the state is in many innovations in a row: their correlation is above
zero. R. K. Mehra, *On the identification of variances and adaptive Kalman filtering*, IEEE Trans. Automatic Control
15(2), 1970, derives both covariances from this correlation.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

__all__ = ["Course"]

#: Memory of a course [innovations].
MEMORY = 20


class Course:
    """The recent innovations of one instrument, standardised by ``H P H' + R`` with the datasheet's noise R.

    The sums fade with a memory of `MEMORY` innovations. With the product p of a component in two successive
    innovations, ``sum(p) / sqrt(sum(p^2))`` over all components is about standard normal if the innovations are
    independent and symmetrical, whatever their size.

    That needs about six innovations. Where they have no preferred direction either, as a noise larger than R has none,
    fewer are enough: the cosine of the angle between two successive innovations of m components then has the mean 0 and
    the variance 1/m. So ``sum(cosine) sqrt(m / n)`` over the n pairs of a run has unit variance, whatever the sizes. A
    run is a number of successive innovations that all fail their tests.

    Attributes
    ----------
    time : float
        Time of the last innovation [s].
    """

    __slots__ = (
        "_before", "_cosines", "_count", "_failed", "_freedom", "_pairs", "_product", "_square", "_squares", "time",
    )  # fmt: skip

    def __init__(self) -> None:
        self.time = -np.inf
        self._before = (0.0, 0.0, 0.0)
        self._product = self._square = self._squares = self._freedom = 0.0
        self._failed, self._pairs, self._cosines, self._count = False, 0, 0.0, 1

    def add(self, components: tuple[float, float, float], count: int, time: float, failed: bool = False) -> None:
        """Add an innovation.

        Parameters
        ----------
        components : (float, float, float)
            Standardised components, with zeros up to three.
        count : int
            Number of components.
        time : float
            Time [s].
        failed : bool
            Whether the innovation has failed its chi-square test.
        """
        u0, u1, u2 = components
        b0, b1, b2 = self._before
        fading = 1.0 - 1.0 / MEMORY
        p0, p1, p2 = u0 * b0, u1 * b1, u2 * b2
        self._product = fading * self._product + p0 + p1 + p2
        self._square = fading * self._square + p0 * p0 + p1 * p1 + p2 * p2
        self._squares = fading * self._squares + u0 * u0 + u1 * u1 + u2 * u2
        self._freedom = fading * self._freedom + count
        if failed and self._failed:
            self._pairs += 1
            self._cosines += (p0 + p1 + p2) / sqrt((u0 * u0 + u1 * u1 + u2 * u2) * (b0 * b0 + b1 * b1 + b2 * b2))
        else:
            self._pairs, self._cosines = 0, 0.0
        self._before, self.time, self._failed, self._count = components, time, failed, count

    def correlated(self, quantile: float) -> bool:
        """Whether successive innovations have a correlation above zero, by a quantile of the normal distribution."""
        return self._product > 0.0 and self._product * self._product > quantile * quantile * self._square

    def directed(self, quantile: float) -> bool:
        """Whether the innovations of the present run have a common direction, by a normal quantile."""
        return self._pairs > 0 and self._cosines * sqrt(self._count / self._pairs) > quantile

    def large(self, quantile: float) -> bool:
        """Whether the squares are too large for R and H P H', by a quantile of the normal distribution.

        The limit of chi-square follows from it by the approximation of E. B. Wilson and M. M. Hilferty, *The
        distribution of chi-square*, PNAS 17, 1931.
        """
        spread = 2.0 / (9.0 * self._freedom)
        return bool(self._squares > self._freedom * (1.0 - spread + quantile * spread**0.5) ** 3)
