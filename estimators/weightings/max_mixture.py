"""Max-mixture: the noise of a measurement is the nominal or a wide one, whichever is the more probable.

E. Olson and P. Agarwal, "Inference on networks of mixtures for robust robot mapping", *International Journal of
Robotics Research* 32(7), 2013, eq. 6: the sum of a Gaussian mixture is replaced by its largest component. Of the two,

    ``(1 - p) N(v; 0, R)``  and  ``p N(v; 0, s^2 R)``,

for a residual v of m components with the nominal noise R, the second is the larger if

    ``v' R^-1 v > 2 (m ln s + ln((1 - p)/p)) / (1 - 1/s^2)``.

Then the information is ``1/s^2`` of the nominal one. Both densities are normalised; without the factor ``s^-m`` the
wide one would always be larger. p is the probability of the wide noise, and s the ratio of the sigmas.
"""

from __future__ import annotations

from functools import partial
from math import log

import numpy as np

from simnav.types import Array

from .m_estimators import MEstimator

__all__ = ["MaxMixture"]


def _component(u: Array, wide: float) -> Array:
    return np.where(u <= 1.0, 1.0, wide)


class MaxMixture(MEstimator):
    """The weighting of the module. The information of an outlier is small but never zero.

    Parameters
    ----------
    spread : float
        Ratio s of the sigma of the wide component to the nominal one, above 1.
    probability : float
        Prior probability p that a measurement has the wide noise.
    """

    def __init__(self, spread: float = 10.0, probability: float = 0.05):
        if not spread > 1.0:
            raise ValueError(f"spread = {spread:g}: it must be above 1")
        if not 0.0 < probability < 1.0:
            raise ValueError(f"probability = {probability:g}: it must lie between 0 and 1")
        odds = log((1.0 - probability) / probability)
        limits = [2.0 * (m * log(spread) + odds) / (1.0 - spread**-2) for m in (1, 2, 3)]
        if min(limits) <= 0.0:
            raise ValueError(
                f"spread = {spread:g} and probability = {probability:g}: the wide component would be the more probable "
                "at any residual"
            )
        a, b, c = (x**0.5 for x in limits)
        super().__init__(partial(_component, wide=spread**-2), (a, b, c), 0.0)
