"""Filters with a smoother behind them, for the post-processing track; in real time each is the filter."""

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.estimators.solvers.two_filter import TwoFilterSmoother

from .kalman import Ekf, ShipEkf

__all__ = ["EkfRts", "EkfTwoFilter", "ShipEkfRts"]


@register("ekf-rts")
class EkfRts(Ekf, smoother=Smoother):
    """The EKF with a Rauch-Tung-Striebel smoother behind it.

    Source: H. E. Rauch, F. Tung and C. T. Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA
    Journal 3(8), 1965.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ekf-two-filter")
class EkfTwoFilter(Row, solver=KalmanEstimator, model=InertialModel, smoother=TwoFilterSmoother):
    """The EKF with a two-filter smoother behind it; the trajectory is that of ``ekf-rts``, by another way.

    Source: D. C. Fraser and J. E. Potter, *The optimum linear smoother as a combination of two optimum linear filters*,
    IEEE TAC 14(4), 1969; *Post-processing algorithm based on factor graph optimization for AUV integrated navigation*.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ship-ekf-rts")
class ShipEkfRts(ShipEkf, smoother=Smoother):
    """The ship EKF with a Rauch-Tung-Striebel smoother behind it.

    Source: H. E. Rauch, F. Tung and C. T. Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA
    Journal 3(8), 1965.
    """
