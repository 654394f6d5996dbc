"""The rows ``ekf-23`` and ``ekf-9``: the EKF with the states of papers 003 and 000."""

from __future__ import annotations

from typing import Any, Literal

from simnav.estimator import register
from simnav.estimators.ekf import AidedInertial, PoorHeadingStart
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.nine_state import NineStateModel

__all__ = ["Ekf9", "Ekf23"]


@register("ekf-23", aliases=("ekf-paper-003",))
class Ekf23(AidedInertial, PoorHeadingStart):
    """23-state EKF after paper 003: DVL misalignment, lever arm, scale factor and time error beside the 15.

    `simnav.estimators.models.dvl_calibration` says what is settled of the paper, and how.

    Parameters
    ----------
    lever_arm : float
        Sigma of each component of the DVL's lever-arm error [m].
    delay : float
        Sigma of the DVL's time error [s].
    preset : "default" or "paper"
        "paper": the noise of GNSS and DVL as printed, 5 m and 0.1 m/s, instead of the datasheets'.
    iterate_above_deg : float, optional
        As of ``ekf``.
    """

    def __init__(
        self,
        lever_arm: float = 0.02,
        delay: float = 0.005,
        preset: Literal["default", "paper"] = "default",
        **options: Any,
    ):
        super().__init__(DvlCalibrationModel(lever_arm, delay, preset), **options)


@register("ekf-9", aliases=("ekf-paper-000",))
class Ekf9(AidedInertial, PoorHeadingStart):
    """9-state EKF after paper 000: position, velocity and attitude, fixed sigmas, no biases.

    Parameters
    ----------
    sigma_position, sigma_velocity, sigma_attitude_deg : float
        Of one second of motion [m], [m/s], [deg].
    sigma_gnss_horizontal, sigma_gnss_vertical : float
        Of a GNSS position [m]; 0 for the datasheet's.
    sigma_dvl : float
        Of a DVL velocity [m/s]; 0 for the datasheet's.
    iterate_above_deg : float, optional
        As of ``ekf``.
    """

    def __init__(
        self,
        sigma_position: float = 0.01,
        sigma_velocity: float = 0.02,
        sigma_attitude_deg: float = 0.01,
        sigma_gnss_horizontal: float = 2.5,
        sigma_gnss_vertical: float = 5.0,
        sigma_dvl: float = 0.1,
        **options: Any,
    ):
        super().__init__(
            NineStateModel(
                sigma_position, sigma_velocity, sigma_attitude_deg,
                sigma_gnss_horizontal, sigma_gnss_vertical, sigma_dvl,
            ),
            **options,
        )  # fmt: skip
