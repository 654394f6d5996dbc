"""Kalman filters without an adaptation: over the inertial model, the ship model, and GNSS alone."""

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.kinematic import KinematicModel
from simnav.estimators.models.nine_state import NineStateModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.standing_ship import StandingShip
from simnav.estimators.models.unaided import UnaidedModel
from simnav.estimators.solvers.invariant import InvariantKalmanEstimator
from simnav.estimators.solvers.iterated import Iteration, poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.linear import LinearKalmanEstimator

__all__ = ["Ekf", "Ekf9", "Ekf23", "GnssOnly", "InvariantEkf", "IteratedEkf", "Kf", "Kf9", "Kf23", "PureInertial"]
__all__ += ["ShipEkf", "ShipEkfStanding"]


@register("ekf", aliases=("eskf",))
class Ekf(Row, solver=KalmanEstimator, model=InertialModel, iteration=poor_heading):
    """15-state error-state EKF over an IMU and whatever aids there are.

    Position, velocity, attitude and IMU biases, plus calibration states where the datasheets of the aids ask for them.
    Every measurement is used, at its own time; no gating, no adaptation.

    Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2013.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ekf-23", aliases=("ekf-paper-003",))
class Ekf23(Row, solver=KalmanEstimator, model=DvlCalibrationModel, iteration=poor_heading):
    """23-state EKF: DVL misalignment, lever arm, scale factor and time error beside the 15.

    Source: Z. Zhan, C. Liu, K. Jin et al., *GNSS/SINS/DVL integrated navigation algorithm based on adaptive
    differential Kalman filtering*, PLoS One 21(2), 2026.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ekf-9", aliases=("ekf-paper-000",))
class Ekf9(Row, solver=KalmanEstimator, model=NineStateModel, iteration=poor_heading):
    """9-state EKF: position, velocity and attitude, fixed sigmas, no biases.

    It does not notice that its fixed sigmas are too large for good instruments and too small for poor ones: on
    ``clean-voyages`` it has up to 85 times the error of ``ekf``.

    Source: M. Guo, B. Wang, L. Wei et al., *Robust INS/GNSS/DVL integrated navigation for MASS based on
    gradient-adaptive factor graph optimization*, 2026.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("iekf", aliases=("iterated-ekf",))
class IteratedEkf(Row, solver=KalmanEstimator, model=InertialModel, iteration=piece(Iteration, above_deg=0.0)):
    """Iterated 15-state EKF: each measurement is linearised again until the correction stands still.

    Source: B. M. Bell and F. W. Cathey, *The iterated Kalman filter update as a Gauss-Newton method*, IEEE TAC 38(2),
    1993.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("inekf", aliases=("invariant-ekf",))
class InvariantEkf(Row, solver=InvariantKalmanEstimator, model=InertialModel):
    """Invariant 15-state EKF on SE_2(3) with biases; finds a heading that is far off.

    ``error="right"`` is better beside a DVL. On voyages whose IMU fails (``training-imu-faults``, seeds 56000 to 56089)
    it has 1.10 times the error of ``ekf``, and the left-invariant error 1.16 times.

    Source: A. Barrau and S. Bonnabel, *The invariant extended Kalman filter as a stable observer*, IEEE TAC 62(4),
    2017.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("kf", aliases=("linear-kf",))
class Kf(Row, solver=LinearKalmanEstimator, model=InertialModel):
    """Linear 15-state error-state KF, open loop: free inertial navigation, corrected by its estimated error.

    The states of ``ekf``. It leaves its linear range where free inertial navigation does, and does not notice it: of
    258 runs of the board with more than ten times the error of ``ekf``, 30 % have neither a covariance nor a status
    that admits it (``python -m tests.audit silence``).

    Source: P. S. Maybeck, *Stochastic Models, Estimation, and Control*, vol. 1, 1979.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("kf-9")
class Kf9(Row, solver=piece(LinearKalmanEstimator, defaults={"feedback": 1.0}), model=NineStateModel):
    """Linear 9-state error-state KF, closed loop: the estimated error is fed back once a second.

    The states and fixed sigmas of ``ekf-9``. All measurements of a second are linearised about the same nominal
    trajectory, which is corrected afterwards. Like ``ekf-9`` it does not notice that its sigmas are too large for good
    instruments. Source: P. S. Maybeck, *Stochastic Models, Estimation, and Control*, vol. 1, 1979, section 6.3; the
    states are those of M. Guo, B. Wang, L. Wei et al., *Robust INS/GNSS/DVL integrated navigation for MASS based on
    gradient-adaptive factor graph optimization*, 2026.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("kf-23", aliases=("kf-paper-003",))
class Kf23(Row, solver=LinearKalmanEstimator, model=DvlCalibrationModel):
    """Linear 23-state error-state KF, open loop, with the DVL's errors as states.

    It leaves its linear range where free inertial navigation does, and does not notice it: of 344 runs of the board
    with more than ten times the error of ``ekf``, 17 % have neither a covariance nor a status that admits it
    (``python -m tests.audit silence``).

    Source: Z. Zhan, C. Liu, K. Jin et al., *GNSS/SINS/DVL integrated navigation algorithm based on adaptive
    differential Kalman filtering*, PLoS One 21(2), 2026.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("ship-ekf")
class ShipEkf(Row, solver=KalmanEstimator, model=ShipModel):
    """EKF on GNSS, compass and log, for a ship without an INS; estimates log and compass bias and the current.

    It uses no IMU. Source: *GNSS/DR integrated navigation for ships*, the paper that proposes ANFIS-FGO.
    """


@register("ship-ekf-standing")
class ShipEkfStanding(Row, solver=KalmanEstimator, model=StandingShip):
    """``ship-ekf`` without dead reckoning: where there is no fix, the position stays where it is.

    For comparison only: its error at the end of an outage is the distance that the ship made, and it does not notice
    that. One reading of the
    outages in the figures of *GNSS/DR integrated navigation for ships*, the paper that proposes ANFIS-FGO.
    """


@register("gnss-only", aliases=("gnss",))
class GnssOnly(Row, solver=KalmanEstimator, model=KinematicModel):
    """GNSS alone: fixes (and velocities, if any) smoothed by a constant-velocity Kalman filter.

    Between fixes and in an outage the ship goes on as she went. It does not notice a turn there (``python -m
    tests.audit silence`` counts such runs). Source: Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with
    Applications to Tracking and Navigation*, 2001, section 6.2.
    """


@register("inertial", aliases=("pure-inertial",))
class PureInertial(Row, solver=KalmanEstimator, model=UnaidedModel):
    """Pure inertial navigation: the strapdown solution from the initial state, with its growing covariance.

    It does not notice that the initial state is further off than its covariance says (``wrong-start``), because it uses
    no measurement.

    Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2013.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2
