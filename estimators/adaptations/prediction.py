"""Tests of the prediction: whether a large innovation is the error of its instrument or that of the prediction."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.estimators.models.roles import fixes_and_logs, witnesses
from simnav.estimators.onset import Onsets, add_to_onset, no_onsets
from simnav.estimators.persistence import (
    Courses,
    add_innovation,
    is_correlated,
    is_directed,
    is_large,
    no_innovations,
)
from simnav.kernel_types import FlagMatrix, FlagVector, IntegerVector, Matrix, Vector
from simnav.records import Record
from simnav.types import Instruments

__all__ = ["Judgement", "PredictionTest", "TestRecord", "joint_inflation", "judge_prediction", "standardised"]


#: Groups of the joint test: logs, fixes (with the velocity of a receiver), and what takes no part in it.
LOG, FIX, NEITHER = 0, 1, -1


def _group(is_fix: bool | None) -> int:
    return NEITHER if is_fix is None else FIX if is_fix else LOG


@kernel
def standardised(residual: Vector, predicted: Matrix, noise: Matrix) -> tuple[float, float, float]:
    """The components of an innovation, each divided by its sigma in ``H P H' + R``, with zeros up to three."""
    m = residual.size
    u0 = residual[0] / sqrt(predicted[0, 0] + noise[0, 0])
    u1 = residual[1] / sqrt(predicted[1, 1] + noise[1, 1]) if m > 1 else 0.0
    u2 = residual[2] / sqrt(predicted[2, 2] + noise[2, 2]) if m > 2 else 0.0
    return u0, u1, u2


class TestRecord(Record):
    """The tests of `PredictionTest` as data, for k instruments and n states.

    Attributes
    ----------
    tests : bool
        Whether a test is made at all.
    inertial : bool
        Whether there is an IMU.
    together : int
        Number of joint failures in a row after which the prediction is taken as wrong.
    failures_per_inflation : int
        Number of failures between two inflations.
    large, persistent, white, alone : float
        Normal quantiles of the probabilities of `PredictionTest`.
    joint_time : float
        Time for which a failure of another instrument counts [s].
    limits : (4,) array
        Limits of chi-square for 0 to 3 components.
    group : (k,) array of int
        Group of each instrument in the joint test: `LOG`, `FIX` or `NEITHER`.
    persistence : (k,) array of bool
        Whether the test of persistence is made for an instrument.
    heard : (k,) array
        Time for which an instrument counts as heard [s].
    witness : (k, k) array of bool
        Which others are witnesses of the prediction of an instrument.
    courses : Courses
        The recent innovations of the instruments.
    onsets : Onsets
        How their present failures began.
    wrong : (k,) array
        Time at which an instrument last found the prediction wrong [s]; -inf if it no longer does.
    failures : (k,) array
        Number of failures in a row of its joint test.
    joint_test : (k,) array
        Time of its last joint test [s].
    condemned : (k,) array of bool
        Whether a log was against it since its innovations persist.
    blamed : (1,) array
        Number of failures of the prediction since a joint test was passed.
    first : (n,) array
        Variances of the state before the first inflation; zeros before it.
    """

    tests: bool
    inertial: bool
    together: int
    failures_per_inflation: int
    large: float
    persistent: float
    white: float
    alone: float
    joint_time: float
    limits: Vector
    group: IntegerVector
    persistence: FlagVector
    heard: Vector
    witness: FlagMatrix
    courses: Courses
    onsets: Onsets
    wrong: Vector
    failures: Vector
    joint_test: Vector
    condemned: FlagVector
    blamed: Vector
    first: Vector


#: The largest factor of an inflation, and the largest one of all of them together.
LARGEST, TOTAL = 100.0, 1e8


class Judgement(NamedTuple):
    """What the tests say of an innovation.

    Attributes
    ----------
    wrong : bool
        Whether the prediction is taken as wrong.
    disturbed : bool
        Whether the joint test has found that: the motion is taken as disturbed.
    """

    wrong: bool
    disturbed: bool


@helper
def _fails_jointly(i: int, time: float, t: TestRecord) -> bool:
    """Count a failure of instrument i, and say whether it and one of the other group have failed often enough."""
    t.failures[i] += 1.0
    if t.failures[i] >= t.together:
        for k in range(t.group.size):
            often = t.group[k] != t.group[i] and t.failures[k] >= t.together
            if often and time - t.joint_test[k] <= t.joint_time:
                return True
    return False


@helper
def _persists(i: int, time: float, t: TestRecord) -> bool:
    """Whether the innovations of instrument i persist, and have grown or are contradicted by no witness."""
    heard, sound = False, False
    for k in range(t.heard.size):
        if t.witness[i, k] and time - t.courses.time[k] <= t.heard[k]:
            heard = True
            sound = sound or not is_correlated(t.courses, k, t.white)
    if t.group[i] == LOG and not heard and is_directed(t.courses, i, t.alone):
        return True
    persistent = is_correlated(t.courses, i, t.persistent) and is_large(t.courses, i, t.large)
    if not persistent or not heard:
        t.condemned[i] = False
        return persistent
    if t.group[i] == LOG and not t.onsets.sudden[i]:
        return True
    if t.condemned[i] or sound:
        if t.group[i] == FIX:
            t.condemned[i] = True
        return False
    return True


@kernel
def judge_prediction(
    residual: Vector, predicted: Matrix, noise: Matrix, i: int, time: float, value: Vector, t: TestRecord
) -> Judgement:
    """Make the tests of `PredictionTest` for an innovation of m components.

    Parameters
    ----------
    residual, predicted, noise : (m,), (m, m), (m, m) arrays
        Innovation, H P H' and R.
    i : int
        Index of the instrument among the k instruments; -1 for another one.
    time : float
        Time of the measurement [s].
    value : (m,) array
        The reading itself.
    t : TestRecord
        The tests; what they keep is updated.
    """
    if i < 0 or (t.group[i] == NEITHER and not t.persistence[i]):
        for k in range(t.heard.size):
            if time - t.wrong[k] <= t.heard[k]:
                return Judgement(True, False)
        return Judgement(False, False)
    u0, u1, u2 = standardised(residual, predicted, noise)
    square, limit = u0 * u0 + u1 * u1 + u2 * u2, t.limits[residual.size]
    disturbed = False
    if t.group[i] != NEITHER:
        t.joint_test[i] = time
        if square <= limit:
            t.failures[i] = t.blamed[0] = 0.0
        else:
            disturbed = _fails_jointly(i, time, t)
    wrong = disturbed
    if t.persistence[i]:
        add_innovation(t.courses, i, u0, u1, u2, residual.size, time, square > limit)
        add_to_onset(t.onsets, i, u0, u1, u2, value, square > limit)
        wrong = _persists(i, time, t) or wrong
    t.wrong[i] = time if wrong and t.inertial else -np.inf
    return Judgement(wrong, disturbed)


@kernel
def limited_inflation(inflation: float, covariance: Matrix, first: Vector) -> float:
    """Limit an inflation of P. Without the limit, the variances of unobserved states would grow without bound.

    A single inflation is at most `LARGEST`, and no variance exceeds `TOTAL` times its value before the ``first`` one.
    """
    if inflation <= 1.0:
        return 1.0
    grown = 0.0
    begins = first[0] == 0.0
    for i in range(covariance.shape[0]):
        variance = covariance[i, i]
        if begins:
            first[i] = max(variance, 1e-30)
        grown = max(grown, variance / first[i])
    return max(1.0, min(inflation, LARGEST, TOTAL / grown))


@kernel
def joint_inflation(residual: Vector, predicted: Matrix, noise: Matrix, covariance: Matrix, t: TestRecord) -> float:
    """Count a failure of the prediction, and return the factor of P: above 1 once in ``failures_per_inflation``.

    It is the root of the mean squared standardised component, over 2 (eqs. 28 and 34 of Zhan et al. 2026), limited.
    """
    t.blamed[0] += 1.0
    if int(t.blamed[0] - 1.0) % t.failures_per_inflation != 0:
        return 1.0
    u0, u1, u2 = standardised(residual, predicted, noise)
    return limited_inflation(0.5 * sqrt((u0 * u0 + u1 * u1 + u2 * u2) / residual.size), covariance, t.first)


class PredictionTest:
    """Tests of the innovations of fixes and logs: whether a large innovation comes from a wrong prediction.

    An adaptation gives less weight to measurements that do not fit the prediction. It assumes that H P H' is right, so
    that a large innovation is the error of its instrument. If the IMU is worse than its datasheet or disturbed, the
    prediction is wrong, and an adaptation that gives the aids less weight leaves the filter to this IMU. There are two
    tests of the assumption, and the adaptation is not used where one of them fails:

    *Joint failures.* Zhan et al. (2026) separate the two cases by the chi-square tests of GNSS and DVL: if one of them
    fails, that instrument is wrong; if both fail, the prediction is. Gross errors of both may coincide by chance, so
    both tests must fail ``together`` times in a row. The motion is then taken as disturbed.

    *Persistence.* The noise of an instrument is white, the error of a state is not (`Courses`). The prediction is taken
    as wrong if

    - the recent innovations of the instrument are correlated from one to the next, and too large for R and H P H'; and
    - no witness is against it. A witness is another instrument that would notice the same error of the prediction
      (`simnav.estimators.models.roles.witnesses`): it is heard, and its own innovations are not correlated. So a
      lasting error of the fixes is found if a log agrees with the prediction, and the other way round. Once a log has
      been against the fixes, that stands until the fixes agree again (`condemned`): a filter that believes wrong fixes
      soon disagrees with the log, too. What fixes say of a log does not stand: they see a wrong velocity only when the
      position has drifted. (Its price: where a wrong log pulls the position, as with Huber's weights, which never
      vanish, it may be believed later. The row then has about the error of the plain filter.)

    So a lasting error is blamed on an instrument only by a witness. Without one it cannot be told from a wrong
    prediction, however large it is: a gyroscope that is disturbed for a second makes errors of any size. The instrument
    is then believed, as in the plain filter. Its error is bounded, and the error of an IMU alone is not. Without an IMU
    this test is not made.

    *A log whose failures grow.* A wrong prediction is an integral and grows through all sizes, and an instrument that
    begins to be wrong is wrong at once (`simnav.estimators.onset`). So a log whose failures began little by little is
    believed, whatever its witnesses say: rare or coarse fixes notice a wrong heading only when the position has
    drifted. (Its price: an error of a log that itself grows is believed, as in the plain filter.)

    *A log that is left alone.* Fixes that get no weight for some seconds cost little, because the next one restores the
    position. What a log says of a motion is said once: if it gets no weight, the position has lost it. So a log that no
    witness is heard beside is believed as soon as two or more successive innovations fail their tests in about the
    same direction, which a larger noise does in one case of ten (`is_directed`). A single gross error is no run.

    *Compasses.* A lasting disagreement of a compass and the gyroscopes alone is that of the compass. But while another
    instrument finds the prediction wrong, so may be the heading, which the same IMU predicts: the compass is believed.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.
    together : int
        Number of times in a row that both tests must fail before the prediction is taken as wrong; 0: neither test is
        made.
    """

    GOOD = 0.999  # probability that a good measurement passes its test, and innovations that are not too large theirs
    RECENT = 5.0  # s; what another instrument did before, or before its last three periods, does not count
    PERSISTENT = 0.99  # probability that the innovations of a white noise are not found correlated
    WHITE = 0.95  # the same for a witness, which must be beyond doubt
    ALONE = 0.9  # probability that failures of a lone log by white noise are not found to have a common direction

    def __init__(self, instruments: Instruments, together: int = 3):
        group = fixes_and_logs(instruments) if together else {}
        inertial = instruments.imu is not None
        if not inertial and len(set(group.values())) < 2:
            group = {}
        against = witnesses(instruments) if together and inertial else {}
        large, persistent, white, alone = map(normal_quantile, (self.GOOD, self.PERSISTENT, self.WHITE, self.ALONE))
        count = len(instruments)
        self._first: dict[int, TestRecord] = {}
        self._shared: dict[str, Any] = {
            "tests": bool(group or against), "inertial": inertial, "together": together,
            "failures_per_inflation": max(together * len(group), 1), "large": large, "persistent": persistent,
            "white": white, "alone": alone, "joint_time": self.RECENT, "limits": np.array(chi_square_limits(self.GOOD)),
            "group": np.array([_group(group.get(n)) for n in instruments], np.int64),
            "persistence": np.array([n in against for n in instruments], np.bool_),
            "heard": np.array([max(self.RECENT, 3.0 / sheet.rate) for sheet in instruments.values()], np.float64),
            "witness": np.array(
                [[other in against.get(n, ()) for other in instruments] for n in instruments], np.bool_
            ).reshape(count, count),
            "courses": no_innovations(count), "onsets": no_onsets(count), "wrong": np.full(count, -np.inf),
            "failures": np.zeros(count),
            "joint_test": np.zeros(count), "condemned": np.zeros(count, np.bool_), "blamed": np.zeros(1),
        }  # fmt: skip

    def record(self, n: int) -> TestRecord:
        """The tests as data, in a filter of n states."""
        if n not in self._first:
            self._first[n] = TestRecord(first=np.zeros(n), **self._shared)
        return self._first[n]
