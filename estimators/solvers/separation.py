"""The test of solution separation: the limits of the difference between a sub-filter and the main filter.

The sub-filter uses all measurements of the main filter except those of one instrument. If the model is right, the
difference of their estimates, the separation d, has the covariance

    cov(d) = P_i - P_0                                              (R. G. Brown and P. W. McBurney 1988)

with the covariance P_i of sub-filter i and P_0 of the main filter. This gives the threshold
``T_i = K_fa sqrt(P_i - P_0)`` of position, velocity and heading, with the quantile K_fa of the probability of false
alarm. The heading of a filter without a compass may be uncertain. A heading error of ``K_fa`` sigmas changes a velocity
v by ``v (K_fa sigma)^2 / 2`` at second order, which no covariance contains. So this is added to the threshold of the
horizontal velocity.

A filter whose heading sigma is above `KNOWN_HEADING` is not tested, because filters then differ by their linearisation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians

import numpy as np

from simnav.estimators.models.inertial_errors import ERROR, PART
from simnav.types import Array, Estimate

from .hypotheses import Hypothesis
from .state_difference import differences

__all__ = ["KNOWN_HEADING", "SeparationTest"]

#: Components whose separation is tested: position, velocity, heading.
_TESTED = (*range(PART.motion.start, PART.motion.stop), ERROR.heading)
_IS_TESTED = np.isin(np.arange(PART.navigation.stop), _TESTED)
#: The velocity north and east.
_HORIZONTAL = slice(ERROR.velocity, ERROR.velocity + 2)
#: Part of the main filter's sigma that a separation may have by linearisation alone.
_LINEARISATION = 0.1
#: Standard deviation of the heading up to which a filter is compared with another one [rad].
KNOWN_HEADING = radians(5.0)


class SeparationTest:
    """The test of the module.

    Parameters
    ----------
    false_alarm : float
        Probability that a test fails without a fault, in (0, 1).
    filters : int
        Number of sub-filters that are tested at once.
    inertial : bool
        Whether the vessel has an IMU. One without has a compass, so that its heading is known.
    """

    def __init__(self, false_alarm: float, filters: int, inertial: bool):
        from scipy.special import ndtri  # to import scipy.stats takes 0.8 s

        self.factor = -float(ndtri(0.5 * false_alarm / (max(filters, 1) * len(_TESTED))))
        self._inertial = inertial

    def applies(self, estimate: Estimate | None) -> bool:
        """Whether the heading of a filter is certain enough for a comparison."""
        if not self._inertial or estimate is None or estimate.covariance is None:
            return True
        return float(estimate.covariance[ERROR.heading, ERROR.heading]) <= KNOWN_HEADING**2

    def variances(self, subs: Sequence[Hypothesis], estimate: Estimate) -> tuple[Array, Array]:
        """(k, 9) variances of sub-filters' components, and of their separation from the main filter's estimate."""
        assert estimate.covariance is not None
        main = estimate.covariance.diagonal()
        own = np.array([_estimate_of(sub).covariance.diagonal() for sub in subs])  # type: ignore[union-attr]
        apart = np.maximum(own - main, 0.0) + _LINEARISATION**2 * main
        if estimate.velocity is not None:  # a heading error as large as its test allows, at second order
            heading = own[:, ERROR.heading, None]
            apart[:, _HORIZONTAL] += (0.5 * self.factor * heading * estimate.velocity[:2]) ** 2
        return own, apart

    def largest(self, groups: Mapping[str, Sequence[Hypothesis]], estimate: Estimate) -> dict[str, float]:
        """The largest ratio of separation to threshold, over all tested components of the sub-filters of each group.

        Parameters
        ----------
        groups : mapping of str to sequence of Hypothesis
            The sub-filters that are compared.
        estimate : Estimate
            Estimate of the main filter.
        """
        ratios = dict.fromkeys(groups, 0.0)
        tested = [(name, sub) for name, subs in groups.items() for sub in subs if self.applies(_estimate_of(sub))]
        if not tested:
            return ratios
        names, subs = zip(*tested)
        apart = np.abs(differences([_estimate_of(sub) for sub in subs], estimate))
        _, variance = self.variances(subs, estimate)
        counted = (estimate.mask() & _IS_TESTED) & (variance > 0.0)
        ratio = np.divide(apart, self.factor * np.sqrt(variance), out=np.zeros_like(apart), where=counted)
        for name, row in zip(names, ratio.tolist()):
            ratios[name] = max(ratios[name], *row)
        return ratios


def _estimate_of(sub: Hypothesis) -> Estimate:
    assert sub.estimate is not None
    return sub.estimate
