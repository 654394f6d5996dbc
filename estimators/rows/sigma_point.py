"""Sigma-point filters: unscented and cubature, ours and filterpy's."""

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial_points import InertialPoints
from simnav.estimators.models.nine_state_points import NineStatePoints
from simnav.estimators.models.ship_points import ShipPoints
from simnav.estimators.solvers.filterpy_unscented import FilterpyUnscentedEstimator
from simnav.estimators.solvers.sigma_point import SigmaPointEstimator

__all__ = ["Ckf", "FilterpyUkf", "ShipCkf", "ShipUkf", "Ukf", "Ukf9"]

#: Points of equal weight, ``sqrt(n)`` sigma out.
_CUBATURE = piece(SigmaPointEstimator, alpha=1.0, beta=0.0, kappa=0.0)


@register("ukf")
class Ukf(Row, solver=SigmaPointEstimator, model=InertialPoints):
    """Unscented Kalman filter on the manifold: the states of ``ekf``, moments by sigma points.

    Source: S. J. Julier and J. K. Uhlmann, *Unscented filtering and nonlinear estimation*, Proc. IEEE 92, 2004.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ukf-9")
class Ukf9(Row, solver=SigmaPointEstimator, model=NineStatePoints):
    """9-state UKF: the states and fixed sigmas of ``ekf-9``, moments by sigma points.

    The points and weights are those of ``ukf``, because the paper prints none. Like ``ekf-9`` it does not notice that
    its sigmas are too large for good instruments. Source: M. Guo, B. Wang, L. Wei et al.,
    *Robust INS/GNSS/DVL integrated navigation for MASS based on gradient-adaptive factor graph optimization*, 2026.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ckf")
class Ckf(Row, solver=_CUBATURE, model=InertialPoints):
    """Cubature Kalman filter on the manifold: the states of ``ekf``, moments by third-degree cubature points.

    Its points lie ``sqrt(n)`` sigma out, 3.9 for 15 states: where a heading is known to 20 degrees or worse they go
    round the circle, and it finds the heading late. ``ukf`` has its points nearer and does not.

    Source: I. Arasaratnam and S. Haykin, *Cubature Kalman filters*, IEEE TAC 54, 2009.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ship-ukf")
class ShipUkf(Row, solver=SigmaPointEstimator, model=ShipPoints):
    """Unscented Kalman filter on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    Source: *GNSS/DR integrated navigation for ships*, the paper that proposes ANFIS-FGO.
    """


@register("ship-ckf")
class ShipCkf(Row, solver=_CUBATURE, model=ShipPoints):
    """Cubature Kalman filter on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    Source: I. Arasaratnam and S. Haykin, *Cubature Kalman filters*, IEEE TAC 54, 2009.
    """


@register("filterpy-ukf")
class FilterpyUkf(Row, solver=FilterpyUnscentedEstimator, model=ShipPoints):
    """filterpy's unscented Kalman filter over the ship model: the states and the noise of ``ship-ukf``.

    Source: R. Labbe, filterpy 2.0.
    """
