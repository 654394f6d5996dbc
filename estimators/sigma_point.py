"""The rows ``ukf``, ``ckf``, ``ship-ukf`` and ``ship-ckf``: sigma-point filters over the inertial and ship models."""

from __future__ import annotations

from typing import Any

from simnav.estimator import register
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.ekf import AidedInertial
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.points import PointModel
from simnav.estimators.models.ship_points import ShipPoints
from simnav.estimators.ship_row import ShipRow
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator

__all__ = ["Ckf", "ShipCkf", "ShipUkf", "Ukf"]


class _Cubature(SigmaPointEstimator):
    """Points of equal weight, ``sqrt(n)`` sigma out."""

    def __init__(self, model: PointModel, adaptation: Adaptation | None = None):
        super().__init__(model, adaptation, alpha=1.0, beta=0.0, kappa=0.0)


@register("ukf")
class Ukf(SigmaPointEstimator, AidedInertial):
    """Unscented Kalman filter on the manifold: the states of ``ekf``, moments by sigma points.

    After the UKF of paper 000 (`simnav.estimators.solvers.sigma_point`); every measurement is used, at its own time.

    Parameters
    ----------
    alpha : float
        Scale of the points: they lie ``alpha sqrt(n + kappa)`` sigma out, 1.9 sigma for 15 states.
    beta : float
        What is known of the fourth moments; 2 is best for a Gaussian.
    kappa : float
        Above minus the number of states.
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    def __init__(self, calibrate: bool = True, **points: Any):
        super().__init__(InertialPoints(calibrate), **points)


@register("ckf")
class Ckf(_Cubature, AidedInertial):
    """Cubature Kalman filter on the manifold: the states of ``ekf``, moments by third-degree cubature points.

    Its points lie ``sqrt(n)`` sigma out, 3.9 for 15 states: where a heading is known to 20 degrees or worse they go
    round the circle, and it finds the heading late. ``ukf`` has its points nearer and does not.

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    def __init__(self, calibrate: bool = True):
        super().__init__(InertialPoints(calibrate))


@register("ship-ukf")
class ShipUkf(ShipRow, SigmaPointEstimator):
    """Unscented Kalman filter on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    After the UKF of paper 002.

    Parameters
    ----------
    alpha, beta, kappa : float
        Of the sigma points, as for ``ukf``.
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
    """

    model_class = ShipPoints


@register("ship-ckf")
class ShipCkf(ShipRow, _Cubature):
    """Cubature Kalman filter on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    Parameters
    ----------
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
    """

    model_class = ShipPoints
