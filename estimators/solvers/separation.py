"""The test of solution separation: how far a sub-filter may be from the main one, component by component.

Both use the same measurements but for those of one instrument, so that for filters with the right model the separation
d has the covariance

    cov(d) = P_i - P_0                                              (R. G. Brown and P. W. McBurney 1988)

which gives the threshold ``T_i = K_fa sqrt(P_i - P_0)`` of position, velocity and heading. A filter without a compass
may not know its heading well. A heading error of ``K_fa`` sigmas changes a velocity v by ``v (K_fa sigma)^2 / 2`` at
second order, which is in no covariance. So this is added to the threshold of the horizontal velocity.

A filter that knows its heading to no better than `KNOWN_HEADING` is not tested: filters differ by their linearisation
there.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import radians, sqrt

import numpy as np

from simnav.estimators.solvers.hypotheses import Hypothesis
from simnav.estimators.solvers.state_difference import difference
from simnav.types import Array, Estimate

__all__ = ["KNOWN_HEADING", "SeparationTest"]

#: Components whose separation is tested: position, velocity, heading.
_TESTED = (0, 1, 2, 3, 4, 5, 8)
#: Part of the main filter's sigma that a separation may have by linearisation alone.
_LINEARISATION = 0.1
#: Standard deviation of the heading up to which a filter is compared with another one [rad].
KNOWN_HEADING = radians(5.0)


class SeparationTest:
    """The test of the module.

    Parameters
    ----------
    false_alarm : float
        Probability of a test to fail where nothing is wrong, in (0, 1).
    filters : int
        Number of sub-filters that are tested at once.
    inertial : bool
        Whether the vessel has an IMU. One without has a compass, so that its heading is known.
    """

    def __init__(self, false_alarm: float, filters: int, inertial: bool):
        from scipy.stats import norm

        self.factor = float(norm.isf(0.5 * false_alarm / (max(filters, 1) * len(_TESTED))))
        self._inertial = inertial

    def applies(self, estimate: Estimate | None) -> bool:
        """Whether a filter knows its heading well enough to be compared."""
        if not self._inertial or estimate is None or estimate.covariance is None:
            return True
        return float(estimate.covariance[8, 8]) <= KNOWN_HEADING**2

    def variances(self, sub: Hypothesis, estimate: Estimate) -> tuple[Array, Array]:
        """Variances of a sub-filter's nine components, and of its separation from the main filter's estimate."""
        assert sub.estimate is not None
        assert sub.estimate.covariance is not None
        assert estimate.covariance is not None
        main = estimate.covariance.diagonal()
        own = sub.estimate.covariance.diagonal()
        apart = np.maximum(own - main, 0.0) + _LINEARISATION**2 * main
        if estimate.velocity is not None:  # a heading error as large as its test allows, at second order
            apart[3:5] += (0.5 * self.factor * own[8] * estimate.velocity[:2]) ** 2
        return own, apart

    def largest(self, subs: Iterable[Hypothesis], estimate: Estimate) -> float:
        """The largest separation over its threshold, of all tested components of the sub-filters.

        Parameters
        ----------
        subs : iterable of Hypothesis
            The sub-filters.
        estimate : Estimate
            The main filter's estimate.
        """
        mask, largest = estimate.mask(), 0.0
        for sub in subs:
            assert sub.estimate is not None
            if not self.applies(sub.estimate):
                continue
            apart = difference(sub.estimate, estimate).tolist()
            _, variance = self.variances(sub, estimate)
            for q in _TESTED:
                if mask[q] and variance[q] > 0.0:
                    largest = max(largest, abs(apart[q]) / (self.factor * sqrt(variance[q])))
        return largest
