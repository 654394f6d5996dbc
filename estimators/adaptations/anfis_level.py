"""The level of the noise of fixes, as a multiple of the datasheet's variance, learned from the last innovations.

The network of `simnav.estimators.adaptations.anfis` was trained where the datasheet is right. Its input is an
innovation in units of the datasheet. If the true noise is three times the datasheet's for the whole run, every large
innovation looks like a gross error, and the fixes that agree with the filter's own error get the smallest noise. With
the level the inputs are in units of the noise that there is, and the output is relative to it.

With the innovation v of m components, e = v' R^-1 v / m and p = tr(R^-1 H P H') / m with the datasheet's R, e is about
(p + L) times a chi-square variable of m degrees of freedom over m, if the noise has the variance L R. So L is the
median of e divided by that of the chi-square variable, minus the median of p, over the last fixes. A median is not
changed much by gross errors, as long as they are few.

The datasheet is used until the innovations contradict it: L is 1 unless the number of fixes with an e above the median
that the datasheet predicts is larger than half of them by `SIGMAS` standard deviations of a fair coin.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .base import Innovation

__all__ = ["Level"]


class Level:
    """The level of one instrument.

    Attributes
    ----------
    value : float
        The factor L of the variance, 1 or more.
    """

    #: Number of fixes that are remembered, and number from which on the datasheet may be contradicted.
    MEMORY, FEWEST = 100, 20
    #: Standard deviations by which the datasheet must be contradicted.
    SIGMAS = 3.0

    def __init__(self) -> None:
        self.value = 1.0
        self._squares, self._predicted = np.empty(self.MEMORY), np.empty(self.MEMORY)
        self._fixes = 0

    def observe(self, innovation: Innovation) -> None:
        """Take the innovation of a fix, with the datasheet's noise; the level counts for the next fix."""
        m = len(innovation.residual)
        information = np.linalg.inv(innovation.noise)
        square = float(innovation.residual @ information @ innovation.residual) / m
        oldest = self._fixes % self.MEMORY
        self._squares[oldest] = square
        self._predicted[oldest] = float(np.trace(information @ innovation.predicted)) / m
        self._fixes += 1
        n, middle = min(self._fixes, self.MEMORY), _median(m) / m
        if n < self.FEWEST:
            return
        squares, predicted = self._squares[:n], self._predicted[:n]
        above = int((squares > (1.0 + predicted) * middle).sum())
        if above - 0.5 * n <= self.SIGMAS * 0.5 * n**0.5:
            self.value = 1.0
            return
        self.value = max(1.0, float(np.median(squares)) / middle - float(np.median(predicted)))


@cache
def _median(dof: int) -> float:
    """Median of a chi-square variable."""
    from scipy.special import chdtri

    return float(chdtri(dof, 0.5))
