"""The row ``ship-ekf``: extended Kalman filter over the ship model."""

from __future__ import annotations

from math import radians

from estimators.models.ship import ShipModel, require_ship_aids
from estimators.solvers.kalman import KalmanEstimator
from simnav.estimator import register
from simnav.types import InitialState, Instruments

__all__ = ["ShipEkf"]


@register("ship-ekf")
class ShipEkf(KalmanEstimator):
    """EKF on GNSS, compass and log, for a ship without an INS; estimates log and compass bias and the current.

    After the EKF of paper 002 (`estimators.models.ship`). It uses no IMU.

    Parameters
    ----------
    acceleration : float
        Noise density of the speed [m/s/sqrt(s)].
    turn_rate_deg, turn_time : float
        Sigma [deg/s] and correlation time [s] of the turn rate.
    current, current_time : float
        Sigma of each component of the current [m/s], and its correlation time [s].
    sway : float
        Sigma of the sideways velocity through the water [m/s].
    """

    def __init__(
        self,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ):
        super().__init__(ShipModel(acceleration, radians(turn_rate_deg), turn_time, current, current_time, sway))

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs a heading, and a position or a speed."""
        require_ship_aids(instruments, self.name)
        super().reset(start, instruments)
