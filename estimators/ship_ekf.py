"""The row ``ship-ekf``: extended Kalman filter over the ship model."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.ship_row import ShipRow
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["ShipEkf"]


@register("ship-ekf")
class ShipEkf(ShipRow, KalmanEstimator):
    """EKF on GNSS, compass and log, for a ship without an INS; estimates log and compass bias and the current.

    After the EKF of paper 002 (`simnav.estimators.models.ship`). It uses no IMU.

    Parameters
    ----------
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model (`simnav.estimators.ship_row`).
    """
