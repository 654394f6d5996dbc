"""A filter for the messages of other vessels."""

from simnav.estimator import register
from simnav.estimators.adaptations.intersection import CovarianceIntersection
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import WithMessages
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["EkfCi"]


@register("ekf-ci")
class EkfCi(Row, solver=KalmanEstimator, model=WithMessages, adaptation=CovarianceIntersection, iteration=poor_heading):
    """The EKF that uses the messages of other vessels by covariance intersection, so that none counts twice.

    ``ekf`` takes the error of each message as new. Where it is the same from message to message, or comes from the own
    messages, ``ekf`` is too sure of itself; this row is not. It uses less of each message, and none that tells little
    more than it knows.

    Source: S. J. Julier and J. K. Uhlmann, *A non-divergent estimation algorithm in the presence of unknown
    correlations*, American Control Conference, 1997.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2
