"""The row ``ekf``: error-state extended Kalman filter over the inertial model."""

from __future__ import annotations

from typing import Any

from simnav.estimator import register
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import require_inertial_aids
from simnav.estimators.solvers.iterated import Iteration
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.types import InitialState, Instruments

__all__ = ["AidedInertial", "Ekf", "PoorHeadingStart"]


class PoorHeadingStart(KalmanEstimator):
    """What rows of the Kalman filter over the inertial model share: how they start from a poor heading.

    Parameters
    ----------
    model, adaptation
        As for `KalmanEstimator`.
    iterate_above_deg : float, optional
        While the heading's standard deviation is above this [deg], measurements are linearised again until the
        correction stands still, as in ``iekf``. None: never; 0: always.
    """

    def __init__(
        self, model: ErrorModel, adaptation: Adaptation | None = None, *, iterate_above_deg: float | None = None
    ):
        iteration = None if iterate_above_deg is None else Iteration(iterate_above_deg)
        super().__init__(model, adaptation, iteration)


class AidedInertial(KalmanEstimator):
    """What rows over the inertial model share: they need an IMU and something to aid it."""

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU and at least one aiding instrument."""
        require_inertial_aids(instruments, self.name)
        super().reset(start, instruments)


@register("ekf", aliases=("eskf",))
class Ekf(AidedInertial, PoorHeadingStart):
    """15-state error-state EKF over an IMU and whatever aids there are.

    Position, velocity, attitude and IMU biases, plus calibration states where the datasheets of the aids ask for them
    (`simnav.estimators.models.inertial`). Every measurement is used, at its own time; no gating, no adaptation.

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    iterate_above_deg : float, optional
        Of the start from a poor heading (`PoorHeadingStart`).
    """

    def __init__(self, calibrate: bool = True, **options: Any):
        super().__init__(InertialModel(calibrate), **options)
