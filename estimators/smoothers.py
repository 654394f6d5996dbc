"""The rows ``ekf-rts``, ``ekf-two-filter`` and ``ship-ekf-rts``: smoothers, for the post-processing track."""

from __future__ import annotations

from estimators.ekf import Ekf
from estimators.ship_ekf import ShipEkf
from estimators.solvers.smoother import SmoothingEstimator
from estimators.solvers.two_filter import TwoFilterEstimator
from simnav.estimator import register

__all__ = ["EkfRts", "EkfTwoFilter", "ShipEkfRts"]


@register("ekf-rts")
class EkfRts(SmoothingEstimator, Ekf):
    """The EKF with a Rauch-Tung-Striebel smoother behind it (`estimators.solvers.smoother`).

    In real time it is ``ekf``; the trajectory after the run is smoothed.
    """


@register("ekf-two-filter")
class EkfTwoFilter(TwoFilterEstimator, Ekf):
    """The EKF with the two-filter smoother of paper 004 behind it (`estimators.solvers.two_filter`).

    In real time it is ``ekf``; the smoothed trajectory is that of ``ekf-rts``, by another way.

    Parameters
    ----------
    seed_backward : bool
        Start the backward pass with the forward result, as the paper prints it: all data count twice, and the
        covariance promises too much.
    calibrate : bool
        As of ``ekf``.
    """

    def __init__(self, seed_backward: bool = False, calibrate: bool = True):
        super().__init__(calibrate)
        self.seed_backward = seed_backward


@register("ship-ekf-rts")
class ShipEkfRts(SmoothingEstimator, ShipEkf):
    """The ship EKF with a Rauch-Tung-Striebel smoother behind it (`estimators.solvers.smoother`).

    In real time it is ``ship-ekf``; the trajectory after the run is smoothed.
    """
