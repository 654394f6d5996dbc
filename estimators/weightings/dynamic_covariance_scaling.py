"""Dynamic covariance scaling: the covariance of a measurement with a large residual is increased.

P. Agarwal, G. D. Tipaldi, L. Spinello, C. Stachniss and W. Burgard, "Robust map optimization using dynamic covariance
scaling", ICRA 2013, eq. 15: with ``chi^2 = v' R^-1 v`` and a constant F, the information is multiplied by ``s^2``,

    ``s = min(1, 2 F / (F + chi^2))``.

It is 1 up to ``chi^2 = F``; beyond, twice the ``s = F / (F + chi^2)`` of
`simnav.estimators.weightings.switchable_constraints` with ``F = 1/sigma_s^2``.

The paper uses F = 1 for any number of components. With 3 components, 80 % of Gaussian noise exceeds this limit, and the
efficiency on Gaussian noise is 0.48. The default F therefore has an efficiency of 98 %: 4.96, 6.02 and 7.04 for
1, 2 and 3 components.
"""

from __future__ import annotations

import numpy as np

from simnav.types import Array

from .m_estimators import MEstimator, constants

__all__ = ["DynamicCovarianceScaling", "covariance_scaling"]


def covariance_scaling(u: Array) -> Array:
    """The weight ``min(1, 2 / (1 + u^2))^2`` for ``u = chi / sqrt(F)``."""
    s = 2.0 / np.maximum(1.0 + u * u, 2.0)
    return s * s


class DynamicCovarianceScaling(MEstimator):
    """The weighting of the module.

    Parameters
    ----------
    phi : float
        Constant F for any number of components, 1 in the paper; 0: it follows from ``efficiency``.
    efficiency : float
        Asymptotic efficiency on Gaussian noise, from which F follows if ``phi`` is 0.
    """

    def __init__(self, phi: float = 0.0, efficiency: float = 0.98, smallest: float = 1e-3):
        if not phi >= 0.0:
            raise ValueError(f"phi = {phi:g}: it must be above 0, or 0 for that of the efficiency")
        tuned = (phi**0.5,) * 3 if phi > 0.0 else constants(covariance_scaling, efficiency)
        super().__init__(covariance_scaling, tuned, smallest)
