"""The row ``ekf``: error-state extended Kalman filter over the inertial model."""

from __future__ import annotations

from simnav.estimator import register
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import require_inertial_aids
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.types import InitialState, Instruments

__all__ = ["AidedInertial", "Ekf"]


class AidedInertial(KalmanEstimator):
    """What rows over the inertial model share: they need an IMU and something to aid it."""

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and at least one aiding instrument."""
        require_inertial_aids(instruments, self.name)
        super().reset(start, instruments)


@register("ekf", aliases=("eskf",))
class Ekf(AidedInertial):
    """15-state error-state EKF over an IMU and whatever aids there are.

    Position, velocity, attitude and IMU biases, plus calibration states where the datasheets of the aids ask for them
    (`simnav.estimators.models.inertial`). Every measurement is used, at its own time; no gating, no adaptation.

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    def __init__(self, calibrate: bool = True):
        super().__init__(InertialModel(calibrate))
