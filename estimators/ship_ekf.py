"""The row ``ship-ekf``: extended Kalman filter over the ship model."""

from __future__ import annotations

from estimators.ship_row import ShipRow
from estimators.solvers.kalman import KalmanEstimator
from simnav.estimator import register

__all__ = ["ShipEkf"]


@register("ship-ekf")
class ShipEkf(ShipRow, KalmanEstimator):
    """EKF on GNSS, compass and log, for a ship without an INS; estimates log and compass bias and the current.

    After the EKF of paper 002 (`estimators.models.ship`). It uses no IMU.

    Parameters
    ----------
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model (`estimators.ship_row`).
    """
