"""A filter that expects the errors of fixes to be correlated in time."""

from simnav.estimator import register
from simnav.estimators.composition import Row
from simnav.estimators.models.correlated_fixes import CorrelatedFixes
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["GaussMarkovEkf"]


@register("gm-ekf", aliases=("gauss-markov-ekf",))
class GaussMarkovEkf(Row, solver=KalmanEstimator, model=CorrelatedFixes, iteration=poor_heading):
    """The EKF with Gauss-Markov states for the slow error of GNSS and terrain fixes, whatever their datasheets say.

    Source: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, section 3.6; P. D. Groves, *Principles of GNSS, Inertial,
    and Multisensor Integrated Navigation Systems*, 2013, section 14.2.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    3
        The slow error has at least half the sigma of the white noise, and not all of it. A larger one lost where the
        IMU is poor or wrong, and gained hardly anything where fixes are (24 runs of each of nine training families,
        seeds 52000 to 52023).
    """

    version = 3
