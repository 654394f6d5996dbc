"""The row ``iekf``: the iterated EKF over the inertial model."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.ekf import AidedInertial
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.iterated import Iteration

__all__ = ["IteratedEkf"]


@register("iekf", aliases=("iterated-ekf",))
class IteratedEkf(AidedInertial):
    """Iterated 15-state EKF: each measurement is linearised again until the correction stands still.

    Parameters
    ----------
    limit : int
        Most linearisations of one measurement; 1 is the EKF.
    threshold : float
        Change of the correction at which it has converged, in sigmas.
    calibrate : bool
        As of ``ekf``.
    """

    def __init__(self, limit: int = 10, threshold: float = 1e-3, calibrate: bool = True):
        super().__init__(InertialModel(calibrate), iteration=Iteration(limit=limit, threshold=threshold))
