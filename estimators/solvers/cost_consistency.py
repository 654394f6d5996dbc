"""The chi-square test of a window's cost: whether the residuals of a window agree with model and noise.

At the least-squares solution, twice the cost is a sum of squares of unit variance. If model and noise are right, it has
a chi-square distribution. Its degrees of freedom are the number of aiding components, because prior and motion have as
many components as there are unknowns. If the cost stays improbably large, the window has not found the solution, or its
model is wrong. In both cases its covariance, which does not depend on the residuals, is too small. It is then
multiplied by the *variance factor*, twice the cost divided by the degrees of freedom.

In a robust window the degrees of freedom are the sum of the weights of the components. Weighted residuals are smaller
than this, so the test detects less. Successive windows share most of their measurements, so one bad epoch makes the
cost of many windows improbable. Therefore the test reports an inconsistency only if the cost has been improbable for
`PATIENCE` epochs in a row.

A window that was drawn away by wrong measurements agrees with them as soon as all that contradicted them has left it.
Its position does not come back by that. So it is still reported while at least `LASTING` of the last `LONG` epochs were
improbable; the covariance is then that of the window as it is.

Source: P. J. G. Teunissen, *Testing Theory*, VSSD, 2006 (overall model test); the normal approximation is E. B. Wilson
and M. M. Hilferty, "The distribution of chi-square", Proc. Nat. Acad. Sci. 17(12), 1931.
"""

from __future__ import annotations

from collections import deque
from math import sqrt

from simnav.compiled import helper

__all__ = ["IMPROBABLE", "LASTING", "LONG", "PATIENCE", "CostTest", "chi_square_deviate"]

#: Standard normal deviate beyond which a cost is improbable (one in 30 000).
IMPROBABLE = 4.0
#: Epochs in a row for which it must be improbable.
PATIENCE = 5
#: Number of epochs that are remembered: as many as a filter sums up. So many of them must have been improbable.
LONG, LASTING = 100, 20


@helper
def chi_square_deviate(value: float, freedom: float) -> float:
    """The standard normal deviate with the same tail probability as a value of chi-square.

    Parameters
    ----------
    value : float
        Value of the chi-square variable, 0 or more.
    freedom : float
        Degrees of freedom, above 0.

    Examples
    --------
    >>> round(chi_square_deviate(124.34, 100.0), 1)  # the 95th percentile
    1.6
    """
    spread = 2.0 / (9.0 * freedom)
    deviate: float = ((value / freedom) ** (1.0 / 3.0) - 1.0 + spread) / sqrt(spread)
    return deviate


class CostTest:
    """The test of the module, epoch by epoch; the sum of squares is twice the cost.

    Attributes
    ----------
    variance_factor : float
        The sum over its degrees of freedom, of the last epoch; NaN before the first.
    """

    def __init__(self) -> None:
        self.variance_factor = float("nan")
        self._improbable = 0
        self._recent: deque[bool] = deque(maxlen=LONG)

    @property
    def lasting(self) -> bool:
        """Whether so many of the last epochs had an improbable sum that the estimate may still be wrong."""
        return self.inconsistent or (len(self._recent) == LONG and sum(self._recent) >= LASTING)

    @property
    def inconsistent(self) -> bool:
        """Whether the sum has been improbable for `PATIENCE` epochs in a row."""
        return self._improbable >= PATIENCE

    @property
    def inflation(self) -> float:
        """Factor on the covariance: the variance factor if the window is inconsistent, otherwise 1."""
        return max(1.0, self.variance_factor) if self.inconsistent else 1.0

    def add(self, cost: float, freedom: float) -> None:
        """Add the cost of an epoch (half the sum of squares) and its degrees of freedom; 0 degrees are ignored."""
        if freedom > 0.0:
            squares = 2.0 * cost
            self.variance_factor = squares / freedom
            improbable = chi_square_deviate(squares, freedom) > IMPROBABLE
            self._improbable = self._improbable + 1 if improbable else 0
            self._recent.append(improbable)
