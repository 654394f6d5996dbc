"""Loosely coupled rows: they take the solution of a receiver or a DVL in place of the raw readings which it solves.

Where a voyage has both, the other rows are tightly coupled (`simnav.estimators.models.coupling`). These are for the
comparison: the same solver and pieces, with what the receiver or the DVL leaves them. They need one of them.
"""

from simnav.estimator import register
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity

__all__ = ["EkfLoose", "GatedEkfLoose", "GncFgoLoose"]


@register("ekf-loose")
class EkfLoose(Row, solver=KalmanEstimator, model=InertialModel, iteration=poor_heading):
    """``ekf``, loosely coupled: with the position and velocity of a receiver instead of its raw observations.

    Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., 2013,
    section 14.1.2.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2

    loose = True


@register("gated-ekf-loose")
class GatedEkfLoose(Row, solver=KalmanEstimator, model=Suitable, adaptation=ChiSquareGate, iteration=poor_heading):
    """``gated-ekf``, loosely coupled: with the position and velocity of a receiver instead of its raw observations.

    Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., 2013,
    sections 14.1.2 and 17.3.1.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        As of ``iae``.
    4
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 4

    loose = True


@register("gnc-fgo-loose")
class GncFgoLoose(
    Row,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05, "iterations": 15}, every_sample=False),
    model=Suitable,
    weighting=GraduatedNonConvexity,
    isolation=FaultIsolation,
):
    """``gnc-fgo``, loosely coupled: with the position and velocity of a receiver instead of its raw observations.

    Source: H. Yang, P. Antonante, V. Tzoumas and L. Carlone, *Graduated non-convexity for robust spatial perception*,
    IEEE Robotics and Automation Letters 5(2), 2020.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        As version 4 of ``huber-fgo``.
    4
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 4

    loose = True
