"""The rows ``ekf-rts``, ``ekf-two-filter`` and ``ship-ekf-rts``: smoothers, for the post-processing track."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.ekf import Ekf
from simnav.estimators.ship_ekf import ShipEkf
from simnav.estimators.solvers.smoother import SmoothingEstimator
from simnav.estimators.solvers.two_filter import TwoFilterEstimator

__all__ = ["EkfRts", "EkfTwoFilter", "ShipEkfRts"]


@register("ekf-rts")
class EkfRts(SmoothingEstimator, Ekf):
    """The EKF with a Rauch-Tung-Striebel smoother behind it (`simnav.estimators.solvers.smoother`).

    In real time it is ``ekf``; the trajectory after the run is smoothed.
    """


@register("ekf-two-filter")
class EkfTwoFilter(TwoFilterEstimator, Ekf):
    """The EKF with the two-filter smoother of paper 004 behind it (`simnav.estimators.solvers.two_filter`).

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
    """The ship EKF with a Rauch-Tung-Striebel smoother behind it (`simnav.estimators.solvers.smoother`).

    In real time it is ``ship-ekf``; the trajectory after the run is smoothed.
    """
