"""Adaptive and robust rows: the Kalman filter with one adaptation each.

Every row takes the inertial model where there is an IMU and the ship model where there is none, so that it is ``ekf``
or ``ship-ekf`` but for its adaptation.
"""

from simnav.estimator import register
from simnav.estimators.adaptations.adkf import AdaptiveFactor
from simnav.estimators.adaptations.correntropy import MaximumCorrentropy
from simnav.estimators.adaptations.fading import FadingMemory
from simnav.estimators.adaptations.gating import ChiSquareGate
from simnav.estimators.adaptations.innovation_based import FixedWindow, InnovationBased
from simnav.estimators.adaptations.robust import HuberWeights, Igg3Weights
from simnav.estimators.adaptations.sage_husa import SageHusa
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.dvl_calibration import DvlCalibrationModel
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.imm import ImmEstimator
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.kalman import KalmanEstimator

__all__ = ["Adkf", "Adkf23", "AdkfPaper", "FadingEkf", "GatedEkf", "HuberKf", "Iae", "IaeFixed", "IaePaper", "Igg3"]
__all__ += ["Imm", "Mckf", "Rae", "SageHusaKf", "SageHusaPaper", "VbAkf"]

#: Eqs. 16-20 of Mao, Wang and Fu (2025) without additions. The bounds are ours, because eq. 17 is often not positive.
INNOVATIONS_AS_PRINTED = piece(
    InnovationBased,
    defaults={
        "newest": True,
        "significance": 1.0,
        "lowest": 0.1,
        "highest": 100.0,
        "full": True,
        "scope": "fixes",
        "always": True,
    },
    source="innovation",
)
#: `innovations` was the window of these rows, as a filter has no other.
_FORMERLY = {"window": "innovations"}


class _Adaptive(Row, solver=KalmanEstimator, model=Suitable, iteration=poor_heading):
    """The filter without its adaptation."""


@register("sage-husa")
class SageHusaKf(_Adaptive, adaptation=SageHusa):
    """Sage-Husa filter: the measurement noise estimated from all innovations, the old ones fading.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 8 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.5 times at most (70042), or ended early (1).

    Source: A. P. Sage and G. W. Husa, *Adaptive filtering with unknown prior statistics*, Joint Automatic Control
    Conference, 1969.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("sage-husa-paper")
class SageHusaPaper(
    _Adaptive, adaptation=piece(SageHusa, defaults={"fading": 1.0, "prior": 0, "lowest": 0.5, "scope": "fixes"})
):
    """Sage-Husa filter without fading, the rival in the figures of the paper on adaptive windows.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Source: G. Mao, K. Wang, T. Fu, *Robust GNSS/INS integrated navigation algorithm based on adaptive factor graph
    optimization*, 2025.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("iae")
class Iae(_Adaptive, adaptation=piece(InnovationBased, source="innovation")):
    """Innovation-based adaptive estimation of the measurement noise over a window that adapts its length.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 10 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 6.2 times at most (70061), or ended early (1).

    Source: G. Mao, K. Wang, T. Fu, *Robust GNSS/INS integrated navigation algorithm based on adaptive factor graph
    optimization*, 2025, eqs. 16-20.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
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


@register("iae-paper")
class IaePaper(_Adaptive, adaptation=INNOVATIONS_AS_PRINTED):
    """Innovation-based adaptive estimation of the noise of fixes with the equations as their paper prints them.

    The newest covariance of the prediction is subtracted from all innovations, and the estimate is always used. The
    full matrix has eigenvalues between 0.01 and 10 000 times the variances of the datasheet, because the printed
    estimate is often not positive definite.

    Source: G. Mao, K. Wang, T. Fu, *Robust GNSS/INS integrated navigation algorithm based on adaptive factor graph
    optimization*, 2025, eqs. 16-20.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("iae-fixed")
class IaeFixed(_Adaptive, adaptation=piece(FixedWindow, source="innovation")):
    """Innovation-based adaptive estimation of the measurement noise over a fixed window.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 9 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 7.6 times at most (70061), or ended early (1).

    Source: A. H. Mohamed and K. P. Schwarz, *Adaptive Kalman filtering for INS/GPS*, J. Geodesy 73, 1999.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6
    formerly = _FORMERLY


@register("rae")
class Rae(_Adaptive, adaptation=piece(FixedWindow, source="residual", newest=False)):
    """Residual-based adaptive estimation of the measurement noise over a fixed window.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 11 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 7.5 times at most (70061), or ended early (1).

    Source: A. H. Mohamed and K. P. Schwarz, *Adaptive Kalman filtering for INS/GPS*, J. Geodesy 73, 1999.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6
    formerly = _FORMERLY


@register("adkf")
class Adkf(_Adaptive, adaptation=AdaptiveFactor):
    """Adaptive robust filter: R or P over a factor that falls with a statistic of the innovation.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong, in several faults at a time
    or from a start that is worse than stated (``python -m tests.audit silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 4 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 4.7 times at most (70037), or ended early (1).

    Source: Z. Zhan, C. Liu, K. Jin et al., *GNSS/SINS/DVL integrated navigation algorithm based on adaptive
    differential Kalman filtering*, PLoS One 21(2), 2026.

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
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("adkf-paper")
class AdkfPaper(_Adaptive, adaptation=piece(AdaptiveFactor, preset="paper", c0=None, c1=None, together=0)):
    """Adaptive robust filter with the statistics and thresholds as its paper prints them.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong, from a start that is worse
    than stated or from a poorly known heading (``python -m tests.audit silence`` counts such runs).

    Source: Z. Zhan, C. Liu, K. Jin et al., *GNSS/SINS/DVL integrated navigation algorithm based on adaptive
    differential Kalman filtering*, PLoS One 21(2), 2026.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3


@register("adkf-23")
class Adkf23(Row, solver=KalmanEstimator, model=DvlCalibrationModel, adaptation=AdaptiveFactor, iteration=poor_heading):
    """Adaptive robust filter over the 23 states of ``ekf-23``, as its paper has them.

    With ``model__preset=paper`` the noise of GNSS and DVL is the printed one, and with ``adaptation__preset=paper`` the
    statistic is. Source: Z. Zhan, C. Liu, K. Jin et al., *GNSS/SINS/DVL integrated navigation algorithm based on
    adaptive differential Kalman filtering*, PLoS One 21(2), 2026.

    It does not notice that it is lost in several faults at a time or from a start that is worse than stated (``python
    -m tests.audit silence`` counts such runs).

    Do not use it beside an IMU that is poorer than its datasheet: 57 of 198 voyages (``training-poor-imu``, seeds
    70000 to 70199) had more than 1.5 times the error of ``ekf``, 42.8 times at most (70013), or ended early (38).

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


@register("igg3")
class Igg3(_Adaptive, adaptation=Igg3Weights):
    """IGG-III equivalent weights: full weight up to k0 sigma, almost none from k1 sigma on.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 8 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.4 times at most (70042), or ended early (1).

    Source: Y. Yang, L. Song and T. Xu, *Robust estimator for correlated observations based on bifactor equivalent
    weights*, J. Geodesy 76, 2002.

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
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("huber-kf")
class HuberKf(_Adaptive, adaptation=HuberWeights):
    """Huber's equivalent weights: an innovation beyond k sigma pulls no harder than one of k sigma.

    Beside an IMU that is poorer than its datasheet, 5 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.4 times at most (70042), or ended early (1).

    Source: P. J. Huber, *Robust estimation of a location parameter*, Annals of Mathematical Statistics 35(1), 1964.

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
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("gated-ekf")
class GatedEkf(_Adaptive, adaptation=ChiSquareGate):
    """Chi-square gating: measurements that fail the test are left out; a filter that fails for long is doubted.

    Do not use it where fixes come back after outages with an IMU alone between them: the first fixes fail the test, and
    are left out for ten seconds more. On ``car-road`` it has 2.9 times the error of ``ekf``, 4.6 times at most
    (``simnav evaluate gated-ekf --scenario car-road --runs 4 --seed 5000 --against ekf``).

    Beside an IMU that is poorer than its datasheet, 7 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.1 times at most (70042), or ended early (1).

    Source: Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
    section 5.4.

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
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("fading-ekf")
class FadingEkf(_Adaptive, adaptation=FadingMemory):
    """Fading memory: information loses weight with its age.

    Source: D. Simon, *Optimal State Estimation*, 2006, section 7.4.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3


@register("vb-akf")
class VbAkf(_Adaptive, adaptation=VariationalBayes):
    """Variational-Bayes adaptive filter: state and noise variances estimated together.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 11 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 7.0 times at most (70061), or ended early (1).

    Source: S. Särkkä and A. Nummenmaa, *Recursive noise adaptive Kalman filtering by variational Bayesian
    approximations*, IEEE TAC 54(3), 2009.

    Versions
    --------
    2
        Windows, priors and forgetting are in seconds for an instrument of more than 1 Hz. Innovations that persist
        while no other instrument contradicts them are taken as a wrong prediction, and not as noise (`PredictionTest`).
    3
        A lasting error is blamed on an instrument only by a witness, whatever its size. Before, one that an IMU of 20
        times the noise of its datasheet did not explain was taken for the instrument's. Depth sensors are tested, too.
        Fixes that see no error of a log at first may see it later. A log without fixes is believed from its second
        failure in one direction on, and a compass while another instrument finds the prediction wrong.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("mckf")
class Mckf(_Adaptive, adaptation=piece(MaximumCorrentropy, smallest=1e-3)):
    """Maximum correntropy Kalman filter: residuals weighted by a Gaussian kernel.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong or from a start that is
    worse than stated (``python -m tests.audit silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 8 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.4 times at most (70042), or ended early (1).

    Source: B. Chen, X. Liu, H. Zhao and J. C. Principe, *Maximum correntropy Kalman filter*, Automatica 76, 2017.

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
        As of ``iae``.
    6
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 6


@register("imm")
class Imm(Row, solver=ImmEstimator, model=Suitable):
    """Interacting multiple models: the noise of each instrument jumps between levels.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong or from a start that is
    worse than stated (``python -m tests.audit silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 8 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 5.4 times at most (70042), or ended early (1).

    Source: H. A. P. Blom and Y. Bar-Shalom, *The interacting multiple model algorithm for systems with Markovian
    switching coefficients*, IEEE TAC 33(8), 1988.

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
        Readings of one time of several channels (satellites, beams, points of a terrain) are mixed, too. Before, they
        had the noise of the datasheet.
    6
        Innovations of a log that persist are taken as a wrong prediction, whatever its witnesses say, if they grew
        little by little: an instrument that begins to be wrong is wrong at once (`simnav.estimators.onset`).
    7
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 7
