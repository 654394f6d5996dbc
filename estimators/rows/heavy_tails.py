"""Rows for measurement noise of Student's t distribution: a filter, and a smoother behind it."""

from simnav.estimator import register
from simnav.estimators.adaptations.student_t import StudentT
from simnav.estimators.composition import Row
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.student_t_smoother import StudentTSmoother

__all__ = ["StudentTKf", "StudentTRts"]

_FORMERLY = {"dof": "adaptation__dof", "smoothed_dof": "smoother__dof"}


@register("student-t")
class StudentTKf(Row, solver=KalmanEstimator, model=Suitable, adaptation=StudentT, iteration=poor_heading):
    """Student-t filter: each measurement's noise has heavy tails, so that a large residual counts for little.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 8 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.4 times at most (70042), or ended early (1).

    Source: Y. Huang, Y. Zhang, N. Li, Z. Wu and J. A. Chambers, *A novel robust Student's t-based Kalman filter*, IEEE
    Trans. Aerospace and Electronic Systems 53(3), 2017.

    Versions
    --------
    2
        Innovations that persist while no other instrument contradicts them are taken as a wrong prediction, and not as
        noise or gross errors of their instrument (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        Innovations of a log that persist are taken as a wrong prediction, whatever its witnesses say, if they grew
        little by little: an instrument that begins to be wrong is wrong at once (`simnav.estimators.onset`).
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("student-t-rts")
class StudentTRts(StudentTKf, smoother=StudentTSmoother):
    """The Student-t filter with a robust smoother behind it: measurements are judged by the smoothed trajectory.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 8 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.4 times at most (70042), or ended early (1). Do not use its smoothed
    trajectory there: in version 4, 135 of them had more than 1.5 times the error of that of ``ekf-rts``, and the
    geometric mean was 4.4 times.

    Source: A. Y. Aravkin, J. V. Burke and G. Pillonetto, *Robust and trend-following Student's t Kalman smoothers*,
    SIAM J. Control and Optimization 52(5), 2014.

    Versions
    --------
    2
        Innovations that persist while no other instrument contradicts them are taken as a wrong prediction, and not as
        noise or gross errors of their instrument (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        As of ``student-t``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6
    formerly = _FORMERLY
