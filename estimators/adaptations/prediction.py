"""Tests of the prediction: whether a large innovation is the error of its instrument or that of the prediction."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.estimators.models.roles import fixes_and_logs, witnesses
from simnav.estimators.persistence import COURSE, TIME, add_innovation, begun, is_correlated, is_directed, is_large
from simnav.kernel_types import FlagMatrix, IntegerMatrix, Matrix, Vector
from simnav.types import Array, Flags, Instruments, Integers

from .base import Innovation

__all__ = [
    "BLAMED", "HAS_PASSED", "IS_DISTURBED", "IS_WRONG", "PredictionTest", "joint_inflation", "judge_prediction",
    "standardised",
]  # fmt: skip


@kernel
def standardised(residual: Vector, predicted: Matrix, noise: Matrix) -> tuple[float, float, float]:
    """The components of an innovation, each divided by its sigma in ``H P H' + R``, with zeros up to three."""
    m = residual.size
    u0 = residual[0] / sqrt(predicted[0, 0] + noise[0, 0])
    u1 = residual[1] / sqrt(predicted[1, 1] + noise[1, 1]) if m > 1 else 0.0
    u2 = residual[2] / sqrt(predicted[2, 2] + noise[2, 2]) if m > 2 else 0.0
    return u0, u1, u2


#: Places in the memory of an instrument, after its course (`simnav.estimators.persistence`): time at which it last
#: found the prediction wrong, -inf if it no longer does; number of failures in a row of its joint test, and time of the
#: last test; and whether a log was against it since its innovations persist.
WRONG, FAILURES, TESTED, CONDEMNED = range(COURSE, COURSE + 4)
#: Places of the settings: number of joint failures; whether there is an IMU; the normal quantiles of the class; number
#: of failures between two inflations; and, from LIMITS on, the limits of chi-square for 0 to 3 components.
TOGETHER, INERTIAL, LARGE, PERSISTENT, WHITE, ALONE, RECENT, ROUND, LIMITS = range(9)
#: Places of what is kept of inflations: number of failures of the prediction since a joint test was passed; and, from
#: FIRST on, the variances of the state before the first inflation, or zeros.
BLAMED, FIRST = range(2)
#: The largest factor of an inflation, and the largest one of all of them together.
LARGEST, TOTAL = 100.0, 1e8
#: What `judge_prediction` says of an innovation: bits of an integer.
IS_WRONG, IS_DISTURBED, HAS_PASSED = 1, 2, 4


@helper
def _fails_jointly(
    i: int, time: float, square: float, limit: float, settings: Array, sort: Integers, memory: Array
) -> int:
    """Whether instrument i and one of the other group have failed often enough in a row, this time included.

    The statistic is the sum of the squared standardised components of the innovation.
    """
    memory[i, TESTED] = time
    if square <= limit:
        memory[i, FAILURES] = 0.0
        return HAS_PASSED
    memory[i, FAILURES] += 1.0
    if memory[i, FAILURES] >= settings[TOGETHER]:
        for k in range(sort.shape[0]):
            often = sort[k, 0] != sort[i, 0] and memory[k, FAILURES] >= settings[TOGETHER]
            if often and time - memory[k, TESTED] <= settings[RECENT]:
                return IS_DISTURBED
    return 0


@helper
def _persists(
    i: int, time: float, settings: Array, sort: Integers, recent: Array, witness: Flags, memory: Array
) -> bool:
    """Whether the innovations of instrument i persist, and no witness is against it."""
    heard, sound = False, False
    for k in range(recent.size):
        if witness[i, k] and time - memory[k, TIME] <= recent[k]:
            heard = True
            sound = sound or not is_correlated(memory[k], settings[WHITE])
    if sort[i, 0] == 0 and not heard and is_directed(memory[i], settings[ALONE]):
        return True
    persistent = is_correlated(memory[i], settings[PERSISTENT]) and is_large(memory[i], settings[LARGE])
    if not persistent or not heard:
        memory[i, CONDEMNED] = 0.0
        return persistent
    if memory[i, CONDEMNED] > 0.0 or sound:
        if sort[i, 0] == 1:
            memory[i, CONDEMNED] = 1.0
        return False
    return True


@kernel
def judge_prediction(
    residual: Vector,
    predicted: Matrix,
    noise: Matrix,
    i: int,
    time: float,
    settings: Vector,
    known: tuple[IntegerMatrix, Vector, FlagMatrix],
    memory: Matrix,
) -> int:
    """Make the tests of `PredictionTest` for an innovation of m components.

    Parameters
    ----------
    residual, predicted, noise : (m,), (m, m), (m, m) arrays
        Innovation, H P H' and R.
    i : int
        Index of the instrument among the k instruments; -1 for another one.
    time : float
        Time of the measurement [s].
    settings : array
        See `TOGETHER` and the constants after it.
    known : (k, 2) int, (k,) and (k, k) bool arrays
        Group of each instrument (0 log, 1 fix, -1 none) and whether the test of persistence is made; time for which it
        is heard [s]; which others are witnesses of its prediction.
    memory : (k, ...) array
        See `WRONG` and the constants after it; updated.

    Returns
    -------
    int
        Sum of `IS_WRONG`, `IS_DISTURBED` and `HAS_PASSED`, the last for the joint test.
    """
    sort, recent, witness = known
    if i < 0 or (sort[i, 0] < 0 and sort[i, 1] == 0):
        for k in range(recent.size):
            if time - memory[k, WRONG] <= recent[k]:
                return IS_WRONG
        return 0
    u0, u1, u2 = standardised(residual, predicted, noise)
    square, limit = u0 * u0 + u1 * u1 + u2 * u2, settings[LIMITS + residual.size]
    found = 0
    if sort[i, 0] >= 0:
        found = _fails_jointly(i, time, square, limit, settings, sort, memory)
    wrong = found == IS_DISTURBED
    if sort[i, 1] == 1:
        add_innovation(memory[i], u0, u1, u2, residual.size, time, square > limit)
        wrong = _persists(i, time, settings, sort, recent, witness, memory) or wrong
    memory[i, WRONG] = time if wrong and settings[INERTIAL] > 0.0 else -np.inf
    return found + IS_WRONG if wrong else found


@kernel
def limited_inflation(inflation: float, covariance: Matrix, kept: Vector) -> float:
    """Limit an inflation of P (`PredictionTest.limited`)."""
    if inflation <= 1.0:
        return 1.0
    grown = 0.0
    begins = kept[FIRST] == 0.0
    for i in range(covariance.shape[0]):
        variance = covariance[i, i]
        if begins:
            kept[FIRST + i] = max(variance, 1e-30)
        grown = max(grown, variance / kept[FIRST + i])
    return max(1.0, min(inflation, LARGEST, TOTAL / grown))


@kernel
def joint_inflation(
    residual: Vector, predicted: Matrix, noise: Matrix, covariance: Matrix, settings: Vector, kept: Vector
) -> float:
    """Count a failure of the prediction, and return the factor on the variances (`PredictionTest.inflation`)."""
    kept[BLAMED] += 1.0
    if int(kept[BLAMED] - 1.0) % int(settings[ROUND]) != 0:
        return 1.0
    u0, u1, u2 = standardised(residual, predicted, noise)
    return limited_inflation(0.5 * sqrt((u0 * u0 + u1 * u1 + u2 * u2) / residual.size), covariance, kept)


class PredictionTest:
    """Tests of the innovations of fixes and logs: whether a large innovation comes from a wrong prediction.

    An adaptation gives less weight to measurements that do not fit the prediction. It assumes that H P H' is right, so
    that a large innovation is the error of its instrument. If the IMU is worse than its datasheet or disturbed, the
    prediction is wrong, and an adaptation that gives the aids less weight leaves the filter to this IMU. There are two
    tests of the assumption, and the adaptation is not used where one of them fails:

    *Joint failures.* Zhan et al. (2026) separate the two cases by the chi-square tests of GNSS and DVL: if one of them
    fails, that instrument is wrong; if both fail, the prediction is. Gross errors of both may coincide by chance, so
    both tests must fail ``together`` times in a row. The motion is then taken as disturbed (`disturbed`).

    *Persistence.* The noise of an instrument is white, the error of a state is not (`Course`). The prediction is taken
    as wrong if

    - the recent innovations of the instrument are correlated from one to the next, and too large for R and H P H'; and
    - no witness is against it. A witness is another instrument that would notice the same error of the prediction
      (`simnav.estimators.models.roles.witnesses`): it is heard, and its own innovations are not correlated. So a
      lasting error of the fixes is found if a log agrees with the prediction, and the other way round. A filter that
      believes wrong fixes soon disagrees with the log, too. So what the log said at first stands until the fixes agree
      again. What fixes say of a log does not stand: they see a wrong velocity only when the position has drifted. (Its
      price: where a wrong log pulls the position, as with Huber's weights, which never vanish, it may be believed
      later. The row then has about the error of the plain filter.)

    So a lasting error is blamed on an instrument only by a witness. Without one it cannot be told from a wrong
    prediction, however large it is: a gyroscope that is disturbed for a second makes errors of any size. The instrument
    is then believed, as in the plain filter. Its error is bounded, and the error of an IMU alone is not. Without an IMU
    this test is not made.

    *A log that is left alone.* Fixes that get no weight for some seconds cost little, because the next one restores the
    position. What a log says of a motion is said once: if it gets no weight, the position has lost it. So a log that no
    witness is heard beside is believed as soon as two or more successive innovations fail their tests in about the
    same direction, which a larger noise does in one case of ten (`Course.directed`). A single gross error is no run.

    *Compasses.* A lasting disagreement of a compass and the gyroscopes alone is that of the compass. But while another
    instrument finds the prediction wrong, so may be the heading, which the same IMU predicts: the compass is believed.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.
    together : int
        Number of times in a row that both tests must fail before the prediction is taken as wrong; 0: neither test is
        made.
    probability : float
        Probability that a good measurement passes its test, and that innovations which are not too large pass theirs.

    Attributes
    ----------
    disturbed : bool
        Whether the last innovation failed jointly with those of another instrument.
    index : dict of str to int
        Place of each instrument among those of the run.
    """

    RECENT = 5.0  # s; what another instrument did before, or before its last three periods, does not count
    PERSISTENT = 0.99  # probability that the innovations of a white noise are not found correlated
    WHITE = 0.95  # the same for a witness, which must be beyond doubt
    ALONE = 0.9  # probability that failures of a lone log by white noise are not found to have a common direction

    def __init__(self, instruments: Instruments, together: int = 3, probability: float = 0.999):
        self.together, self.disturbed = together, False
        group = fixes_and_logs(instruments) if together else {}
        inertial = instruments.imu is not None
        if not inertial and len(set(group.values())) < 2:
            group = {}
        against = witnesses(instruments) if together and inertial else {}
        quantiles = [normal_quantile(p) for p in (probability, self.PERSISTENT, self.WHITE, self.ALONE)]
        limits = chi_square_limits(probability)
        self._settings = np.array([together, inertial, *quantiles, self.RECENT, together * len(group), *limits])
        self.index = {name: i for i, name in enumerate(instruments)}
        self._known = (
            np.array([(group.get(n, -1), n in against) for n in instruments], np.int64).reshape(-1, 2),
            np.array([max(self.RECENT, 3.0 / sheet.rate) for sheet in instruments.values()]),
            np.array([[other in against.get(n, ()) for other in instruments] for n in instruments], bool),
        )
        self._memory = begun(len(instruments), more=4)
        self._memory[:, WRONG] = -np.inf
        self._tests = bool(group or against)
        self._kept = np.zeros(FIRST)

    def arrays(self, n: int) -> dict[str, Any]:
        """Whether a test is made, the last three arguments of `judge_prediction`, and what is kept for n states."""
        sort, recent, witness = self._known
        return {
            "tests": self._tests, "limits": self._settings, "sort": sort, "recent": recent, "witness": witness,
            "memory": self._memory, "kept": self._kept_of(n),
        }  # fmt: skip

    def _kept_of(self, n: int) -> Array:
        if len(self._kept) == FIRST:
            self._kept = np.concatenate([self._kept, np.zeros(n)])
        return self._kept

    def fails(self, innovation: Innovation) -> bool:
        """Whether the prediction of this innovation is taken as wrong, by one of the tests."""
        self.disturbed = False
        if not self._tests:
            return False
        m, residual, predicted, noise, *_ = innovation
        i = self.index.get(m.instrument, -1)
        found = judge_prediction(residual, predicted, noise, i, m.time, self._settings, self._known, self._memory)
        if found & HAS_PASSED:
            self._kept[BLAMED] = 0.0
        self.disturbed = found & IS_DISTURBED > 0
        return found & IS_WRONG > 0

    def inflation(self, innovation: Innovation) -> float:
        """Factor of P after a failure of the prediction: once for every ``together`` failures.

        The root of the mean squared standardised component, over 2 (eqs. 28 and 34 of Zhan et al. 2026), within
        `limited`.
        """
        _, residual, predicted, noise, covariance, _ = innovation
        if covariance is None:
            return 1.0
        kept = self._kept_of(len(covariance))
        return joint_inflation(residual, predicted, noise, covariance, self._settings, kept)

    def limited(self, inflation: float, innovation: Innovation) -> float:
        """Limit an inflation. Without the limit, the variances of unobserved states would grow without bound.

        A single inflation is at most `LARGEST`, and no variance exceeds `TOTAL` times its value before the first one.
        """
        if innovation.covariance is None:
            return 1.0
        return limited_inflation(inflation, innovation.covariance, self._kept_of(len(innovation.covariance)))
