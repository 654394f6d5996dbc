"""Rows that are told of the truth, and are not ranked.

O0, O1, O1 with a smoother, and O3 of the reference literature differ in what they know of the faults:

- ``oracle-clairvoyant`` (O0): what each fault added; it works on the run without faults
- ``oracle`` (O1): which measurements a fault touched, and the statistics of the faults
- ``oracle-rts``: the same, smoothed; the reference of the post-processing track
- ``oracle-times``: which measurements a fault touched, and nothing of the sizes of the faults
- ``oracle-mixture`` (O3): how often gross errors come and how large they are, not which measurements they hit
"""

from simnav.estimator import register
from simnav.estimators.adaptations.truth import FaultTimes, MixtureNoise, NominalNoise, TrueNoise
from simnav.estimators.composition import Row, piece
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.estimators.solvers.smoother import Smoother

__all__ = ["Oracle", "OracleClairvoyant", "OracleMixture", "OracleRts", "OracleTimes"]


@register("oracle")
class Oracle(Row, solver=piece(OracleEstimator, restore=False), adaptation=TrueNoise):
    """Kalman filter about the truth that knows each measurement's noise and faults; rows are compared with it.

    It is not ranked. (Oracle O1.) Source: `simnav.estimators.solvers.oracle`, where its rules are.

    Versions
    --------
    2
        The swing of the lever arm of an instrument that is observed by a function (raw observations of satellites, or
        an uncertain lever arm) takes account of the gyroscopes' biases.
    3
        It is linearised at the true motion, without the errors of the IMU: beside a large bias of an accelerometer a
        Doppler log alone does not tell the heading.
    """

    version = 3


@register("oracle-clairvoyant")
class OracleClairvoyant(Row, solver=piece(OracleEstimator, restore=True), adaptation=NominalNoise):
    """Oracle that takes off each measurement what the faults added; only outages are left of them. (Oracle O0.)

    What an estimator would do on the clean run; the bound ``clean`` is its. Source: `simnav.estimators.solvers.oracle`.

    Versions
    --------
    2
        The swing of the lever arm of an instrument that is observed by a function (raw observations of satellites, or
        an uncertain lever arm) takes account of the gyroscopes' biases.
    3
        It is linearised at the true motion, without the errors of the IMU: beside a large bias of an accelerometer a
        Doppler log alone does not tell the heading.
    """

    version = 3


@register("oracle-rts")
class OracleRts(Oracle, smoother=Smoother):
    """The oracle with a Rauch-Tung-Striebel smoother behind it; the reference of the post-processing track.

    Source: H. E. Rauch, F. Tung and C. T. Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA
    Journal 3(8), 1965.

    Versions
    --------
    2
        The swing of the lever arm of an instrument that is observed by a function (raw observations of satellites, or
        an uncertain lever arm) takes account of the gyroscopes' biases.
    3
        It is linearised at the true motion, without the errors of the IMU: beside a large bias of an accelerometer a
        Doppler log alone does not tell the heading.
    """

    version = 3


@register("oracle-mixture")
class OracleMixture(Oracle, adaptation=MixtureNoise):
    """Oracle that knows the density of each measurement's noise, not which measurements a gross error hit. (Oracle O3.)

    The realistic target of robust estimators: the schedule of the faults and their sizes are known, each hit has to be
    told from the innovation (`simnav.estimators.adaptations.truth.MixtureNoise`). The bound ``mix`` is its. Source:
    `simnav.estimators.solvers.oracle`.

    Versions
    --------
    2
        The swing of the lever arm of an instrument that is observed by a function (raw observations of satellites, or
        an uncertain lever arm) takes account of the gyroscopes' biases.
    3
        It is linearised at the true motion, without the errors of the IMU: beside a large bias of an accelerometer a
        Doppler log alone does not tell the heading.
    """

    version = 3


@register("oracle-times")
class OracleTimes(Oracle, adaptation=FaultTimes):
    """Oracle that knows when each fault begins and ends, and not how large it is: it uses no measurement with a fault.

    The limit of detection and exclusion: what a row would reach that found every wrong measurement, at once and without
    a false alarm. A disturbance of the IMU is subtracted, as for the other oracles. Source:
    `simnav.estimators.solvers.oracle`.

    Versions
    --------
    2
        The swing of the lever arm of an instrument that is observed by a function (raw observations of satellites, or
        an uncertain lever arm) takes account of the gyroscopes' biases.
    3
        It is linearised at the true motion, without the errors of the IMU: beside a large bias of an accelerometer a
        Doppler log alone does not tell the heading.
    """

    version = 3
