"""Tests of the prediction: whether a large innovation is the error of its instrument or that of the prediction."""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.estimators.models.roles import fixes_and_logs, witnesses
from simnav.estimators.persistence import Course
from simnav.types import Array, Instruments

from .base import Innovation

__all__ = ["PredictionTest", "standardised"]


@kernel("UniTuple(f8, 3)(f8[::1], f8[:, ::1], f8[:, ::1])")
def standardised(residual: Array, predicted: Array, noise: Array) -> tuple[float, float, float]:
    """The components of an innovation, each divided by its sigma in ``H P H' + R``, with zeros up to three."""
    m = residual.size
    u0 = residual[0] / sqrt(predicted[0, 0] + noise[0, 0])
    u1 = residual[1] / sqrt(predicted[1, 1] + noise[1, 1]) if m > 1 else 0.0
    u2 = residual[2] / sqrt(predicted[2, 2] + noise[2, 2]) if m > 2 else 0.0
    return u0, u1, u2


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
    """

    RECENT = 5.0  # s; what another instrument did before, or before its last three periods, does not count
    PERSISTENT = 0.99  # probability that the innovations of a white noise are not found correlated
    WHITE = 0.95  # the same for a witness, which must be beyond doubt
    ALONE = 0.9  # probability that failures of a lone log by white noise are not found to have a common direction
    LARGEST, TOTAL = 100.0, 1e8

    def __init__(self, instruments: Instruments, together: int = 3, probability: float = 0.999):
        self.together, self.disturbed = together, False
        self._limits = chi_square_limits(probability)
        self._large = normal_quantile(probability)
        self._persistent, self._white = normal_quantile(self.PERSISTENT), normal_quantile(self.WHITE)
        self._alone = normal_quantile(self.ALONE)
        self._group = fixes_and_logs(instruments) if together else {}
        self._inertial = instruments.imu is not None
        if not self._inertial and len(set(self._group.values())) < 2:
            self._group = {}
        self._recent = {name: max(self.RECENT, 3.0 / sheet.rate) for name, sheet in instruments.items()}
        self._witnesses = witnesses(instruments) if together and self._inertial else {}
        self._condemned: set[str] = set()  # fixes that a log was against since their innovations persist
        self._courses: dict[str, Course] = {}
        self._wrong: dict[str, float] = {}  # when an instrument last found the prediction wrong, if it still does
        self._failures: dict[str, tuple[int, float]] = {}
        self._first: Array | None = None
        self._blamed = 0

    def fails(self, innovation: Innovation) -> bool:
        """Whether the prediction of this innovation is taken as wrong, by one of the tests."""
        self.disturbed = False
        name, time = innovation.measurement.instrument, innovation.measurement.time
        if name not in self._group and name not in self._witnesses:
            return any(time - t <= self._recent[other] for other, t in self._wrong.items())
        components = standardised(innovation.residual, innovation.predicted, innovation.noise)
        count = len(innovation.residual)
        if name in self._group:
            self.disturbed = self._fails_jointly(name, time, components, count)
        wrong = (name in self._witnesses and self._persists(name, time, components, count)) or self.disturbed
        if wrong and self._inertial:
            self._wrong[name] = time
        else:
            self._wrong.pop(name, None)
        return wrong

    def _fails_jointly(self, name: str, time: float, components: tuple[float, float, float], count: int) -> bool:
        """Whether this instrument and one of the other group have failed often enough in a row, this time included.

        The statistic is the sum of the squared standardised components of the innovation.
        """
        if sum(u * u for u in components) <= self._limits[count]:
            self._failures[name] = 0, time
            self._blamed = 0
            return False
        failed = self._failures.get(name, (0, time))[0] + 1
        self._failures[name] = failed, time
        return failed >= self.together and any(
            self._group[other] != self._group[name] and n >= self.together and time - t <= self.RECENT
            for other, (n, t) in self._failures.items()
        )

    def _persists(self, name: str, time: float, components: tuple[float, float, float], count: int) -> bool:
        """Whether the innovations of an instrument persist, and no witness is against it."""
        course = self._courses.get(name)
        if course is None:
            course = self._courses[name] = Course()
        course.add(components, count, time, sum(u * u for u in components) > self._limits[count])
        if self._group.get(name) is False and course.directed(self._alone) and not self._heard(name, time):
            return True
        if not (course.correlated(self._persistent) and course.large(self._large)):
            self._condemned.discard(name)
            return False
        heard = self._heard(name, time)
        if not heard:
            self._condemned.discard(name)
        elif name in self._condemned or not all(witness.correlated(self._white) for witness in heard):
            if self._group.get(name):
                self._condemned.add(name)
            return False
        return True

    def _heard(self, name: str, time: float) -> list[Course]:
        """The courses of those witnesses of an instrument that are heard."""
        return [
            self._courses[other]
            for other in self._witnesses[name]
            if other in self._courses and time - self._courses[other].time <= self._recent[other]
        ]

    def inflation(self, innovation: Innovation) -> float:
        """Factor of P after a failure of the prediction: once for every ``together`` failures.

        The root of the mean squared standardised component, over 2 (eqs. 28 and 34 of Zhan et al. 2026), within
        `limited`.
        """
        self._blamed += 1
        if (self._blamed - 1) % (self.together * len(self._group)):
            return 1.0
        components = standardised(innovation.residual, innovation.predicted, innovation.noise)
        return self.limited(0.5 * sqrt(sum(u * u for u in components) / len(innovation.residual)), innovation)

    def limited(self, inflation: float, innovation: Innovation) -> float:
        """Limit an inflation. Without the limit, the variances of unobserved states would grow without bound.

        A single inflation is at most `LARGEST`, and no variance exceeds `TOTAL` times its value before the first one.
        """
        if inflation <= 1.0 or innovation.covariance is None:
            return 1.0
        variances = innovation.covariance.diagonal()
        if self._first is None:
            self._first = np.maximum(variances, 1e-30)
        grown = float(np.max(variances / self._first))
        return max(1.0, min(inflation, self.LARGEST, self.TOTAL / grown))
