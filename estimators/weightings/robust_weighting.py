"""The common part of robust weightings: measurements and motion are weighted by their residuals.

If only measurements were weighted and the motion is wrong (a disturbed IMU), all measurements would get small weights,
and the window would follow the IMU. In a graph, motion is a factor like any other, and is weighted, too, as in Guo et
al. (2026) (`weigh_motion`). If fixes and logs contradict the motion together,
`simnav.estimators.weightings.fault_isolation` decides which of them is wrong.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import cache

from simnav.compiled import kernel
from simnav.kernel_types import Vector

from .base import Factors, Weighting

__all__ = ["RobustWeighting", "weigh_motion"]


@cache
def _quantile(n: int) -> float:
    """99.9 % quantile of the chi distribution with n degrees of freedom (Wilson and Hilferty 1931)."""
    return float(n**0.5 * (1.0 - 2.0 / (9.0 * n) + 3.0902 * (2.0 / (9.0 * n)) ** 0.5) ** 1.5)


@kernel
def _weigh_motion(quantile: float, norm: Vector, weight: Vector, smallest: float, aid_weight: Vector) -> None:
    """Set the weights of motion factors (`weigh_motion`); raise those of measurements to the smallest."""
    for k in range(norm.size):
        u = quantile / max(norm[k], quantile)
        weight[k] = u * u
    for i in range(aid_weight.size):
        if aid_weight[i] < smallest:
            aid_weight[i] = smallest


def weigh_motion(factors: Factors, smallest: float = 0.0) -> None:
    """Set the weights of motion factors to ``min(1, (c/r)^2)``, with the whitened norm r.

    c is the 99.9 % quantile of the chi distribution with n degrees of freedom. So the noise of a motion factor
    increases to the size of its residual. Without faults the weights are 1, because the residuals of motion in a window
    are smaller than its noise.

    Parameters
    ----------
    factors : Factors
        The factors of a window.
    smallest : float
        Smaller weights of measurements are raised to this.
    """
    quantile = _quantile(factors.motion_residual.shape[1])
    _weigh_motion.unchecked(quantile, factors.motion_norm, factors.motion_weight, smallest, factors.weight)


class RobustWeighting(Weighting):
    """A weighting that starts each epoch with the weights of the last one; a subclass defines `choose`.

    A new measurement has its full weight at the first iteration of an epoch, and is then weighted by its residual after
    this iteration. So a measurement that contradicts a well-known state gets a small weight. A measurement that
    corrects an uncertain state, as after an outage, keeps its weight, although its residual before the solution,
    whitened by R alone, is as large as that of an outlier.

    Parameters
    ----------
    smallest : float
        Smallest weight of a measurement. With a redescending function a window with a wrong state gives good
        measurements no weight, and never recovers. With 0.001, an error of 30 sigma has the influence of 0.03 sigma, so
        many good measurements together correct the window, though slowly. 0 is the form in the literature.
    """

    def __init__(self, smallest: float = 1e-3):
        if not 0.0 <= smallest <= 1.0:
            raise ValueError(f"smallest = {smallest:g}: it must lie in [0, 1]")
        self.smallest = smallest

    def weigh(self, factors: Factors) -> bool:
        """Set the weights of the measurements and of motion."""
        if factors.iteration == 0:
            self.begin()
            return False
        settled = self.choose(factors)
        weigh_motion(factors, self.smallest)
        return settled

    def begin(self) -> None:
        """Start an epoch; subclasses may override it."""

    @abstractmethod
    def choose(self, factors: Factors) -> bool:
        """Set the weights of the measurements; the result is that of `Weighting.weigh`."""
