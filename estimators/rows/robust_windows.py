"""Robust rows of the sliding window: each is ``sw-fgo`` or, without an IMU, ``ship-fgo``, with one weighting.

All but the gradient-adaptive ones also isolate faults (`simnav.estimators.weightings.fault_isolation`).
"""

from simnav.estimator import register
from simnav.estimators.composition import Row, piece
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.window import WindowEstimator
from simnav.estimators.weightings.dynamic_covariance_scaling import DynamicCovarianceScaling
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.gradient_adaptive import GradientAdaptive
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity
from simnav.estimators.weightings.m_estimators import TunedMEstimator, cauchy, geman_mcclure, huber, tukey
from simnav.estimators.weightings.max_mixture import MaxMixture
from simnav.estimators.weightings.switchable_constraints import SwitchableConstraints

from .windows import SwFgoPaper

__all__ = ["CauchyFgo", "DcsFgo", "GaFgo", "GaFgoPaper", "GmFgo", "GncFgo", "HuberFgo", "MaxMixtureFgo"]
__all__ += ["SwitchableFgo", "TukeyFgo"]


class _Window(Row, solver=piece(WindowEstimator, defaults={"tolerance": 0.05}, every_sample=False), model=Suitable):
    """The window without its weighting."""


class _Robust(_Window, isolation=FaultIsolation):
    """The window that isolates faults, without its weighting."""

    version = 2


@register("huber-fgo")
class HuberFgo(_Robust, weighting=piece(TunedMEstimator, weight=huber)):
    """Sliding window with Huber's weights: a residual beyond c sigma pulls no harder than one of c sigma.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong or with an IMU that is
    poorer than stated (``python -m tests.audit silence`` counts such runs).

    Source: P. J. Huber, *Robust Statistics*, 1981.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`). A log that is the last
        witness beside the motion is not rejected for good.
    3
        The motion is suspected, too, where the weighting has rejected measurements, and where there is no log.
    4
        Where the motion gets less weight, the states of vessel and IMU may change, but not the errors of instruments:
        a bias of the receiver explained fixes that contradicted a wrong motion. Fixes without a log are asked with a
        looser motion from test to test until they agree.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("tukey-fgo")
class TukeyFgo(_Robust, weighting=piece(TunedMEstimator, weight=tukey)):
    """Sliding window with Tukey's biweight: a residual beyond c sigma counts for next to nothing.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong or from a start that is
    worse than stated (``python -m tests.audit silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 1 of 20 voyages (``training-poor-imu``, seeds 70000 to 70190,
    every tenth) had more than 1.5 times the error of ``sw-fgo``, 8.5 times at most (70160).

    Source: A. E. Beaton and J. W. Tukey, *The fitting of power series*, Technometrics 16(2), 1974.

    Versions
    --------
    2
        As of ``huber-fgo``.
    3
        As of ``huber-fgo``.
    4
        As of ``huber-fgo``.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("cauchy-fgo")
class CauchyFgo(_Robust, weighting=piece(TunedMEstimator, weight=cauchy)):
    """Sliding window with Cauchy's weights, which fall with the square of the residual.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Source: P. W. Holland and R. E. Welsch, *Robust regression using iteratively reweighted least-squares*, 1977.

    Versions
    --------
    2
        As of ``huber-fgo``.
    3
        As of ``huber-fgo``.
    4
        As of ``huber-fgo``.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("gm-fgo")
class GmFgo(_Robust, weighting=piece(TunedMEstimator, weight=geman_mcclure)):
    """Sliding window with Geman and McClure's weights, which fall with the fourth power of the residual.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 2 of 20 voyages (``training-poor-imu``, seeds 70000 to 70190,
    every tenth) had more than 1.5 times the error of ``sw-fgo``, 7.3 times at most (70160).

    Source: S. Geman and D. E. McClure, *Statistical methods for tomographic image reconstruction*, 1987.

    Versions
    --------
    2
        As of ``huber-fgo``.
    3
        As of ``huber-fgo``.
    4
        As of ``huber-fgo``.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("dcs-fgo")
class DcsFgo(_Robust, weighting=DynamicCovarianceScaling):
    """Sliding window with dynamic covariance scaling.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong or from a start that is
    worse than stated (``python -m tests.audit silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 1 of 20 voyages (``training-poor-imu``, seeds 70000 to 70190,
    every tenth) had more than 1.5 times the error of ``sw-fgo``, 8.2 times at most (70160).

    Source: P. Agarwal, G. D. Tipaldi, L. Spinello et al., *Robust map optimization using dynamic covariance scaling*,
    ICRA 2013.

    Versions
    --------
    2
        As of ``huber-fgo``.
    3
        As of ``huber-fgo``.
    4
        As of ``huber-fgo``.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("switchable-fgo")
class SwitchableFgo(_Robust, weighting=SwitchableConstraints):
    """Sliding window with switchable constraints, the switches eliminated in closed form.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Beside an IMU that is poorer than its datasheet, 2 of 20 voyages (``training-poor-imu``, seeds 70000 to 70190,
    every tenth) had more than 1.5 times the error of ``sw-fgo``, 9.2 times at most (70160).

    Source: N. Sünderhauf and P. Protzel, *Switchable constraints for robust pose graph SLAM*, IROS 2012.

    Versions
    --------
    2
        As of ``huber-fgo``.
    3
        As of ``huber-fgo``.
    4
        As of ``huber-fgo``.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("gnc-fgo")
class GncFgo(
    _Robust,
    solver=piece(WindowEstimator, defaults={"tolerance": 0.05, "iterations": 15}, every_sample=False),
    weighting=GraduatedNonConvexity,
):
    """Sliding window with graduated non-convexity: after an outlier the robust cost begins convex and hardens.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong, with an IMU that is poorer
    than stated or from a start that is worse than stated (``python -m tests.audit silence`` counts such runs).

    Do not use it where an error of the IMU or of a log takes a step and stays: it takes the good measurements that
    contradict the window for outliers. It had 3.3 times the error of ``ekf`` after a step of 1 mg in an accelerometer,
    and 1.8 times after one of 3 % in the scale factor of a DVL; and 3.7 times on ``wrong-start``. Beside an IMU that is
    poorer than its datasheet it had 11.5 times the error of ``sw-fgo`` on voyage 87000 of ``training-poor-imu``.

    Source: H. Yang, P. Antonante, V. Tzoumas and L. Carlone, *Graduated non-convexity for robust spatial perception*,
    IEEE Robotics and Automation Letters 5(2), 2020.

    Versions
    --------
    2
        A log that is the last witness beside the motion is not rejected for good.
    3
        A satellite that the others contradict is left out without a schedule
        (`simnav.estimators.weightings.channel_vote`). Where no instrument has channels, the numbers are those of
        version 2.
    4
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    5
        The motion is suspected, too, where the weighting has rejected measurements, and where there is no log.
    6
        As version 4 of ``huber-fgo``.
    7
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 7


@register("max-mixture-fgo")
class MaxMixtureFgo(_Robust, weighting=MaxMixture):
    """Sliding window in which each measurement is of the nominal or of a wide noise, whichever is the more probable.

    It does not notice that it is lost on a ship without an IMU whose instruments are wrong (``python -m tests.audit
    silence`` counts such runs).

    Source: E. Olson and P. Agarwal, *Inference on networks of mixtures for robust robot mapping*, IJRR 32(7), 2013.

    Versions
    --------
    2
        As of ``huber-fgo``.
    3
        As of ``huber-fgo``.
    4
        As of ``huber-fgo``.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5


@register("ga-fgo")
class GaFgo(_Window, weighting=piece(GradientAdaptive, fewest=5)):
    """Gradient-adaptive factor graph, its residuals whitened and its scales consistent.

    Motion keeps three tenths of its information however wrong it is, so a disturbed IMU is not rejected. On
    ``lone-dvl`` its error is 2.7 times that of ``gnc-fgo``, and 0.85 times that of ``ekf``.

    Beside an IMU that is poorer than its datasheet, 2 of 20 voyages (``training-poor-imu``, seeds 70000 to 70190,
    every tenth) had more than 1.5 times the error of ``sw-fgo``, 1.8 times at most (70180).

    Source: M. Guo, B. Wang, L. Wei et al., *Robust INS/GNSS/DVL integrated navigation for MASS based on
    gradient-adaptive factor graph optimization*, 2026.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        Where the motion gets less weight, the states of vessel and IMU may change, but not the errors of instruments.
    4
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 4


@register("ga-fgo-paper")
class GaFgoPaper(SwFgoPaper, weighting=piece(GradientAdaptive, defaults={"preset": "paper"}, fewest=5)):
    """Gradient-adaptive factor graph as its paper prints it: 9 states, fixed sigmas, unwhitened norms and their scale.

    Source: M. Guo, B. Wang, L. Wei et al., *Robust INS/GNSS/DVL integrated navigation for MASS based on
    gradient-adaptive factor graph optimization*, 2026.

    Versions
    --------
    2
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    3
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 3
