"""The rows ``kf`` and ``kf-23``: the linear Kalman filter, which corrects the output and not the navigator."""

from __future__ import annotations

from typing import Literal

from simnav.estimator import register
from simnav.estimators.ekf import AidedInertial
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.linear import LinearKalmanEstimator

__all__ = ["Kf", "Kf23"]


@register("kf", aliases=("linear-kf",))
class Kf(LinearKalmanEstimator, AidedInertial):
    """Linear 15-state error-state KF, open loop: free inertial navigation, corrected by its estimated error.

    The states of ``ekf``. It leaves its linear range where free inertial navigation does
    (`simnav.estimators.solvers.linear`).

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    def __init__(self, calibrate: bool = True):
        super().__init__(InertialModel(calibrate))


@register("kf-23", aliases=("kf-paper-003",))
class Kf23(LinearKalmanEstimator, AidedInertial):
    """Linear 23-state error-state KF, open loop: the KF of paper 003 with the DVL's errors as states.

    Parameters
    ----------
    lever_arm : float
        Sigma of each component of the DVL's lever-arm error [m].
    delay : float
        Sigma of the DVL's time error [s].
    preset : "default" or "paper"
        "paper": the noise of GNSS and DVL as printed, 5 m and 0.1 m/s, instead of the datasheets'.
    """

    def __init__(self, lever_arm: float = 0.02, delay: float = 0.005, preset: Literal["default", "paper"] = "default"):
        super().__init__(DvlCalibrationModel(lever_arm, delay, preset))
