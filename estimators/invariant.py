"""The row ``inekf``: the invariant EKF over the inertial model."""

from __future__ import annotations

from typing import Literal

from simnav.estimator import register
from simnav.estimators.ekf import AidedInertial
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.invariant import InvariantKalmanEstimator

__all__ = ["InvariantEkf"]


@register("inekf", aliases=("invariant-ekf",))
class InvariantEkf(InvariantKalmanEstimator, AidedInertial):
    """Invariant 15-state EKF on SE_2(3) with biases (Barrau and Bonnabel 2017).

    Parameters
    ----------
    error : "left" or "right"
        Which error is invariant: left for position-like measurements (GNSS), right for a DVL.
    calibrate : bool
        As of ``ekf``.
    """

    def __init__(self, error: Literal["left", "right"] = "left", calibrate: bool = True):
        super().__init__(InertialModel(calibrate), error=error)
