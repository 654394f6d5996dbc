"""The rows ``ukf``, ``ckf``, ``ship-ukf`` and ``ship-ckf``: sigma-point filters over the inertial and ship models."""

from __future__ import annotations

from math import radians

from estimators.ekf import AidedInertial
from estimators.models.inertial_points import InertialPoints
from estimators.models.ship import require_ship_aids
from estimators.models.ship_points import ShipPoints
from estimators.solvers.sigma_point import SigmaPointEstimator
from simnav.estimator import register
from simnav.types import InitialState, Instruments

__all__ = ["Ckf", "ShipCkf", "ShipUkf", "Ukf"]


class _Ship(SigmaPointEstimator):
    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs a heading, and a position or a speed."""
        require_ship_aids(instruments, self.name)
        super().reset(start, instruments)


@register("ukf")
class Ukf(SigmaPointEstimator, AidedInertial):
    """Unscented Kalman filter on the manifold: the states of ``ekf``, moments by sigma points.

    After the UKF of paper 000 (`estimators.solvers.sigma_point`); every measurement is used, at its own time.

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

    def __init__(self, alpha: float = 0.5, beta: float = 2.0, kappa: float = 0.0, calibrate: bool = True):
        super().__init__(InertialPoints(calibrate), None, alpha, beta, kappa)


@register("ckf")
class Ckf(SigmaPointEstimator, AidedInertial):
    """Cubature Kalman filter on the manifold: the states of ``ekf``, moments by third-degree cubature points.

    Its points lie ``sqrt(n)`` sigma out, 3.9 for 15 states: where a heading is known to 20 degrees or worse they go
    round the circle, and it finds the heading late. ``ukf`` has its points nearer and does not.

    Parameters
    ----------
    calibrate : bool
        False: exactly 15 states; biases, scale factor and misalignment of the aids then count as white noise.
    """

    def __init__(self, calibrate: bool = True):
        super().__init__(InertialPoints(calibrate), None, alpha=1.0, beta=0.0, kappa=0.0)


@register("ship-ukf")
class ShipUkf(_Ship):
    """Unscented Kalman filter on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    After the UKF of paper 002.

    Parameters
    ----------
    alpha, beta, kappa : float
        Of the sigma points, as for ``ukf``.
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
    """

    def __init__(
        self,
        alpha: float = 0.5,
        beta: float = 2.0,
        kappa: float = 0.0,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ):
        model = ShipPoints(acceleration, radians(turn_rate_deg), turn_time, current, current_time, sway)
        super().__init__(model, None, alpha, beta, kappa)


@register("ship-ckf")
class ShipCkf(ShipUkf):
    """Cubature Kalman filter on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    Parameters
    ----------
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
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
        super().__init__(1.0, 0.0, 0.0, acceleration, turn_rate_deg, turn_time, current, current_time, sway)
