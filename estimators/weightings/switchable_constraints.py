"""Switchable constraints, with the switches eliminated in closed form.

N. Sünderhauf and P. Protzel, "Switchable constraints for robust pose graph SLAM", IROS 2012: each measurement gets a
switch s, its residual becomes s v, and a prior of sigma_s holds the switch at 1. Of the two residuals
``[s L^-1 v; (s - 1)/sigma_s]`` with ``chi^2 = v' R^-1 v`` the cost is

    ``s^2 chi^2 + (s - 1)^2 / sigma_s^2``,

v is the residual and ``R = L L'`` the covariance of its noise. For any given state the cost is smallest at

    ``s = F / (F + chi^2)``,  ``F = 1/sigma_s^2``,

where it is ``F chi^2 / (F + chi^2)``. This s is in [0, 1]. So instead of a state for each switch, the information of
each measurement is multiplied by ``s^2``, and the minimum is the same. The resulting cost is that of
Geman and McClure with ``c = 1/sigma_s``: the two methods differ only in the choice of c
(Agarwal et al. 2013; the duality of Black and Rangarajan 1996).
"""

from __future__ import annotations

from .m_estimators import MEstimator, geman_mcclure

__all__ = ["SwitchableConstraints"]


class SwitchableConstraints(MEstimator):
    """The weighting of the module.

    Parameters
    ----------
    sigma : float
        Standard deviation sigma_s of the prior of a switch, for measurements of one component. For m components it is
        ``sigma / sqrt(m)``, so that a measurement with the expected ``chi^2 = m`` has the same switch. The paper has 1,
        with an efficiency on Gaussian noise of 44 to 66 %; with 0.3 it is 93 to 98 %.
    """

    def __init__(self, sigma: float = 0.3, smallest: float = 1e-3):
        if not sigma > 0.0:
            raise ValueError(f"sigma = {sigma:g}: it must be above 0")
        c = 1.0 / sigma
        super().__init__(geman_mcclure, (c, c * 2.0**0.5, c * 3.0**0.5), smallest)
