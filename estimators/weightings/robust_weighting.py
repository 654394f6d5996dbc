"""What robust weightings share: measurements are weighed by their residuals, and so is motion.

With measurements alone being weighed, a motion that is wrong (a disturbed IMU) is not seen as such: no measurement
fits, none is believed, and the window follows the IMU to wherever it goes. In a graph, motion is a factor like any
other, and is weighed too, as in Guo et al. (2026) (`weigh_motion`). Where fixes and logs contradict the motion
together, `simnav.estimators.weightings.fault_isolation` finds out which of them is wrong.
"""

from __future__ import annotations

from abc import abstractmethod
from functools import cache

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.weightings.base import Factors, Weighting
from simnav.types import Array

__all__ = ["RobustWeighting", "weigh_motion"]


@cache
def _quantile(n: int) -> float:
    """99.9 % quantile of chi of n components (Wilson and Hilferty 1931)."""
    return float(n**0.5 * (1.0 - 2.0 / (9.0 * n) + 3.0902 * (2.0 / (9.0 * n)) ** 0.5) ** 1.5)


@kernel("void(f8, f8[::1], f8[::1])")
def _weigh_motion(quantile: float, norm: Array, weight: Array) -> None:
    for k in range(norm.size):
        u = quantile / max(norm[k], quantile)
        weight[k] = u * u


def weigh_motion(factors: Factors) -> None:
    """Weigh motion by ``min(1, (c/r)^2)`` of its whitened norm r, c being the 99.9 % quantile of chi of n components.

    The noise believed of a motion grows to what its residual shows. On sound data the weights are 1: the residuals of
    motion in a window are smaller than its noise.
    """
    _weigh_motion(_quantile(factors.motion_residual.shape[1]), factors.motion_norm, factors.motion_weight)


class RobustWeighting(Weighting):
    """A weighting that begins each epoch with the weights of the last; a subclass gives `choose`.

    A new measurement counts in full at an epoch's first iteration and is weighed by what is then left of its residual.
    So one that contradicts a window that is sure is suppressed, and one that corrects a window that is unsure, as
    after an outage, is not: whitened by R alone, its residual before the solution would look like an outlier's.

    Parameters
    ----------
    smallest : float
        Least weight. A redescending function can lock a window out that is wrong itself: the good measurements then
        have no weight, and nothing pulls it back. With 0.001, an error of 30 sigma pulls by 0.03 sigma, and many
        good measurements together bring the window back, if slowly. 0 is the literature's form.
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
        np.maximum(factors.weight, self.smallest, out=factors.weight)
        weigh_motion(factors)
        return settled

    def begin(self) -> None:
        """An epoch begins; a hook."""

    @abstractmethod
    def choose(self, factors: Factors) -> bool:
        """Set the weights of the measurements; as `Weighting.weigh`."""
