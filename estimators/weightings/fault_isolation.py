"""Fault isolation in a window: if fixes and logs agree with each other but not with the motion, the motion is wrong.

A weighting decreases the weight of factors with large residuals. If the motion is wrong (a disturbed IMU), this affects
all measurements, and the window does not recover. As in a filter (`simnav.estimators.adaptations.prediction`, after
Zhan et al. 2026), the motion is a suspect if fixes and logs fail their chi-square tests together, several times in a
row. A filter cannot distinguish this from two instruments that are wrong at once, but a window can. For one iteration,
the motion factors of that time get nearly no weight; the errors of the instruments, which are states beside the motion,
stay as they are (`simnav.estimators.algebra.factors.Rows`). Then correct measurements agree with each other, and wrong
ones do not. Only those that agree get their full weight.

A measurement counts as failed if its residual fails the test, or if the last one of its instrument has ended with
hardly any weight: a new measurement has its full weight at first, and an uncertain state follows it. While a log is
failing, fixes fail, too, if their residuals since then do not pass a chi-square test together.

If no fix was heard for a while, a log is the last witness beside the motion. If it fails several times in a row, one of
the two is wrong, and nothing in the measurements says which. Then the motion is suspected: a log that is rejected for
good leaves a prediction without bound, and a log that is wrongly believed leaves an error that grows with its own.
The assumption is that a log is not wrong for long while it is the last witness. Where there is no log at all, the same
holds of fixes whose residuals have a common direction; those of a larger noise have none. Fixes alone hold velocity and
attitude badly, so the motion is loosened little at the first test, and more from test to test until they agree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.estimators.models.roles import fixes_and_logs
from simnav.kernel_types import FlagVector, IntegerVector, Vector
from simnav.types import Flags, Instruments

from .base import Factors

__all__ = ["FaultIsolation"]

#: Weight at which a measurement is rejected.
REJECTED = 0.5
#: Weight of the motion factors in the iteration that tests the measurements.
LOOSE = 1e-6
#: The same where there is no log, at the first test: fixes alone do not hold velocity and attitude, which must not go
#: too far. While the fixes do not agree, it is multiplied by the other factor from test to test, down to `LOOSE`.
LOOSE_WITHOUT_LOG, LOOSER = 1e-3, 0.1


class _News(NamedTuple):
    """What the new measurements say: index of the first, number of failed tests, and time of the latest fix or -inf."""

    first: int
    failing: int
    fixed: float


@kernel
def _news(
    time: Vector,
    tested: float,
    norm: Vector,
    components: IntegerVector,
    limits: Vector,
    instrument: IntegerVector,
    fixes: FlagVector,
) -> _News:
    """Test the measurements after a time; ``fixes`` says which instruments give fixes."""
    first, failing, fixed = time.size, 0, -np.inf
    while first > 0 and time[first - 1] > tested:
        first -= 1
        failing += norm[first] * norm[first] > limits[components[first]]
        if fixes[instrument[first]]:
            fixed = max(fixed, time[first])
    return _News(first, failing, fixed)


@kernel
def _mark_rejected(
    time: Vector, tested: float, weight: Vector, instrument: IntegerVector, rejected: FlagVector
) -> bool:
    """Mark the instruments whose newest measurement up to a time has hardly any weight; whether there are some."""
    for k in range(rejected.size):
        rejected[k] = False
    for i in range(time.size):
        if time[i] <= tested:
            rejected[instrument[i]] = weight[i] <= REJECTED
    return bool(np.any(rejected))


class FaultIsolation:
    """The fault isolation of the module. It changes the weights of a weighting, after it at every iteration.

    Parameters
    ----------
    together : int
        Fault isolation: number of times in a row that a fix and a log must fail before the motion is tested; 0: never.
    recent : float
        Fault isolation: age above which a failure of the other instrument does not count [s].
    sound : float
        Fault isolation: probability that a healthy measurement passes its test.
    """

    DIRECTED = 0.9  # probability that failures by white noise are not found to have a common direction

    def __init__(self, together: int = 3, recent: float = 5.0, sound: float = 0.999):
        if together < 0:
            raise ValueError(f"together = {together}: it must be 0 or more")
        if not recent >= 0.0:
            raise ValueError(f"recent = {recent:g}: it must be 0 or more seconds")
        if not 0.5 < sound < 1.0:
            raise ValueError(f"sound = {sound:g}: it must lie between 0.5 and 1")
        self.together, self.recent, self.sound = together, recent, sound
        self._limits, self._quantile = np.array(chi_square_limits(sound)), normal_quantile(self.DIRECTED)

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._is_fix = fixes_and_logs(instruments) if self.together else {}
        self._has_logs = False in self._is_fix.values()
        self._fixed = -np.inf  # the time of the latest fix
        self._failures: dict[str, tuple[int, float, float]] = {}  # running; the time of the first and of the latest
        self._blamed: list[tuple[float, float, NDArray[np.bool_]]] = []  # from, to, and which instruments agreed
        self._tested = -np.inf
        self._fixes: Flags | None = None  # of each instrument, whether it gives fixes
        self._any_rejected = False
        self._loose = LOOSE if self._has_logs else LOOSE_WITHOUT_LOG
        self._asking: tuple[float, float] | None = None
        self._weight = self._motion_weight = np.empty(0)
        self._fresh = True

    def judge(self, factors: Factors) -> bool:
        """Give measurements their full weight if the motion is faulty, or for the test whether it is.

        Returns
        -------
        bool
            False at the first iteration of an epoch, and in the iteration of the test: the weights are then not final.
        """
        if factors.iteration == 0:
            if self._asking is not None:  # the last epoch ended before the result of the test
                factors.motion_weight[:] = 1.0
            self._fresh, self._asking = True, None
            if self._is_fix:
                self._find_rejected(factors)
            return False
        if not self._is_fix:
            return True
        asked, self._asking = self._asking, None
        if asked is not None:
            agreeing = self._agreeing(factors, *asked)
            if agreeing is None:
                # The weights of this iteration belong to the test: restore those from before it.
                count = min(len(factors.weight), len(self._weight))
                factors.weight[:count] = self._weight[:count]
                factors.motion_weight[:] = self._motion_weight
                self._loose = max(LOOSER * self._loose, LOOSE)
                if self._alone(asked[1]):
                    self._failures.clear()  # what a wrong motion refers to a node contradicts itself for good
                return False
            if self._blamed and asked[0] <= self._blamed[-1][1]:
                self._blamed.pop()
            self._blamed.append((*asked, agreeing))
        suspected = self._suspect(factors) if self._fresh else None
        self._fresh = False
        for start, end, agreeing in self._blamed:
            factors.weight[(factors.time >= start) & (factors.time <= end) & agreeing[factors.instrument]] = 1.0
        if suspected is None:
            return True
        start, end = self._asking = suspected
        self._weight, self._motion_weight = factors.weight.copy(), factors.motion_weight.copy()
        factors.weight[(factors.time >= start) & (factors.time <= end)] = 1.0
        # The first reading may belong to an older node, so the motion that leads there is loosened, too.
        first = max(int(np.searchsorted(factors.motion_time, start, side="right")) - 1, 0)
        factors.motion_weight[first:][factors.motion_time[first:] <= end] = self._loose
        return False

    def _find_rejected(self, factors: Factors) -> None:
        """Find the instruments whose newest measurement of the last epoch ended with hardly any weight."""
        if self._fixes is None:
            self._fixes = np.array([self._is_fix.get(name) is True for name in factors.names], dtype=bool)
            self._rejected = np.zeros(len(factors.names), dtype=bool)
        self._any_rejected = _mark_rejected.unchecked(
            factors.time, self._tested, factors.weight, factors.instrument, self._rejected
        )

    def _suspect(self, factors: Factors) -> tuple[float, float] | None:
        """Test the new measurements at full weight; return the interval of a suspect motion, or None."""
        assert self._fixes is not None
        first, failing_now, fixed = _news.unchecked(
            factors.time, self._tested, factors.norm, factors.components, self._limits, factors.instrument, self._fixes
        )
        if first == len(factors.time):
            return None
        self._tested = now = float(factors.time[-1])
        self._fixed = max(self._fixed, fixed)
        if not (self._failures or failing_now or self._any_rejected):
            self._loose = LOOSE if self._has_logs else LOOSE_WITHOUT_LOG
            if not self._blamed:
                return None
        new = slice(first, None)
        # A new measurement has its full weight, so that an uncertain state may follow it; the weighting decides later.
        failed = factors.norm[new] ** 2 > self._limits[factors.components[new]]
        failed |= self._rejected[factors.instrument[new]]
        for i, time, fails in zip(factors.instrument[new].tolist(), factors.time[new].tolist(), failed.tolist()):
            name = factors.names[i]
            if not fails:
                self._failures.pop(name, None)
            elif name in self._is_fix:
                count, since, _ = self._failures.get(name, (0, time, time))
                self._failures[name] = count + 1, since, time
        self._blamed = [span for span in self._blamed if span[1] >= factors.time[0]]
        failing = {n: f for n, f in self._failures.items() if now - f[2] <= self.recent}
        if self._blamed and now - self._blamed[-1][1] <= self.recent and failing:
            return self._blamed[-1][0], now
        failing = {n: f for n, f in failing.items() if f[0] >= self.together}
        if not self._has_logs:
            failing = {n: f for n, f in failing.items() if self._directed(factors, n, f[1])}
        kinds = {self._is_fix[name] for name in failing}
        if kinds == {False} and self._fixes_contradict(factors, min(since for _, since, _ in failing.values())):
            kinds = {False, True}
        if len(kinds) < 2 and not (failing and (self._alone(now) if False in kinds else not self._has_logs)):
            return None
        return min(since for _, since, _ in failing.values()), now

    def _directed(self, factors: Factors, name: str, since: float) -> bool:
        """Whether the residuals of an instrument have had a common direction since a time, as noise has not."""
        its = (factors.instrument == factors.names.index(name)) & (factors.time >= since)
        residual, norm, m = factors.whitened[its], factors.norm[its], float(factors.components[its].max())
        cosine = np.einsum("ij,ij->i", residual[1:], residual[:-1]) / (norm[1:] * norm[:-1])
        return len(cosine) > 0 and float(cosine.sum()) * (m / len(cosine)) ** 0.5 > self._quantile

    def _fixes_contradict(self, factors: Factors, since: float) -> bool:
        """Whether the fixes of one instrument do not agree with the motion since a log has been failing."""
        fixes = [name for name in factors.names if self._is_fix.get(name)]
        return any(self._agrees(factors, name, since) is False for name in fixes)

    def _agrees(self, factors: Factors, name: str, start: float, end: float = np.inf) -> bool | None:
        """Whether the residuals of an instrument pass their chi-square test together; None if there are none."""
        from scipy.special import chdtri

        asked = (factors.time >= start) & (factors.time <= end) & (factors.instrument == factors.names.index(name))
        freedom = int(factors.components[asked].sum())
        if not freedom:
            return None
        return bool(np.sum(factors.norm[asked] ** 2) <= chdtri(freedom, 1.0 - self.sound))

    def _alone(self, now: float) -> bool:
        """Whether logs are the last witnesses: no fix was heard for a while."""
        return now - self._fixed > self.recent

    def _agreeing(self, factors: Factors, start: float, end: float) -> NDArray[np.bool_] | None:
        """A mask of the instruments that agree without the motion.

        None unless a log is among them, and a fix as well where one was heard lately.
        """
        agrees = [self._agrees(factors, name, start, end) is True for name in factors.names]
        kinds = {self._is_fix.get(name) for name, agreed in zip(factors.names, agrees, strict=True) if agreed}
        needed = {True} if not self._has_logs else {False} if self._alone(end) else {True, False}
        return np.array(agrees, dtype=bool) if kinds >= needed else None
