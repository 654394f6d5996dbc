"""Solution separation: one sub-filter for every instrument that may be wrong, which does not use this instrument.

The main filter uses all instruments, sub-filter i all except instrument i. If instrument i is wrong, sub-filter i is
right and the main filter is wrong. Then their estimates differ by more than `simnav.estimators.solvers.separation`
allows. Each channel of an instrument counts as an instrument here: a spoofed satellite is excluded by itself.

**Exclusion.** If a test fails, one instrument is excluded. The suspects are the instruments with a large separation,
and those whose innovations in the main filter have been improbable for longer than a gross error lasts. The choice is
the suspect whose sub-filter agrees best with its instruments: the smallest mean NIS (normalised innovation squared) of
its worst instrument over `_RECENT` seconds (residual monitoring after Young and McGraw). Several sub-filters may agree
equally well (within `_TIED`, or with a mean NIS up to `_AGREEMENT`). Then the order is: an instrument on probation (see
below); an instrument before the IMU; a fix before a log, because dead reckoning without a log is worse; the largest
separation. The chosen sub-filter becomes the main filter, which also removes the effect of the fault before its
detection.

With an IMU and without one, different rules say which instrument may be excluded
(`simnav.estimators.solvers.exclusion_rules`). If an instrument is not excluded because the position without it is not
accurate enough, or because it is the last one (see below), no other instrument is excluded instead.

**IMU.** The IMU may also be wrong: disturbed, or with larger errors than its datasheet says. One more filter uses all
measurements with a much larger IMU noise (`disturbed_imu`). If there are a fix and a log, the IMU is excluded (this
filter becomes the main filter) if a test fails, the filter agrees with all instruments, and

- no filter without an instrument agrees equally well; or
- an instrument was excluded before, so that one fault explains two; or
- the filter was restarted, with all instruments and an inflated covariance of the motion, between `_RECENT` and
  `COASTING` seconds ago. It is restarted if all fixes and logs are excluded, or if the chosen filter agrees with no
  instrument (`_NOTHING_AGREES`).

Then all instruments are used again. While the IMU is excluded no other instrument is, except for single gross errors,
because a filter without an instrument would be too uncertain. A filter with the IMU of the datasheet runs in parallel.
When it has agreed with all instruments for ``recovery`` seconds (longer after every further exclusion), the IMU is used
again.

The last fix or log that delivers has the IMU alone against it. A filter that expects a disturbed IMU follows any single
instrument, so that its agreement does not show that the IMU is wrong, but neither does the disagreement of the main
filter show that the instrument is. The error of an instrument is bounded, that of an IMU alone is not. So the last one
is excluded only if it, and not only a compass, disagrees with that filter after `_RECENT` seconds of it, too.

**The alternative.** If a fix is excluded, the sub-filter without the log is kept, and the other way round: it is the
alternative hypothesis. If the log then fails a test, and the excluded fix agrees with all others in that sub-filter,
the two change places. On a vessel without an IMU the compass is one of the alternatives.

**Wrong datasheets.** Every NIS above is divided by its mean over the last ``horizon`` seconds, if this mean is above 1.

**Wrong initial state.** With an IMU, one more filter runs for the first `_ALIGNMENT` seconds. It uses all measurements,
and the initial sigmas times `_WRONG_START`. If a test fails in this time, this filter agrees with all instruments and
differs from the main filter, it becomes the main filter, because a fault rarely begins at the start of a run. Until it
agrees with all instruments, nothing is excluded.

**Heading.** In a sub-filter with neither a fix nor a compass, the heading variance is at least that of dead reckoning
(`Hypothesis.turn`). A sub-filter whose heading sigma is above `KNOWN_HEADING` is not compared, and is restarted. While
this is true of the main filter, and for the first `_ALIGNMENT` seconds of a run that begins so, nothing is tested, and
all sub-filters are restarted from the main filter. After such a beginning this continues while the main filter
disagrees with an instrument, for ``horizon`` seconds at most.

**Gross errors.** A single measurement that is improbable in the main filter (`_NOT_GROSS`) is rejected by all filters,
unless the measurements of its instrument stay improbable for `_PATIENCE` seconds. A fix that no other fix or log is
heard beside has the IMU alone against it. It is rejected only if it is single: not if the one before is longer ago than
three periods or `_PATIENCE`, or was improbable in about the same direction (`Exclusion.alone`).

**Readmission.** When an excluded instrument has agreed with the main filter for ``recovery`` seconds, it is used again.
The time is doubled after every further exclusion, up to a factor of `_LONGEST`. For the next ``horizon`` seconds it is
on probation: if any test fails, it is a suspect. Fixes and logs are excluded together for `COASTING` seconds at most,
because an IMU alone soon has larger errors, and no longer than until the position is more uncertain than the separation
was at the exclusion. Then the logs are used again or, if they deliver nothing, the fixes.
Without an IMU the fixes are excluded for `DEAD_RECKONING` seconds at most. For `_RECENT` seconds after that nothing is
tested, because the filters differ only by the correction towards these measurements.

**Protection level.** For the north and the east component, with the sigmas of main and sub-filters, ::

    PL = max(K_0 sigma_0, max_i (T_i + K_i sigma_i))

bounds the error if no instrument or any single instrument (except the IMU) is wrong. The sigmas are those of the main
filter (0) and of sub-filter i, T_i is the threshold of the test, and the K are quantiles of the normal distribution.
The risk of exceeding the level is divided equally between the hypotheses "none" and "instrument i"; the latter is
weighted by the prior probability of a fault (the closed form of Blanch et al. 2015). The horizontal protection level is
the root of the sum of squares of both components. It is the diagnostic ``protection_level`` [m].

**Horizon.** The uncertainty of a sub-filter without GNSS grows without limit, so that in the end it detects nothing.
Sub-filters are therefore restarted from the main filter. There are two for each instrument; the older one is
``horizon / 2`` to ``horizon`` seconds old. So a fault that grows more slowly than the error of dead reckoning in that
time is not detected, and the protection level covers faults that began after the start of the older sub-filters. After
an exclusion all sub-filters are restarted.

Sources: R. G. Brown and P. W. McBurney, *Self-contained GPS integrity check using maximum solution separation*,
Navigation 35(1), 1988; M. Brenner, *Integrated GPS/inertial fault detection availability*, Navigation 43(2), 1996;
R. S. Y. Young and G. A. McGraw, *Fault detection and exclusion using normalized solution separation and residual
monitoring methods*, Navigation 50(3), 2003; J. Blanch, T. Walter, P. Enge et al., *Baseline advanced RAIM user
algorithm and possible improvements*, IEEE Trans. Aerospace and Electronic Systems 51(1), 2015.
"""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from math import exp, hypot, sqrt
from typing import ClassVar

import numpy as np

from simnav.estimators.composition import Solver
from simnav.estimators.models.channels import owners, reading_of, summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.inertial_errors import ERROR
from simnav.estimators.models.roles import fixes_and_logs
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import KINDS, Array, Estimate, InitialState, Instruments, Measurements

from .exclusion_rules import COASTING, ExclusionRules, RulesWithoutImu
from .hypotheses import Exclusion, Hypothesis, ImuHypothesis, WatchedFilter, disturbed_imu, uncertain_start
from .iterated import Iteration
from .kalman import KalmanEstimator
from .separation import KNOWN_HEADING, SeparationTest
from .state_difference import difference

__all__ = ["SolutionSeparation"]

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
#: An instrument that has said nothing for so long, or for three periods, is silent [s].
_SILENCE = 5.0
#: The filter that does not believe the start iterates its measurements while its heading is known worse than this
#: [deg], and runs for this time [s].
_ITERATED_DEG, _ALIGNMENT = 1.0, 60.0
#: Where the filter that is chosen has a mean NIS above this, more is wrong than one instrument: perhaps the IMU.
_NOTHING_AGREES = 2.5
#: Names of the start and of the IMU among the suspects.
_START, _IMU = "initial state", "imu"


class SolutionSeparation(Solver):
    """The solver of the module.

    Diagnostics: ``protection_level`` [m]; ``separation.<instrument>``, the largest separation over its threshold;
    ``excluded.<instrument>``, 1 where it is excluded. The IMU is ``imu`` there, and the start ``initial state``.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        The model of each filter.
    false_alarm : float
        Probability that a test fails without a fault, in (0, 1).
    horizon : float
        Age at which a sub-filter is restarted [s].
    horizon_without_imu : float
        Age at which a sub-filter of a vessel without an IMU is restarted, because its dead reckoning is less accurate
        [s].
    recovery : float
        Time for which an excluded instrument must agree before it is used again [s].
    risk : float
        Probability that the horizontal error exceeds the protection level. IMO A.915(22) allows 1e-5 in three hours.
    fault_probability : float
        Prior probability that an instrument is wrong.
    """

    sets_aside: ClassVar[bool] = True
    pieces: ClassVar[tuple[str, ...]] = ("model",)
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "iteration": "the covariance of the separation holds for filters that linearise a measurement once",
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
        self._model_choice, self.false_alarm, self.recovery = model, false_alarm, recovery
        self.horizon, self.horizon_without_imu = horizon, horizon_without_imu
        self.risk, self.fault_probability = risk, fault_probability

    def _filter(
        self, exclusion: Exclusion | None = None, start: InitialState | None = None, disturbed: bool = False
    ) -> WatchedFilter:
        iteration = None if start is None else Iteration(_ITERATED_DEG)
        one = WatchedFilter(copy.deepcopy(self._model_choice), exclusion, iteration)
        one.row, one.mean_nis = self.label, {}
        stated, instruments = self._begin_with
        one.reset(start or stated, disturbed_imu(instruments) if disturbed else instruments)
        return one

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        from scipy.special import ndtri  # to import scipy.stats takes 0.8 s

        instruments = by_source(instruments, self._model_choice, self.label)
        self._begin_with = start, instruments
        self._inertial = instruments.imu is not None
        self._horizon = self.horizon if self._inertial else self.horizon_without_imu
        self._exclusion, self._owners = Exclusion(), owners(instruments)
        self._main = self._filter(self._exclusion)
        self._names = [name for name, sheet in instruments.items() if self._main.model.observes(sheet)]
        self._components = {name: len(KINDS[instruments[name].kind].errors) for name in self._names}
        begun = self._filter()  # to copy it takes a fifth of the time
        self._pairs = {n: [Hypothesis(n, copy.deepcopy(begun), start.time) for _ in range(2)] for n in self._names}
        hypotheses = len(self._names) + 1
        self._test = SeparationTest(self.false_alarm, len(self._names), self._inertial)
        self._quiet = -float(ndtri(0.25 * self.risk / hypotheses))
        share = self.risk / (2.0 * hypotheses * self.fault_probability)
        self._missed = -float(ndtri(min(share, 0.5)))
        self._group = {n: fix for n, fix in fixes_and_logs(instruments).items() if n in self._names}
        self._rules = (ExclusionRules if self._inertial else RulesWithoutImu)(self._group)
        blind = {n for n in self._names if instruments[n].role in ("velocity", "depth") and not self._group.get(n)}
        self._heading_sources = set(self._names) - blind
        self._gyroscope_noise = instruments.imu.gyroscope.random_walk**2 if instruments.imu is not None else 0.0
        for pair in self._pairs.values():
            for sub, begin in zip(pair, (start.time, start.time - 0.5 * self._horizon), strict=True):
                self._begin(sub, begin, None)
        self._coasting: float | None = None
        self._apart: dict[str, float] = {}
        self._settled = start.time
        self._last_delivery = dict.fromkeys(self._names, start.time)
        self._silence = {name: max(_SILENCE, 3.0 / instruments[name].rate) for name in self._names}
        self._news = {name: 3.0 / instruments[name].rate for name in self._names}
        self._readmitted: dict[str, float] = {}
        self._count = dict.fromkeys(self._names, 0)
        self._alternatives: dict[str, Hypothesis] = {}
        self._time = start.time
        sigma = np.sqrt(np.diag(start.covariance))
        self._wrong_start: Hypothesis | None = None
        if self._inertial and sigma[ERROR.heading] <= KNOWN_HEADING:
            self._wrong_start = Hypothesis(_START, self._filter(start=uncertain_start(start)), start.time)
        self._disturbed = False
        self._imu = self._other_opinion_of_the_imu() if self._inertial and self._group else None
        self._witnesses = len(set(self._group.values())) > 1
        self._trial = -np.inf
        self._searching = self._inertial and self._wrong_start is None
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
        """The instruments that are excluded now; the IMU is among them while it is disturbed."""
        return frozenset(self._exclusion.excluded | ({_IMU} if self._disturbed else set()))

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        if self._owners:
            measurements = replace(measurements, aids=[reading_of(m) for m in measurements.aids])
        out, gross = self._exclusion.excluded, self._exclusion.gross
        gross.clear()
        self._exclusion.linear = self._disturbed or measurements.time >= self._settled
        delivered = {m.instrument: m.time for m in measurements.aids}
        heard = self._group.keys() & {*self._delivering(self._group), *delivered} - out
        self._exclusion.alone = {n: self._news[n] for n in heard if len(heard) == 1 and self._group[n]}
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
        self._last_delivery |= {name: time for name, time in delivered.items() if name in self._last_delivery}
        running = [(sub, {sub.name, *out}) for name in self._names if name not in out for sub in self._pairs[name]]
        running += [(sub, {sub.name}) for sub in self._alternatives.values()]
        for sub, without in running:
            left = [m for m in measurements.aids if m.instrument not in without and (m.instrument, m.time) not in gross]
            packet = Measurements(measurements.start, measurements.time, measurements.imu, left)
            sub.estimate = sub.filter.update(packet)
            sub.filter.watch(sub.estimate, self._components, fading)
            if self._inertial and self._heading_sources <= without:
                sub.turn(self._gyroscope_noise)
        flagged = list(estimate.flagged)
        pairs = {name: pair for name, pair in self._pairs.items() if name not in out}
        ratios = {name: self._rules.counted(name, x) for name, x in self._test.largest(pairs, estimate).items()}
        most = max(ratios.values(), default=0.0)  # the start is blamed only where instruments contradict each other
        ratios |= self._test_of_the_start(measurements, estimate, fading)
        ratios |= self._test_of_the_imu(measurements, estimate, fading)
        aligning = self._wrong_start is not None and _START not in ratios
        lost = self._searching and since < self._horizon and self._disagreement(self._main) > _AGREEMENT
        if lost or self._disturbed or not self._test.applies(estimate):
            self._settled = max(self._settled, measurements.time + _RECENT)
        diagnostics = dict(estimate.diagnostics)
        faulty = None
        if self._imu_is_the_fault(ratios):
            faulty = _IMU
        elif most > 1.0 and measurements.time >= self._settled and not aligning:
            suspects = [name for name, ratio in ratios.items() if ratio > _SUSPECT * most]
            faulty = self._most_probable(suspects, ratios, estimate)
        if faulty is not None:
            estimate = self._exclude(faulty)
            flagged += [(faulty, m.time) for m in measurements.aids if m.instrument == faulty]
        estimate = self._readmit_the_imu() or estimate
        self._readmit(measurements.time)
        self._renew(measurements.time)
        diagnostics["protection_level"] = self._protection_level(estimate)
        for name in self._names:
            diagnostics[f"separation.{name}"] = ratios.get(name, np.nan)
            diagnostics[f"excluded.{name}"] = float(name in self._exclusion.excluded)
        for name in (_START, _IMU):
            diagnostics[f"separation.{name}"] = ratios.get(name, np.nan)
        diagnostics[f"excluded.{_IMU}"] = float(self._disturbed)
        if self._owners:
            diagnostics.update(summary(diagnostics, self._owners))
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        return estimate

    def _test_of_the_start(self, measurements: Measurements, estimate: Estimate, fading: float) -> dict[str, float]:
        """The separation of the filter that allows for a wrong start, if it agrees with all instruments."""
        sub = self._wrong_start
        if sub is None:
            return {}
        if measurements.time - sub.start > _ALIGNMENT:
            self._wrong_start = None
            return {}
        sub.estimate = sub.filter.update(measurements)
        sub.filter.watch(sub.estimate, self._components, fading)
        if self._disagreement(sub.filter) > _AGREEMENT:
            return {}
        return self._test.largest({_START: [sub]}, estimate)

    def _other_opinion_of_the_imu(self) -> ImuHypothesis:
        """The filter that does not believe the IMU or, while the main one does not, a filter that does."""
        exclusion = Exclusion()
        return ImuHypothesis(
            _IMU, self._filter(exclusion, disturbed=not self._disturbed), self._time, exclusion=exclusion
        )

    def _test_of_the_imu(self, measurements: Measurements, estimate: Estimate, fading: float) -> dict[str, float]:
        """The separation of the filter that does not believe the IMU, if it agrees with all instruments."""
        imu = self._imu
        if imu is None:
            return {}
        imu.exclusion.gross.clear()
        imu.estimate = imu.filter.update(measurements)
        imu.filter.watch(imu.estimate, self._components, fading)
        if self._disturbed:
            return {}
        out, without = self._exclusion.excluded, imu.exclusion.excluded
        agrees = self._disagreement(imu.filter, without) <= _AGREEMENT
        more_is_wrong = without != out and not (agrees and without <= out) and self._time - self._trial >= COASTING
        if more_is_wrong or not self._test.applies(imu.estimate):
            self._begin_imu(imu, without=out)
        return self._test.largest({_IMU: [imu]}, estimate) if agrees and self._witnesses else {}

    def _begin_imu(self, imu: ImuHypothesis, without: Collection[str]) -> None:
        """Begin the filter of the other opinion anew from the main one, without some instruments."""
        imu.exclusion.excluded = set(without)
        self._begin(imu, self._time, None)

    def _imu_is_the_fault(self, ratios: Mapping[str, float]) -> bool:
        """Whether the filter that does not believe the IMU has brought all instruments together since it was tried."""
        since = self._time - self._trial
        return not self._disturbed and _RECENT <= since < COASTING and ratios.get(_IMU, 0.0) > 1.0

    def _try_without_the_imu(self) -> None:
        """Begin the filter that does not believe the IMU anew, with all instruments; it does not believe the motion."""
        if self._imu is None or self._disturbed or self._time - self._trial < COASTING:
            return
        self._trial = self._time
        self._begin_imu(self._imu, without=())
        self._imu.filter.mean_nis.clear()
        self._imu.filter.inflate_motion()

    def _readmit_the_imu(self) -> Estimate | None:
        """Use the IMU again if a filter that believes it has agreed with all instruments for long enough."""
        imu = self._imu
        if imu is None or not self._disturbed:
            return None
        if self._time - imu.start < self.recovery * min(2.0 ** (self._count[_IMU] - 1), _LONGEST):
            return None
        if self._disagreement(imu.filter, imu.exclusion.excluded) <= _AGREEMENT:
            return self._change_imu(imu)
        self._begin_imu(imu, without=self._exclusion.excluded)
        return None

    def _disagreement(self, one: WatchedFilter, out: Collection[str] = ()) -> float:
        """The largest mean NIS of an instrument that a filter uses, over what is usual for it."""
        usual = self._exclusion.usual
        return max((v / max(usual.get(n, 1.0), 1.0) for n, v in one.mean_nis.items() if n not in out), default=1.0)

    def _most_probable(self, suspects: list[str], ratios: Mapping[str, float], estimate: Estimate) -> str | None:
        """Of the suspects and the instruments on probation, the one to exclude; None where none can be spared."""
        probation = {
            name for name, since in self._readmitted.items() if self._time - since < self._horizon and name in ratios
        }
        out = self._exclusion.excluded
        if _START in suspects:
            return _START
        if self._imu is not None and _IMU in suspects and out and not self._imu.exclusion.excluded:
            return _IMU  # one fault explains what would be two
        contradicting = self._exclusion.contradicting(self._time) & ratios.keys()
        instruments = {*suspects, *probation, *contradicting} - {_IMU}
        spared = [name for name in instruments if self._can_spare(name)]
        apart = {name: self._disagreement(self._older_filter(name).filter, {name, *out}) for name in spared}
        if self._imu is not None and _IMU in suspects:
            apart[_IMU] = self._disagreement(self._imu.filter, self._imu.exclusion.excluded)
        if not apart:
            return None
        least = max(min(apart.values()), _AGREEMENT)
        tied = [name for name in (*self._names, _IMU) if apart.get(name, np.inf) <= _TIED * least]
        found = min(tied, key=lambda n: (n not in probation, n == _IMU, not self._group.get(n, False), -ratios[n]))
        excluded = found == _IMU or (self._pays(found, estimate) and not self._only_against_the_imu(found))
        return found if excluded else None

    def _pays(self, name: str, estimate: Estimate) -> bool:
        """Whether the filter without an instrument knows the position well enough to be believed."""
        without = self._older_filter(name).estimate
        assert without is not None
        carried = set(self._delivering(self._group)) - {name, *self._exclusion.excluded}
        return self._rules.pays(without, estimate, bool(carried))

    def _can_spare(self, name: str) -> bool:
        """Whether what is left without an instrument gives a position."""
        out = {name} if self._mistaken(name) else {name, *self._exclusion.excluded}
        return self._rules.can_spare([n for n in self._delivering(self._names) if n not in out])

    def _only_against_the_imu(self, name: str) -> bool:
        """Whether an instrument is the last fix or log, and a disturbed IMU explains why it disagrees."""
        left = set(self._delivering(self._group)) - {name, *self._exclusion.excluded}
        if self._imu is None or self._disturbed or name not in self._group or left:
            return False
        if self._time - self._imu.start < _RECENT:
            return True  # it has begun from the main filter, whose state may be wrong
        return self._disagreement(self._imu.filter, {*self._names} - {name}) <= _AGREEMENT

    def _delivering(self, names: Iterable[str]) -> list[str]:
        """Those of the instruments that are not silent."""
        return [n for n in names if self._time - self._last_delivery[n] <= self._silence[n]]

    def _mistaken(self, name: str) -> bool:
        """Whether it was this instrument that should have been excluded, and not the one that was."""
        before = self._alternatives.get(name)
        return before is not None and self._disagreement(before.filter, {before.name}) <= _AGREEMENT

    def _older_filter(self, name: str) -> Hypothesis:
        return min(self._pairs[name], key=lambda sub: sub.start)

    def _exclude(self, name: str) -> Estimate:
        """Take the sub-filter without an instrument for the main filter; all others begin anew from it."""
        if name == _START:
            return self._start_again()
        if name == _IMU:
            return self._change_imu(self._imu)
        excluded, before = self._exclusion.excluded, self._alternatives.get(name)
        chosen = self._older_filter(name)
        if before is not None and self._mistaken(name):
            chosen = before
            excluded.clear()
        elif not excluded:
            rivals = self._rules.rivals(self._names)
            self._alternatives = {n: self._older_filter(n) for n in rivals if n != name and name in rivals}
            for n, sub in self._alternatives.items():
                self._pairs[n] = [other for other in self._pairs[n] if other is not sub]
                self._pairs[n].append(Hypothesis(n, self._filter(), self._time))
        if excluded or chosen is before:
            self._alternatives = {}
        assert chosen.estimate is not None
        apart = difference(chosen.estimate, self._main.model.estimate(self._main.covariance))
        self._apart[name] = hypot(float(apart[0]), float(apart[1]))
        self._count[name] += 1
        self._exclusion.agrees_since.pop(name, None)
        excluded.add(name)
        estimate = self._go_on_from(chosen)
        if (
            excluded.issuperset(self._delivering(self._group))
            or self._disagreement(chosen.filter, excluded) > _NOTHING_AGREES
        ):
            self._try_without_the_imu()
        return estimate

    def _change_imu(self, chosen: ImuHypothesis | None) -> Estimate:
        """Take the filter of the other opinion of the IMU for the main one; all others begin anew with that opinion."""
        assert chosen is not None
        self._disturbed = not self._disturbed
        if self._disturbed:
            self._count[_IMU] = self._count.get(_IMU, 0) + 1
            self._exclusion.begin_again(chosen.exclusion.excluded)
        self._alternatives, self._wrong_start = {}, None
        self._main = self._filter(self._exclusion, disturbed=self._disturbed)
        begun = self._filter(disturbed=self._disturbed)
        for pair in self._pairs.values():
            for sub in pair:
                sub.filter = copy.deepcopy(begun)
        estimate = self._go_on_from(chosen)
        self._imu = self._other_opinion_of_the_imu()
        self._begin_imu(self._imu, without=self._exclusion.excluded)
        return estimate

    def _start_again(self) -> Estimate:
        """Make the filter that allows for a wrong start the main one, with all instruments."""
        assert self._wrong_start is not None
        chosen, self._wrong_start, self._alternatives = self._wrong_start, None, {}
        self._exclusion.begin_again()
        return self._go_on_from(chosen)

    def _go_on_from(self, chosen: Hypothesis) -> Estimate:
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
        delivering = self._delivering(self._group)
        fixes, logs = ([n for n in delivering if self._group[n] is kind] for kind in (True, False))
        needed, first, longest = self._rules.lost_without(fixes, logs)
        coasting = bool(needed) and set(needed) <= excluded
        self._coasting = (time if self._coasting is None else self._coasting) if coasting else None
        if self._coasting is not None and (time - self._coasting >= longest or self._worse_than_excluded(first)):
            again += [n for n in first if n not in again]
            self._settled = time + _RECENT  # the filters go to them; until then they differ for that alone
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

    def _worse_than_excluded(self, names: list[str]) -> bool:
        """Whether the position has become more uncertain than it was wrong, by the tests, with these instruments."""
        covariance = self._main.model.estimate(self._main.covariance).covariance
        assert covariance is not None
        sigma = sqrt(float(covariance[0, 0] + covariance[1, 1]))
        return self._inertial and sigma > max((self._apart.get(name, 0.0) for name in names), default=np.inf)

    def _renew(self, time: float) -> None:
        """Begin sub-filters anew that have come of age."""
        for name in self._names:
            for sub in self._pairs[name]:
                old = time - sub.start >= self._horizon or time < self._settled
                old = old or not self._test.applies(sub.estimate)
                if old and name not in self._exclusion.excluded:
                    self._begin(sub, time, None)
        self._alternatives = {n: sub for n, sub in self._alternatives.items() if time - sub.start < 2.0 * self._horizon}

    def _begin(self, sub: Hypothesis, time: float, estimate: Estimate | None) -> None:
        """Begin a sub-filter from the main filter's state."""
        known = estimate if estimate is not None else self._main.model.estimate(self._main.covariance)
        sub.begin(self._main, known, time)

    def _protection_level(self, estimate: Estimate) -> float:
        """The horizontal protection level [m]."""
        assert estimate.covariance is not None
        used = [self._older_filter(name) for name in self._names if name not in self._exclusion.excluded]
        own, apart = self._test.variances(used, estimate) if used else (np.empty((0, 9)), np.empty((0, 9)))
        levels = []
        for q in (0, 1):
            level = self._quiet * sqrt(max(float(estimate.covariance[q, q]), 0.0))
            for one, between in zip(own[:, q].tolist(), apart[:, q].tolist(), strict=True):
                level = max(level, self._test.factor * sqrt(between) + self._missed * sqrt(one))
            levels.append(level)
        return hypot(*levels)
