"""Solution separation: a filter for every instrument that could be wrong, which does without it.

The main filter uses all instruments, sub-filter i all but instrument i. If instrument i is wrong, sub-filter i is right
and the main filter is not: they separate. Both use the same measurements but for those of i, so that for filters with
the right model the separation d has the covariance

    cov(d) = P_i - P_0                                              (R. G. Brown and P. W. McBurney 1988)

which gives the threshold of the test, component by component of the position, velocity and heading:
``T_i = K_fa sqrt(P_i - P_0)``. A filter without a compass may not know its heading well. A heading error of ``K_fa``
sigmas changes a velocity v by ``v (K_fa sigma)^2 / 2`` at second order, which is in no covariance. So this is added to
the threshold of the horizontal velocity.

Where a test fails, an instrument is excluded: of those with a large separation, the one whose sub-filter is in the best
agreement with the instruments that it uses (the least mean NIS of its worst instrument over `_RECENT` seconds; residual
monitoring after Young and McGraw). Where several agree alike (within `_TIED`, or with a mean NIS of up to
`_AGREEMENT`), it is one on probation (see below), else a fix, since without the log a vessel is lost sooner, else that
of the largest separation. Its sub-filter becomes the main one, so that what the fault has done so far is undone, too.

Where a fix is excluded, the sub-filter without the log is kept beside, and the other way round: the hypothesis that was
not chosen. If the instrument that was believed fails a test in its turn, and the one excluded agrees with all others in
that filter, the two change places. On a vessel without an IMU the compass is among them, and nothing is excluded that
cannot be spared: a fix, or a log and a compass, must be left. Its fixes are out for `_DEAD_RECKONING` seconds at most,
and the separation of the filter without a compass counts less, because its turns are known by the compass alone.

A datasheet may be wrong. Whatever is said here of a NIS is said of its ratio to the mean of the last ``horizon``
seconds, where this is above 1.

With an IMU, the start may be wrong, too: for the first `_ALIGNMENT` seconds one more filter runs, with all
measurements and with `_WRONG_START` times the sigmas that were told for the start. Where a test fails in this time, and
this filter agrees with all instruments and is apart from the main one, it takes its place, since a fault rarely begins
with the run. Until it agrees with all instruments, nothing is excluded.

Filters that know the heading to no better than `_KNOWN_HEADING` differ by their linearisation. So a sub-filter that
knows no more is not compared, and begins anew. While the main filter knows no more, and for `_ALIGNMENT` seconds of a
run that begins so, nothing is tested, and all begin anew from the main filter; there also as long as the main filter
disagrees with an instrument, for ``horizon`` seconds at most.

Single gross errors are none of this: a measurement that the main filter finds improbable (`_NOT_GROSS`) is left out of
all filters, unless its instrument goes on so for `_PATIENCE` seconds.

An excluded instrument is tried on: when it has agreed with the main filter for ``recovery`` seconds it is used again;
twice as long after every further exclusion, up to `_LONGEST` times. For the next ``horizon`` seconds it is on
probation: if any test fails, it is suspected, too. Fixes and logs are out together for `_COASTING` seconds at most,
since an IMU alone is soon worse than either: then the logs are used again or, where they are silent, the fixes.

**Protection level.** For the north and the east component, with the sigmas of main and sub-filters, ::

    PL = max(K_0 sigma_0, max_i (T_i + K_i sigma_i))

bounds the error whatever single instrument is wrong, but for a risk that is shared out evenly between the hypotheses
"none" and "instrument i", the latter weighed by the prior probability of a fault (the closed form of Blanch et al.
2015). The horizontal protection level is the root of the sum of the two squared. It is the diagnostic
``protection_level`` [m].

**Horizon.** A sub-filter without GNSS grows less certain for ever, until it tests nothing. Sub-filters are therefore
started anew from the main filter: there are two for each instrument, the elder ``horizon / 2`` to ``horizon`` seconds
old. So a fault that grows more slowly than the dead reckoning of that time is followed, and the protection level covers
faults that began after the elder sub-filters. After an exclusion all of them are new.

Sources: R. G. Brown and P. W. McBurney, *Self-contained GPS integrity check using maximum solution separation*,
Navigation 35(1), 1988; M. Brenner, *Integrated GPS/inertial fault detection availability*, Navigation 43(2), 1996;
R. S. Y. Young and G. A. McGraw, *Fault detection and exclusion using normalized solution separation and residual
monitoring methods*, Navigation 50(3), 2003; J. Blanch, T. Walter, P. Enge et al., *Baseline advanced RAIM user
algorithm and possible improvements*, IEEE Trans. Aerospace and Electronic Systems 51(1), 2015.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from math import exp, hypot, radians, sqrt
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.noise import normalised_square
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.composition import Solver
from simnav.estimators.models.roles import fixes_and_logs
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.solvers.iterated import Iteration
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.state_difference import difference
from simnav.types import KINDS, Array, Estimate, InitialState, Instruments, Measurements

__all__ = ["SolutionSeparation"]

#: Components whose separation is tested: position, velocity, heading.
_TESTED = (0, 1, 2, 3, 4, 5, 8)
#: Part of the main filter's sigma that a separation may have by linearisation alone.
_LINEARISATION = 0.1
#: Memory of the mean NIS of an instrument in a filter [s].
_RECENT = 10.0
#: A mean NIS by component up to this is no disagreement: two sigma above 1 for ten measurements of one component.
_AGREEMENT = 1.6
#: Disagreements within this ratio are the same.
_TIED = 1.3
#: A NIS by component counts in the long-term mean as no more than this multiple of it.
_UNUSUAL = 10.0
#: Time for which the datasheet counts in it [s].
_PRIOR = 20.0
#: Where a test fails, an instrument is suspected if its separation is more than this part of the largest, each over
#: its threshold. Were there two sources only, both would be the same.
_SUSPECT = 0.3
#: Most that ``recovery`` is multiplied by.
_LONGEST = 16
#: Without an IMU the turns of a vessel are known by its compass only, and they are not the random process of the model.
#: So the separation of the filter without a compass counts this much less.
_TURNING = 3.0
#: Longest time without fixes and logs by exclusion [s].
_COASTING = 60.0
#: Longest time for which log and compass alone are followed by exclusion of the fixes, without an IMU [s].
_DEAD_RECKONING = 180.0
#: An instrument that has said nothing for so long, or for three periods, is silent [s].
_SILENCE = 5.0
#: By these factors the sigmas of the start are larger in the filter that does not believe it: position and attitude,
#: velocity. With a velocity that is as uncertain as the heading, the measurements of a log make a filter surer of its
#: heading than it is.
_WRONG_START, _WRONG_VELOCITY = 30.0, 3.0
#: Its attitude is known at least so well, for otherwise a filter is not linear [rad].
_TILT, _HEADING = radians(5.0), radians(45.0)
#: It iterates its measurements while its heading is known worse than this [deg], and runs for this time [s].
_ITERATED_DEG, _ALIGNMENT = 1.0, 60.0
#: Standard deviation of the heading from which on filters are compared [rad].
_KNOWN_HEADING = radians(5.0)
#: Name of the start among the suspects.
_START = "initial state"
#: A measurement less probable than this is a gross error, unless its instrument goes on so for `_PATIENCE` seconds.
_NOT_GROSS, _PATIENCE = 0.99999, 5.0
#: Of a good measurement to agree with the main filter.
_AGREES = 0.999


class _Exclusion(Adaptation):
    """Leaves the excluded instruments and single gross errors out; notes since when an excluded one has agreed."""

    def __init__(self) -> None:
        self.excluded: set[str] = set()
        self.agrees_since: dict[str, float] = {}
        self.gross: set[tuple[str, float]] = set()
        self.usual: dict[str, float] = {}
        self.linear = True  # False while the heading is not known: an improbable measurement is no gross error then
        self._failing: dict[str, float] = {}
        self._agrees, self._gross = chi_square_limits(_AGREES), chi_square_limits(_NOT_GROSS)

    def adapt(self, innovation: Innovation) -> Array | None:
        """The nominal noise, or None."""
        name, time = innovation.measurement.instrument, innovation.measurement.time
        nis = normalised_square(innovation.residual, innovation.predicted, innovation.noise)
        nis /= max(self.usual.get(name, 1.0), 1.0)
        m = len(innovation.residual)
        if name in self.excluded:
            if nis <= self._agrees[m]:
                self.agrees_since.setdefault(name, time)
            else:
                self.agrees_since.pop(name, None)
            return None
        if nis <= self._gross[m] or not self.linear:
            self._failing.pop(name, None)
        elif time - self._failing.setdefault(name, time) < _PATIENCE:
            self.gross.add((name, time))
            return None
        return innovation.noise


class _Watched(KalmanEstimator):
    """The filter, with the fading mean of the NIS by component of each instrument."""

    mean_nis: dict[str, float]

    def take_over(self, other: _Watched) -> None:
        """Go on from the state of another one."""
        self.model.take_over(other.model)
        self.covariance[...] = other.covariance
        self.mean_nis = dict(other.mean_nis)

    def watch(self, estimate: Estimate, components: Mapping[str, int], fading: float) -> None:
        """Take a step into the means; components by instrument."""
        for name, m in components.items():
            nis = float(estimate.diagnostics.get(f"nis.{name}", np.nan))
            if nis == nis:
                self.mean_nis[name] = fading * self.mean_nis.get(name, 1.0) + (1.0 - fading) * nis / m


@dataclass
class _Without:
    """A sub-filter: the instrument (or start) that it does without, when it started, and its estimate."""

    name: str
    filter: _Watched
    start: float
    estimate: Estimate | None = None


def _doubted(start: InitialState) -> InitialState:
    """The same start with larger sigmas."""
    told = np.sqrt(np.diag(start.covariance))
    larger = told * np.repeat((_WRONG_START, _WRONG_VELOCITY, _WRONG_START), 3)
    larger[6:] = np.minimum(larger[6:], np.maximum((_TILT, _TILT, _HEADING), told[6:]))
    factor = np.divide(larger, told, out=np.ones(9), where=told > 0.0)
    return replace(start, covariance=start.covariance * np.outer(factor, factor))


class SolutionSeparation(Solver):
    """The solver of the module.

    Diagnostics: ``protection_level`` [m]; ``separation.<instrument>``, the largest separation over its threshold;
    ``excluded.<instrument>``, 1 where it is excluded; ``separation.initial state`` for the start.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        The model of each filter.
    false_alarm : float
        Probability of each test to fail where nothing is wrong, in (0, 1).
    horizon : float
        Age at which a sub-filter is started anew [s].
    horizon_without_imu : float
        The same for a vessel without an IMU, whose dead reckoning is soon worse than any fix [s].
    recovery : float
        Time for which an excluded instrument must agree before it is used again [s].
    risk : float
        Probability that the horizontal error exceeds the protection level. IMO A.915(22) allows 1e-5 in three hours.
    fault_probability : float
        Prior probability that a certain instrument is wrong.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    refuses: ClassVar[Mapping[str, str]] = {
        "adaptation": "the covariance of the separation holds for filters that believe the same noise",
        "smoother": "an exclusion changes the filter",
    }

    def __init__(
        self,
        model: ModelChoice,
        false_alarm: float = 1e-6,
        horizon: float = 300.0,
        horizon_without_imu: float = 60.0,
        recovery: float = 30.0,
        risk: float = 1e-5,
        fault_probability: float = 1e-2,
    ):
        for name, p in (("false_alarm", false_alarm), ("risk", risk), ("fault_probability", fault_probability)):
            if not 0.0 < p < 1.0:
                raise ValueError(f"{name} = {p:g}: it must lie between 0 and 1")
        for name, seconds in (("horizon", horizon), ("horizon_without_imu", horizon_without_imu)):
            if not seconds > 0.0:
                raise ValueError(f"{name} = {seconds:g} s: it must be above 0")
        if not recovery >= 0.0:
            raise ValueError(f"recovery = {recovery:g} s: it must not be negative")
        self._choice = model
        self.false_alarm, self.recovery = false_alarm, recovery
        self.horizon, self.horizon_without_imu = horizon, horizon_without_imu
        self.risk, self.fault_probability = risk, fault_probability

    def _filter(self, exclusion: _Exclusion | None = None, start: InitialState | None = None) -> _Watched:
        one = _Watched(copy.deepcopy(self._choice), exclusion, None if start is None else Iteration(_ITERATED_DEG))
        one.row, one.mean_nis = self.label, {}
        told, instruments = self._begin_with
        one.reset(start or told, instruments)
        return one

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        from scipy.stats import norm

        self._begin_with = start, instruments
        self._inertial = instruments.imu is not None
        self._horizon = self.horizon if self._inertial else self.horizon_without_imu
        self._exclusion = _Exclusion()
        self._main = self._filter(self._exclusion)
        self._names = [name for name, sheet in instruments.items() if self._main.model.observes(sheet)]
        self._components = {name: len(KINDS[instruments[name].kind].errors) for name in self._names}
        self._pairs = {name: [_Without(name, self._filter(), start.time) for _ in range(2)] for name in self._names}
        for _, younger in self._pairs.values():
            younger.start = start.time - 0.5 * self._horizon  # so that the two come of age in turns
        tests = max(len(self._names), 1) * len(_TESTED)
        hypotheses = len(self._names) + 1
        self._threshold = float(norm.isf(0.5 * self.false_alarm / tests))
        self._quiet = float(norm.isf(0.25 * self.risk / hypotheses))
        share = self.risk / (2.0 * hypotheses * self.fault_probability)
        self._missed = float(norm.isf(min(share, 0.5)))
        self._group = fixes_and_logs(instruments)
        self._coasting: float | None = None
        self._settled = start.time
        self._heard = dict.fromkeys(self._names, start.time)
        self._silence = {name: max(_SILENCE, 3.0 / instruments[name].rate) for name in self._names}
        self._readmitted: dict[str, float] = {}
        self._count = dict.fromkeys(self._names, 0)
        self._alternatives: dict[str, _Without] = {}
        self._time = start.time
        told = np.sqrt(np.diag(start.covariance))
        self._unbelieving: _Without | None = None
        if self._inertial and told[8] <= _KNOWN_HEADING:
            self._unbelieving = _Without(_START, self._filter(start=_doubted(start)), start.time)
        self._searching = self._inertial and self._unbelieving is None
        if self._searching:  # a filter that finds its heading may think too early that it has
            self._settled = start.time + _ALIGNMENT

    @property
    def model(self) -> object:
        """Of the main filter."""
        return self._main.model

    @property
    def covariance(self) -> Array:
        """(n, n) covariance of the main filter."""
        return self._main.covariance

    @property
    def excluded(self) -> frozenset[str]:
        """The instruments that are excluded now."""
        return frozenset(self._exclusion.excluded)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        out, gross = self._exclusion.excluded, self._exclusion.gross
        gross.clear()
        self._exclusion.linear = measurements.time >= self._settled
        estimate = self._main.update(measurements)
        fading = exp(-max(measurements.time - self._time, 0.0) / _RECENT)
        self._main.watch(estimate, self._components, fading)
        since = measurements.time - self._begin_with[0].time
        slow = min((measurements.time - self._time) / min(self._horizon, since + _PRIOR), 1.0)
        for name in self._names:
            nis = float(estimate.diagnostics.get(f"nis.{name}", np.nan)) / self._components[name]
            if nis == nis and self._exclusion.linear:
                before = self._exclusion.usual.get(name, 1.0)
                self._exclusion.usual[name] = before + slow * (min(nis, _UNUSUAL * before) - before)
        self._time = measurements.time
        self._heard.update({m.instrument: m.time for m in measurements.aids if m.instrument in self._heard})
        running = [(sub, {sub.name, *out}) for name in self._names if name not in out for sub in self._pairs[name]]
        running += [(sub, {sub.name}) for sub in self._alternatives.values()]
        for sub, without in running:
            left = [m for m in measurements.aids if m.instrument not in without and (m.instrument, m.time) not in gross]
            packet = Measurements(measurements.start, measurements.time, measurements.imu, left)
            sub.estimate = sub.filter.update(packet)
            sub.filter.watch(sub.estimate, self._components, fading)
        flagged = list(estimate.flagged)
        ratios = {name: self._separation(name, estimate) for name in self._names if name not in out}
        most = max(ratios.values(), default=0.0)  # the start is blamed only where instruments contradict each other
        ratios |= self._doubt_of_the_start(measurements, estimate, fading)
        aligning = self._unbelieving is not None and _START not in ratios
        lost = self._searching and since < self._horizon and self._disagreement(self._main) > _AGREEMENT
        if lost or not self._linear(estimate):
            self._settled = max(self._settled, measurements.time + _RECENT)
        diagnostics = dict(estimate.diagnostics)
        if most > 1.0 and measurements.time >= self._settled and not aligning:
            faulty = self._most_probable([name for name, ratio in ratios.items() if ratio > _SUSPECT * most], ratios)
            if faulty is not None:
                estimate = self._exclude(faulty)
                flagged += [(faulty, m.time) for m in measurements.aids if m.instrument == faulty]
        self._readmit(measurements.time)
        self._renew(measurements.time)
        diagnostics["protection_level"] = self._protection_level(estimate)
        for name in self._names:
            diagnostics[f"separation.{name}"] = ratios.get(name, np.nan)
            diagnostics[f"excluded.{name}"] = float(name in self._exclusion.excluded)
        diagnostics[f"separation.{_START}"] = ratios.get(_START, np.nan)
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        return estimate

    def _doubt_of_the_start(self, measurements: Measurements, estimate: Estimate, fading: float) -> dict[str, float]:
        """The separation of the filter that does not believe the start, if it agrees with all instruments."""
        sub = self._unbelieving
        if sub is None:
            return {}
        sub.estimate = sub.filter.update(measurements)
        sub.filter.watch(sub.estimate, self._components, fading)
        if measurements.time - sub.start >= _ALIGNMENT:
            self._unbelieving = None
        return {_START: self._apart([sub], estimate)} if self._disagreement(sub.filter) <= _AGREEMENT else {}

    def _disagreement(self, one: _Watched, out: Collection[str] = ()) -> float:
        """The largest mean NIS of an instrument that a filter uses, over what is usual for it."""
        usual = self._exclusion.usual
        return max((v / max(usual.get(n, 1.0), 1.0) for n, v in one.mean_nis.items() if n not in out), default=1.0)

    def _most_probable(self, suspects: list[str], ratios: Mapping[str, float]) -> str | None:
        """Of the suspects and the instruments on probation, the one to exclude; None where none can be spared."""
        probation = {
            name for name, since in self._readmitted.items() if self._time - since < self._horizon and name in ratios
        }
        out = self._exclusion.excluded
        if _START in suspects:
            return _START
        spared = [name for name in {*suspects, *probation} if self._can_spare(name)]
        if not spared:
            return None
        apart = {name: self._disagreement(self._elder(name).filter, {name, *out}) for name in spared}
        least = max(min(apart.values()), _AGREEMENT)
        tied = [name for name in self._names if apart.get(name, np.inf) <= _TIED * least]
        return min(tied, key=lambda n: (n not in probation, not self._group.get(n, False), -ratios[n]))

    def _can_spare(self, name: str) -> bool:
        """Whether what is left without an instrument gives a position: always with an IMU, for a while."""
        if self._inertial:
            return True
        out = {name} if self._mistaken(name) else {name, *self._exclusion.excluded}
        left = [n for n in self._names if n not in out and self._time - self._heard[n] <= self._silence[n]]
        roles = {self._group.get(n) for n in left}  # None: a compass
        return True in roles or {False, None} <= roles

    def _mistaken(self, name: str) -> bool:
        """Whether it was this instrument that should have been excluded, and not the one that was."""
        before = self._alternatives.get(name)
        return before is not None and self._disagreement(before.filter, {before.name}) <= _AGREEMENT

    def _elder(self, name: str) -> _Without:
        return min(self._pairs[name], key=lambda sub: sub.start)

    def _linear(self, estimate: Estimate | None) -> bool:
        """Whether a filter knows its heading well enough to be compared; one without an IMU has a compass for that."""
        if not self._inertial or estimate is None or estimate.covariance is None:
            return True
        return float(estimate.covariance[8, 8]) <= _KNOWN_HEADING**2

    def _sigmas(self, sub: _Without, estimate: Estimate) -> tuple[Array, Array]:
        """Variances of a sub-filter's nine components, and of its separation."""
        assert sub.estimate is not None
        assert sub.estimate.covariance is not None
        assert estimate.covariance is not None
        main = estimate.covariance.diagonal()
        own = sub.estimate.covariance.diagonal()
        apart = np.maximum(own - main, 0.0) + _LINEARISATION**2 * main
        if estimate.velocity is not None:  # a heading error as large as its test allows, at second order
            apart[3:5] += (0.5 * self._threshold * own[8] * estimate.velocity[:2]) ** 2
        return own, apart

    def _separation(self, name: str, estimate: Estimate) -> float:
        """The largest separation over its threshold, of both sub-filters without an instrument."""
        largest = self._apart(self._pairs[name], estimate)
        return largest if self._inertial or name in self._group else largest / _TURNING

    def _apart(self, subs: Iterable[_Without], estimate: Estimate) -> float:
        """The largest separation over its threshold, of all tested components."""
        mask, largest = estimate.mask(), 0.0
        for sub in subs:
            assert sub.estimate is not None
            if not self._linear(sub.estimate):
                continue
            apart = difference(sub.estimate, estimate).tolist()
            _, variance = self._sigmas(sub, estimate)
            for q in _TESTED:
                if mask[q] and variance[q] > 0.0:
                    largest = max(largest, abs(apart[q]) / (self._threshold * sqrt(variance[q])))
        return largest

    def _exclude(self, name: str) -> Estimate:
        """Take the sub-filter without an instrument for the main filter; all others begin anew from it."""
        if name == _START:
            return self._start_again()
        excluded, before = self._exclusion.excluded, self._alternatives.get(name)
        chosen = self._elder(name)
        if before is not None and self._mistaken(name):
            chosen = before
            excluded.clear()
        elif not excluded:
            others = self._group if self._inertial else self._names
            self._alternatives = {n: self._elder(n) for n in others if n != name and name in others}
            for n, sub in self._alternatives.items():
                self._pairs[n] = [other for other in self._pairs[n] if other is not sub]
                self._pairs[n].append(_Without(n, self._filter(), self._time))
        if excluded or chosen is before:
            self._alternatives = {}
        assert chosen.estimate is not None
        self._count[name] += 1
        self._exclusion.agrees_since.pop(name, None)
        excluded.add(name)
        return self._go_on_from(chosen)

    def _start_again(self) -> Estimate:
        """Take the filter that does not believe the start for the main one, with all instruments."""
        assert self._unbelieving is not None
        chosen, self._unbelieving, self._alternatives = self._unbelieving, None, {}
        self._exclusion.excluded.clear()
        self._exclusion.agrees_since.clear()
        self._exclusion.usual.clear()
        return self._go_on_from(chosen)

    def _go_on_from(self, chosen: _Without) -> Estimate:
        """Take a sub-filter for the main one; all others begin anew from it."""
        assert chosen.estimate is not None
        self._main.take_over(chosen.filter)
        for name in self._names:
            for k, sub in enumerate(self._pairs[name]):
                self._begin(sub, self._time - 0.5 * self._horizon * k, chosen.estimate)
        return copy.copy(chosen.estimate)

    def _readmit(self, time: float) -> None:
        """Use instruments again that have agreed for long enough."""
        excluded, agrees = self._exclusion.excluded, self._exclusion.agrees_since
        again = [
            name
            for name, since in agrees.items()
            if time - since >= self.recovery * min(2.0 ** (self._count[name] - 1), _LONGEST)
        ]
        heard = [name for name in self._group if time - self._heard[name] <= self._silence[name]]
        fixes, logs = ([n for n in heard if self._group[n] is kind] for kind in (True, False))
        needed, first, longest = (
            (heard, logs or fixes, _COASTING) if self._inertial else (fixes, fixes, _DEAD_RECKONING)
        )
        coasting = bool(needed) and set(needed) <= excluded
        self._coasting = (time if self._coasting is None else self._coasting) if coasting else None
        if self._coasting is not None and time - self._coasting >= longest:
            again += [n for n in first if n not in again]
            if not self._inertial:  # the filters go to the fixes; until then they differ for that alone
                self._settled = time + _RECENT
        if again:
            self._alternatives = {}
        for name in again:
            excluded.discard(name)
            self._readmitted[name] = time
            agrees.pop(name, None)
            for one in (self._main, *(sub.filter for pair in self._pairs.values() for sub in pair)):
                one.mean_nis.pop(name, None)
            for k, sub in enumerate(self._pairs[name]):
                self._begin(sub, time - 0.5 * self._horizon * k, None)

    def _renew(self, time: float) -> None:
        """Begin sub-filters anew that have come of age."""
        for name in self._names:
            for sub in self._pairs[name]:
                old = time - sub.start >= self._horizon or time < self._settled or not self._linear(sub.estimate)
                if old and name not in self._exclusion.excluded:
                    self._begin(sub, time, None)
        self._alternatives = {n: sub for n, sub in self._alternatives.items() if time - sub.start < 2.0 * self._horizon}

    def _begin(self, sub: _Without, time: float, estimate: Estimate | None) -> None:
        """Begin a sub-filter from the main filter's state."""
        sub.filter.take_over(self._main)
        sub.start = time
        sub.estimate = estimate if estimate is not None else self._main.model.estimate(self._main.covariance)

    def _protection_level(self, estimate: Estimate) -> float:
        """The horizontal protection level [m]."""
        assert estimate.covariance is not None
        levels = []
        for q in (0, 1):
            level = self._quiet * sqrt(max(float(estimate.covariance[q, q]), 0.0))
            for name in self._names:
                if name in self._exclusion.excluded:
                    continue
                own, apart = self._sigmas(self._elder(name), estimate)
                level = max(level, self._threshold * sqrt(float(apart[q])) + self._missed * sqrt(float(own[q])))
            levels.append(level)
        return hypot(*levels)
