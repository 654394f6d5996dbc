"""Rows of several filters side by side: for each heading, for each instrument that could be wrong, by assumption."""

from simnav.estimator import register
from simnav.estimators.adaptations.variational_bayes import VariationalBayes
from simnav.estimators.composition import Row
from simnav.estimators.models.doubted_instruments import DoubtedInstruments
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.heading_bank import HeadingBank
from simnav.estimators.solvers.iterated import poor_heading
from simnav.estimators.solvers.mid_value import MidValueSelection
from simnav.estimators.solvers.multiple_hypothesis import MultipleHypothesis
from simnav.estimators.solvers.solution_separation import SolutionSeparation
from simnav.estimators.weightings.fault_isolation import FaultIsolation
from simnav.estimators.weightings.graduated_non_convexity import GraduatedNonConvexity

__all__ = ["HeadingBankEkf", "MidValue", "MultipleHypothesisEkf", "SolutionSeparationEkf"]


@register("heading-bank")
class HeadingBankEkf(Row, solver=HeadingBank, model=Suitable):
    """The EKF from an unknown heading: a bank of EKFs round the compass, weighed until one of them is left.

    With a heading known to 15 degrees or better it is the plain EKF. Source: D. T. Magill, *Optimal adaptive estimation
    of sampled stochastic processes*, IEEE TAC 10(4), 1965; H. W. Sorenson and D. L. Alspach, *Recursive Bayesian
    estimation using Gaussian sums*, Automatica 7(4), 1971.

    Versions
    --------
    2
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 2


@register("solution-separation")
class SolutionSeparationEkf(Row, solver=SolutionSeparation, model=Suitable):
    """Solution separation: an EKF without each instrument beside the one with all; detects and excludes a wrong one.

    It gives a protection level, for one wrong instrument beside a sound IMU.

    Do not use it beside an IMU that is poorer than its datasheet: it may exclude a sound receiver and follow what is
    left, does not notice that it is lost, and its protection level need not hold. Before version 4, on 5 of 44 voyages
    of ``training-poor-imu`` (from seed 87000 on) it had more than 1.5 times the error of ``ekf``, 40 times at most.

    Do not use it on a vessel without an IMU whose log measures the velocity through the water: a current is not in the
    datasheet of the log, so log and compass agree with each other and not with the fixes. On 6 recordings of boats
    and ships (``python -m tests.audit beside_ekf``) it had up to 70 times the error of ``ship-ekf``. A recommendation
    therefore never names it.

    Source: R. G. Brown and P. W. McBurney, *Self-contained GPS integrity check using maximum solution separation*,
    Navigation 35(1), 1988; J. Blanch, T. Walter, P. Enge et al., *Baseline advanced RAIM user algorithm and possible
    improvements*, IEEE Trans. Aerospace and Electronic Systems 51(1), 2015.

    Versions
    --------
    2
        The IMU is a suspect also beside a single fix or log. The last fix or log that delivers is not excluded if a
        disturbed IMU would explain why it disagrees, and an excluded one is used again where the position without it
        becomes more uncertain than the separation was. What a compass says does not condemn it, nor does a filter that
        has just begun.
    3
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    4
        A fix that no other fix or log is heard beside has the IMU alone against it, which may as well be wrong. It is
        not left out as a gross error after a gap, or if the one before was improbable in about the same direction.
    5
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 5
    advised_against = True


@register("mid-value")
class MidValue(
    Row,
    solver=MidValueSelection,
    model=Suitable,
    adaptation=VariationalBayes,
    weighting=GraduatedNonConvexity,
    isolation=FaultIsolation,
    iteration=poor_heading,
):
    """The middle one of three solutions: ``ekf``, ``vb-akf`` and ``gnc-fgo``, with the covariance of their mixture.

    The row for which the three assumptions need not hold at once: that every datasheet is right, that an instrument's
    noise only changes its size, that wrong measurements are the fewer ones. Where two of them fail to the same side it
    is wrong, and its covariance may be too small; so it is if all three believe the only instrument that gives the
    position.

    Beside an IMU that is poorer than its datasheet, 2 of 198 voyages (``training-poor-imu``, seeds 70000 to 70199) had
    more than 1.5 times the error of ``ekf``, 1.6 times at most (70091).

    Source: S. Osder, *Practical view of redundancy management application and theory*, J. Guidance, Control, and
    Dynamics 22(1), 1999; H. W. Sorenson and D. L. Alspach, *Recursive Bayesian estimation using Gaussian sums*,
    Automatica 7(4), 1971.

    Versions
    --------
    2
        A satellite that the others contradict is left out by the window without a schedule
        (`simnav.estimators.weightings.channel_vote`). Where no instrument has channels, the numbers are those of
        version 1.
    3
        It is inconsistent, too, while fixes that it sets aside contradict it (`FixTest`).
    4
        The motion is suspected, too, where the weighting has rejected measurements, and where there is no log.
    5
        As version 4 of ``huber-fgo``.
    6
        As of ``vb-akf``.
    7
        Values that the IMU did not measure are replaced (`FlatLineTest`).
    """

    version = 7


@register("mh-ekf")
class MultipleHypothesisEkf(Row, solver=MultipleHypothesis, model=DoubtedInstruments):
    """Multiple-hypothesis EKF: it weighs that all is well against faults of fixes, log, compass, IMU and start.

    It says which instrument is wrong, since when and with which probability (diagnostics ``doubt.NAME`` and
    ``since.NAME``), and flags the measurements of one that is.

    Beside a receiver alone a fix that is wrong for minutes cannot be told from a wrong IMU. With two instruments wrong
    at once it may blame a third one, as ``training-voyages`` 51007 and 51021 show (a wrong fix, and
    a DVL that reports zero).

    Source: D. T. Magill, *Optimal adaptive estimation of sampled stochastic processes*, IEEE TAC 10(4), 1965; A. S.
    Willsky and H. L. Jones, *A generalized likelihood ratio approach to the detection and estimation of jumps in linear
    systems*, IEEE TAC 21(1), 1976.

    Versions
    --------
    2
        The evidence counts readings of one time of several channels (satellites, beams, points of a terrain), too.
    3
        A start whose heading is not known to 15 deg is a bank of headings.
    4
        Values that the IMU did not measure are replaced (`FlatLineTest`), so gyroscopes that saturate are no case of
        their own.
    5
        That the biases of the IMU drift is a hypothesis, begun every 20 s in any case, like those on fixes.
    6
        A heading that neither a fix nor a compass sees is not doubted, nor is the IMU beside the log that is left. That
        the IMU has more noise is a hypothesis.
    """

    version = 6
