"""The chi-square test of a window's cost: does the window explain its measurements?

At the least-squares solution, twice the cost is a sum of squares of unit variance. If model and noise are right it is
distributed as chi-square with as many degrees of freedom as there are aiding components: the prior and the motion have
as many components as there are unknowns. Where it stays improbably large, the window has not found the solution, or
its model is wrong. Either way its covariance, which does not depend on the residuals, promises too much. It is then
multiplied by the *variance factor*, twice the cost over the degrees of freedom.

A weight counts for the part of a component that it leaves. Weighted residuals are smaller than that, so the test of a
robust window errs on the quiet side. Successive windows share most of their measurements, so that one bad epoch makes
many windows improbable: the test speaks only when the cost has been improbable for `PATIENCE` epochs in a row.

Source: P. J. G. Teunissen, *Testing Theory*, VSSD, 2006 (overall model test); the normal approximation is E. B. Wilson
and M. M. Hilferty, "The distribution of chi-square", Proc. Nat. Acad. Sci. 17(12), 1931.
"""

from __future__ import annotations

from math import sqrt

__all__ = ["ConsistencyTest", "CostTest", "chi_square_deviate"]

#: Standard normal deviate beyond which a cost is improbable (one in 30 000).
IMPROBABLE = 4.0
#: Epochs in a row for which it must be improbable.
PATIENCE = 5


def chi_square_deviate(value: float, freedom: float) -> float:
    """The standard normal deviate that is as improbable as a value of chi-square.

    Parameters
    ----------
    value : float
        Of chi-square, 0 or more.
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


class ConsistencyTest:
    """A sum of squares of unit variance, tested epoch by epoch.

    Attributes
    ----------
    variance_factor : float
        The sum over its degrees of freedom, of the last epoch; NaN before the first.
    inconsistent : bool
        Whether it has been improbable for `PATIENCE` epochs.
    """

    def __init__(self) -> None:
        self.variance_factor = float("nan")
        self._improbable = 0

    @property
    def inconsistent(self) -> bool:
        """Whether the solver does not explain its measurements."""
        return self._improbable >= PATIENCE

    def judge(self, squares: float, freedom: float) -> None:
        """Take the sum of an epoch, and its degrees of freedom, above 0."""
        self.variance_factor = squares / freedom
        self._improbable = self._improbable + 1 if chi_square_deviate(squares, freedom) > IMPROBABLE else 0


class CostTest(ConsistencyTest):
    """The test of the module; the sum of squares is twice the cost."""

    @property
    def inflation(self) -> float:
        """What the covariance is to be multiplied by: the variance factor where inconsistent, else 1."""
        return max(1.0, self.variance_factor) if self.inconsistent else 1.0

    def add(self, cost: float, freedom: float) -> None:
        """Take the cost of an epoch, half a sum of squares, and its degrees of freedom; none without any."""
        if freedom > 0.0:
            self.judge(2.0 * cost, freedom)
