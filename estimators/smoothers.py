"""The rows ``ekf-rts`` and ``ship-ekf-rts``: smoothers, for the post-processing track."""

from __future__ import annotations

from estimators.ekf import Ekf
from estimators.ship_ekf import ShipEkf
from estimators.solvers.smoother import SmoothingEstimator
from simnav.estimator import register

__all__ = ["EkfRts", "ShipEkfRts"]


@register("ekf-rts")
class EkfRts(SmoothingEstimator, Ekf):
    """The EKF with a Rauch-Tung-Striebel smoother behind it (`estimators.solvers.smoother`).

    In real time it is ``ekf``; the trajectory after the run is smoothed.
    """


@register("ship-ekf-rts")
class ShipEkfRts(SmoothingEstimator, ShipEkf):
    """The ship EKF with a Rauch-Tung-Striebel smoother behind it (`estimators.solvers.smoother`).

    In real time it is ``ship-ekf``; the trajectory after the run is smoothed.
    """
