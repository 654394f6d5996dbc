"""Several hypotheses of what is wrong, each with a filter and a probability.

One hypothesis says that all is well. The others say that the fixes are off, that the log is, the compass or the IMU,
several of them, or that the start or the attitude was wrong. Each is a filter over the same measurements in which the
errors of the doubted instruments are states of another process (`simnav.estimators.models.doubted_instruments`). The
evidence of a hypothesis is the density of the innovations of its filter; its probability is multiplied by it in each
step and normalised. A hypothesis that allows for more predicts less sharply. So where nothing is wrong the one that all
is well has the largest evidence, and where fixes and dead reckoning part, however slowly, the sum over many innovations
decides. The estimate is the mean of all filters, weighted by their probabilities, and its covariance has the spread
between them.

**Anchors.** Every `period` seconds the most probable filter is copied: this is the anchor. A hypothesis is begun from
the anchor, with the measurements since then once more, so that it was not led astray by a fault before its detection.
Its onset is at the first step since the anchor at which the leading filter was surprised, otherwise at the anchor. A
jump of a log of many readings a second may be in the middle of a step, so its process jumps in the next step, too.

**What is begun when.** Slow errors of fixes, and of the biases of an IMU that warms up, surprise nobody. So hypotheses
on fixes, and one that the biases of the IMU drift, begin every `WATCH` seconds in any case. All kinds begin when the
leading filter has had larger innovations than its datasheets allow since the anchor. If the leading hypothesis doubts a
group of instruments, one more says that they are well again from the anchor on: so a wrong decision is undone, too.
While it doubts the IMU, no other instrument is doubted anew, because a wrong IMU predicts wrongly what any of them
should measure. Nor is one while an axis of the IMU does not measure (`simnav.estimators.models.flat_lines`). If it
doubts other instruments and is surprised again, it is asked once whether the IMU was wrong instead, from the last
anchor at which nothing was doubted. What is less probable than exp(-`LEAST`) times the leading one is dropped, as are
the least probable of more than `filters`, and of more than `ALIKE` with the same doubts.

**Without a heading.** While fixes and compasses are silent, nothing sees the heading. Then no hypothesis sets it free,
for a log would turn it to explain any other error. Nor is the IMU doubted beside the log: nothing would be left.

**Prior probabilities.** A fault of each kind begins once in `onset` seconds, or more rarely by the factor of the kind
(`KINDS`), and lasts for `end` seconds, in the mean. At the start the position is wrong with the probability
`WRONG_POSITION`, and the attitude, too, with `WRONG_START`. A start whose heading is not known to `NARROW` is a bank of
starts at headings round the circle instead (`simnav.estimators.solvers.heading_bank`), for a filter that is linearised
at a wrong heading may never recover. Until `TRUST` seconds have confirmed the start, and one heading is left, no fault
is looked for: an instrument and the start contradict each other, and nothing says which of them is right. The same
holds of a rare fix that has only the IMU beside it (`lone_fix`): there no fault is looked for at all.

Gross errors and a noise beyond the datasheet need no hypothesis: in each filter the noise of every instrument switches
between levels (`simnav.estimators.solvers.hypothesis_filter`).

Sources: D. T. Magill, *Optimal adaptive estimation of sampled stochastic processes*, IEEE TAC 10(4), 1965; A. S.
Willsky and H. L. Jones, *A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems*, IEEE TAC 21(1), 1976; Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with Applications to Tracking
and Navigation*, 2001, section 11.6 (hypotheses that branch, are pruned and merged).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, inf, isfinite, log, nan, radians, sqrt
from typing import ClassVar, NamedTuple

import numpy as np

from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.composition import Solver
from simnav.estimators.models.channels import owners, summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.doubted_instruments import IMU, AttitudeDoubt, BiasDoubt, ImuDoubt
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements

from .admission import Admission
from .heading_bank import first_of_each_heading, starts_by_heading
from .hypotheses import uncertain_start
from .hypothesis_filter import HypothesisFilter, Step, lone_fix
from .kalman import KalmanEstimator
from .state_difference import mean_of
from .step_report import begun_report, end_report, labels_of

__all__ = ["KINDS", "Kind", "MultipleHypothesis"]


class Kind(NamedTuple):
    """A kind of hypothesis.

    Attributes
    ----------
    doubt : BiasDoubt, ImuDoubt or AttitudeDoubt
        What is doubted, and the error that is suspected.
    rare : float
        Mean time between such faults, over `onset`.
    watched : bool
        Whether it is begun at regular times, too.
    """

    doubt: BiasDoubt | ImuDoubt | AttitudeDoubt
    rare: float = 1.0
    watched: bool = False


#: The kinds of hypotheses. Sizes and times were chosen on training families.
KINDS: Mapping[str, Kind] = {
    "drifting fixes": Kind(BiasDoubt("fix", sigma=4.0, time=100.0), watched=True),
    "jumping fixes": Kind(BiasDoubt("fix", sigma=15.0, time=40.0, jump=15.0), watched=True),
    "log": Kind(BiasDoubt("log", sigma=0.5, time=1000.0, jump=1.0)),
    "compass": Kind(BiasDoubt("compass", sigma=radians(5.0), time=60.0, jump=radians(5.0)), rare=2.0),
    "imu drift": Kind(
        ImuDoubt(rate_jump=radians(0.03), force_jump=0.03, rate=radians(0.01), force=0.01, walk=0.02), watched=True
    ),
    "imu bias": Kind(ImuDoubt(rate_jump=radians(0.3), force_jump=0.5), rare=5.0),
    "imu noise": Kind(ImuDoubt(rate_jump=0.0, force_jump=0.0, rate=radians(0.1), force=0.03, walk=0.0), rare=5.0),
    "imu": Kind(ImuDoubt(rate_jump=radians(0.3), force_jump=0.1, rate=radians(0.3), force=0.1), rare=10.0),
    "imu far off": Kind(ImuDoubt(rate_jump=radians(3.0), force_jump=1.0, rate=radians(3.0), force=1.0), rare=10.0),
    "attitude": Kind(AttitudeDoubt(level=0.04, heading=0.2), rare=30.0),
}
#: Time between hypotheses that are begun in any case [s].
WATCH = 20.0
#: Prior probabilities that the position at the start is wrong, and that the attitude is, too.
WRONG_POSITION, WRONG_START = 0.02, 0.02
#: A heading at the start that is less well known than this is a bank of headings at most so far apart [rad]: the
#: defaults of `HeadingBank`.
NARROW, SPACING = radians(15.0), radians(20.0)
#: No fault is looked for before this time [s]: until then an instrument and the start contradict each other, and the
#: start has not been confirmed.
TRUST = 30.0
#: The leading filter is surprised where the sum of its normalised innovations squared is so many sigmas too large.
SURPRISED = 3.0
#: A step is the onset if its excess is above this part of the largest one since the anchor.
ONSET = 0.3
#: Hypotheses whose log probability is smaller than the largest one by this are dropped, and do not speak.
LEAST, SILENT = 12.0, 7.0
#: Largest number of hypotheses with the same doubts.
ALIKE = 2
#: A measurement less probable than this by the leading hypothesis is flagged as a gross error.
GROSS = 0.99999
#: Time after which nobody looks back to a sound anchor [s].
LONGEST = 60.0
#: A fix or a compass is silent after so many of its intervals without a reading, and at least one period.
SILENT_INTERVALS = 2.0
#: Tolerance of times [s].
_SAME_TIME = 1e-6


class _Doubted(NamedTuple):
    """By which kind of hypothesis a group is doubted, and since when [s]."""

    kind: str
    since: float


@dataclass(eq=False)
class _Hypothesis:
    """A filter with what it doubts.

    Attributes
    ----------
    doubts : mapping of str to _Doubted
        The groups of instruments that are doubted.
    filter : HypothesisFilter
        Its filter.
    weight : float
        Logarithm of its probability.
    """

    doubts: Mapping[str, _Doubted]
    filter: HypothesisFilter
    weight: float

    @property
    def kinds(self) -> dict[str, str]:
        """By group the kind of the doubt."""
        return {group: doubted.kind for group, doubted in self.doubts.items()}


class _Period:
    """The steps since the anchor, what was taken off all weights, and the excess of the leading filter.

    The excess of a step is the sum of the normalised innovations squared beyond its expected value and `SURPRISED`
    sigmas of it. In a period that is ``unmeasured``, an axis of the IMU does not measure.
    """

    def __init__(self, start: float) -> None:
        self.start, self.steps = start, list[Step]()
        self.excess: list[float] = []
        self.unmeasured = False
        self.taken = self.nis = self.freedom = 0.0

    def add(self, step: Step, taken: float, lead: HypothesisFilter) -> None:
        """Add a step."""
        self.steps.append(step)
        self.unmeasured |= bool(lead.model.samples.unmeasured.any())
        self.taken += taken
        self.nis += lead.nis
        self.freedom += lead.freedom
        self.excess.append(_excess(lead.nis, lead.freedom))

    def begin(self, k: int) -> float:
        """Time at which a step begins [s]."""
        return self.steps[k - 1].until if k else self.start

    @property
    def surprising(self) -> bool:
        """Whether the innovations are larger than the datasheets allow."""
        return _excess(self.nis, self.freedom) > 0.0

    @property
    def onset(self) -> int:
        """The step at which a fault began; the first one, if none is surprising."""
        limit = ONSET * max(self.excess)
        return next((k for k, x in enumerate(self.excess) if x > 0.0 and x > limit), 0)


def _excess(nis: float, freedom: float) -> float:
    return nis - freedom - SURPRISED * sqrt(2.0 * freedom)


class MultipleHypothesis(Solver):
    """The solver of the module.

    Diagnostics: ``doubt.NAME`` is the probability that an instrument (or the IMU) is wrong, and ``since.NAME`` since
    when, by the most probable hypothesis that doubts it [s]; NaN while the probability is below 0.5. ``hypotheses`` is
    the number of filters. Innovations and NIS are those of the most probable filter. Measurements of an instrument that
    is wrong with a probability above 0.5 are flagged, and single gross errors.

    Parameters
    ----------
    model : ModelChoice
        The model of each filter (`simnav.estimators.models.doubted_instruments`).
    period : float
        Time between anchors [s].
    onset : float
        Mean time between faults of the most frequent kind [s].
    end : float
        Mean length of a fault [s].
    filters : int
        Largest number of filters.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    sets_aside: ClassVar[bool] = True
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "adaptation": "an adapted noise would decide the evidence of a hypothesis",
        "iteration": "the evidence is that of one linearisation",
        "smoother": "a filter that is dropped leaves no trajectory",
    }

    def __init__(
        self, model: ModelChoice, *, period: float = 5.0, onset: float = 2000.0, end: float = 100.0, filters: int = 6
    ):
        for name, value in (("period", period), ("onset", onset), ("end", end)):
            if not 0.0 < value < inf:
                raise ValueError(f"{name} = {value:g} s: it must be above 0 and finite")
        if filters < 3:
            raise ValueError(
                f"filters = {filters}: it must be 3 or more, for a start that is right or wrong in two ways"
            )
        self._model_choice, self.period, self.onset, self.end, self.filters = model, period, onset, end, filters

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        instruments = by_source(instruments, self._model_choice, self.label)
        self._start, self._instruments = start, instruments
        starts = starts_by_heading(start, NARROW, SPACING)
        wrong = [(uncertain_start(start, attitude=False), WRONG_POSITION)]
        if len(starts) == 1:
            wrong += [(uncertain_start(start), WRONG_START)]
        right = 1.0 - sum(probability for _, probability in wrong)
        self._bank = [_Hypothesis({}, self._made(own), log(right * weight)) for own, weight in starts]
        first = self._bank[0].filter
        self._hypotheses = [*self._bank, *(_Hypothesis({}, self._made(own), log(weight)) for own, weight in wrong)]
        self._spare: list[HypothesisFilter] = []  # of hypotheses that were dropped
        self._anchor, self._sound = (_Hypothesis({}, self._made(start), 0.0) for _ in range(2))
        for anchor in (self._anchor, self._sound):
            anchor.filter.take_over(first)
        self._groups: Mapping[str, tuple[str, ...]] = first.model.groups
        possible = {*self._groups, *([""] if first.model.moving.attitude_end > 0 else [])}
        if lone_fix(instruments):
            possible = set()  # it and the IMU contradict each other, and nothing says which of them is right
        self._kinds = {name: kind for name, kind in KINDS.items() if kind.doubt.group in possible}
        self._period = _Period(start.time)
        self._since_sound: _Period | None = self._period
        self._next = start.time + self.period
        self._trusted = self._watch = start.time + TRUST
        self._admission = Admission(instruments, first.names)
        self._labels = labels_of(first.names)
        self._report = begun_report(instruments, first.names, self._admission.record.skipped, None)
        self._row = np.empty(len(self._labels))
        self._gross, self._owners = chi_square_limits(GROSS), owners(instruments)
        seeing = [name for group in ("fix", "compass") for name in self._groups.get(group, ())]
        self._heard = dict.fromkeys(seeing, start.time)
        self._silent = {name: max(self.period, SILENT_INTERVALS / instruments[name].rate) for name in seeing}
        self._blank = {f"since.{name}": nan for names in self._groups.values() for name in names}

    def _made(self, start: InitialState) -> HypothesisFilter:
        """A filter that begins the run."""
        one = HypothesisFilter(copy.deepcopy(self._model_choice))
        one.row, one.reports_all = self.label, self.reports_all
        one.reset(start, self._instruments)
        return one

    @property
    def best(self) -> HypothesisFilter:
        """The filter of the most probable hypothesis."""
        return self._hypotheses[0].filter

    @property
    def covariance(self) -> Array:
        """(n, n) covariance of the most probable filter."""
        return self.best.covariance

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        admitted = self._admission.admit(measurements, self.best.model.time)
        self._heard.update((m.instrument, m.time) for m in admitted if m.instrument in self._heard)
        step = Step(measurements.imu, admitted, measurements.time)
        for h in self._hypotheses:
            h.filter.advance(step)
            h.weight += h.filter.evidence if isfinite(h.filter.evidence) else -inf
        taken = self._normalise()
        lead = self.best
        self._period.add(step, taken, lead)
        if self._since_sound is not None and self._since_sound is not self._period:
            self._since_sound.add(step, taken, lead)
        notes = lead.notes
        lead.note_last(self._report)
        if step.until >= self._next - _SAME_TIME:
            self._next = step.until + self.period
            self._reconsider(step.until)
        estimate = self._mean()
        self._say(estimate, notes)
        return estimate

    def _normalise(self) -> float:
        """Order the hypotheses by their probabilities, and make these sum to 1; the logarithm that was taken off."""
        self._hypotheses.sort(key=lambda h: -h.weight)
        largest = self._hypotheses[0].weight
        total = largest + log(sum(exp(h.weight - largest) for h in self._hypotheses))
        for h in self._hypotheses:
            h.weight -= total
        return total

    def _reconsider(self, time: float) -> None:
        """Begin hypotheses from the anchor, drop those that are improbable, and set the next anchor."""
        if time > self._trusted + _SAME_TIME:
            self._begin_all(time)
        taken = self._normalise()
        for h in [h for h in self._hypotheses if h.weight < self._hypotheses[0].weight - LEAST]:
            self._drop(h)
        self._merge_bank(time)
        taken += self._normalise()
        anchor, lead = self._anchor, self._hypotheses[0]
        anchor.filter.take_over(lead.filter)
        anchor.doubts, anchor.weight, self._period = lead.doubts, lead.weight, _Period(time)
        if not lead.doubts:
            self._sound.filter.take_over(lead.filter)
            self._sound.weight, self._since_sound = lead.weight, self._period
        elif self._since_sound is not None:
            self._since_sound.taken += taken
            if time - self._since_sound.start > LONGEST:
                self._since_sound = None

    def _merge_bank(self, time: float) -> None:
        """Let filters of the bank that have reached the same heading be one; no fault is looked for before."""
        left = sorted((h for h in self._bank if h in self._hypotheses), key=lambda h: -h.weight)
        firsts = first_of_each_heading([h.filter.estimate() for h in left])
        for h, first in zip(left, (left[k] for k in firsts), strict=True):
            if first is not h:
                first.weight = float(np.logaddexp(first.weight, h.weight))
                self._drop(h)
        kept = [left[k] for k in dict.fromkeys(firsts)]
        self._bank = kept if len(kept) > 1 else []
        if self._bank:
            self._trusted = self._watch = max(self._trusted, time)

    def _begin_all(self, time: float) -> None:
        """Begin the hypotheses that are due."""
        anchor, surprised = self._anchor, self._period.surprising
        watched = time >= self._watch - _SAME_TIME
        if watched:
            self._watch = time + WATCH
        known = anchor.kinds.values()
        wrong = IMU in anchor.doubts or self._period.unmeasured
        self._heading_seen = any(time - at <= self._silent[name] + _SAME_TIME for name, at in self._heard.items())
        for name, kind in self._kinds.items():
            if wrong and kind.doubt.group not in (IMU, ""):
                continue  # what a wrong IMU predicts condemns no other instrument
            if kind.doubt.group == IMU and "log" in anchor.doubts and not self._heading_seen:
                continue  # nothing would be left
            if surprised or (watched and kind.watched and name not in known):
                length = WATCH if kind.watched and not surprised else self.period
                self._begin(length / (kind.rare * self.onset), name)
        for group in anchor.doubts:
            self._begin(self.period / self.end, "", well=group)
        if surprised and anchor.doubts and IMU not in anchor.doubts and self._since_sound is not None:
            self._look_back(self._since_sound)

    def _look_back(self, period: _Period) -> None:
        """Ask whether what instruments are blamed for is the fault of the IMU, from the last sound anchor on.

        It is asked once for each such anchor: all measurements since then are used once more.
        """
        for name, kind in self._kinds.items():
            if kind.doubt.group == IMU:
                self._begin(self.period / (kind.rare * self.onset), name, self._sound, period)
        self._since_sound = None

    def _begin(
        self,
        prior: float,
        name: str,
        anchor: _Hypothesis | None = None,
        period: _Period | None = None,
        *,
        well: str = "",
    ) -> None:
        """Begin a hypothesis from an anchor.

        Parameters
        ----------
        prior : float
            Its probability before the measurements, given the anchor.
        name : str
            Its kind; empty where a group is well again.
        anchor, period : _Hypothesis and _Period, optional
            The anchor, and what happened since; by default those of the last one.
        well : str
            The group of instruments that is well again.
        """
        anchor, period = anchor or self._anchor, period or self._period
        own = self._spare.pop() if self._spare else self._made(self._start)
        own.take_over(anchor.filter)
        weight = anchor.weight + log(min(prior, 0.5)) - period.taken
        doubts, onsets = dict(anchor.doubts), {0}
        if well:
            del doubts[well]
        else:
            doubt, onset = self._kinds[name].doubt, period.onset
            onsets = {onset, onset + 1} if doubt.group == "log" else {onset}
            if doubt.group:
                before = doubts.get(doubt.group)
                since = before.since if before is not None else period.begin(onset)
                doubts[doubt.group] = _Doubted(name, since)
        for k, step in enumerate(period.steps):
            if k in onsets and well:
                own.model.believe(own.covariance, well)
            elif k in onsets:
                doubt.begin(own.model, own.covariance, heading_seen=self._heading_seen)
            own.advance(step)
            weight += own.evidence
        born = _Hypothesis(doubts, own, weight)
        self._hypotheses.append(born)
        alike = [h for h in self._hypotheses if h.kinds == born.kinds]
        if len(alike) > ALIKE:
            self._drop(min(alike, key=lambda h: h.weight))
        elif len(self._hypotheses) > self.filters:
            self._drop(min(self._hypotheses, key=lambda h: h.weight))

    def _drop(self, hypothesis: _Hypothesis) -> None:
        self._hypotheses.remove(hypothesis)
        self._spare.append(hypothesis.filter)

    def _mean(self) -> Estimate:
        """The mean of the hypotheses, and the covariance of their mixture."""
        kept = [h for h in self._hypotheses if h.weight > self._hypotheses[0].weight - SILENT]
        first = kept[0].filter.estimate()
        if len(kept) == 1:
            return first
        estimates = [first, *(h.filter.estimate() for h in kept[1:])]
        weights = np.exp([h.weight for h in kept])
        weights /= weights.sum()
        return mean_of(estimates, weights)

    def _say(self, estimate: Estimate, notes: list[tuple[Measurement, float]]) -> None:
        """Set diagnostics and flags of an estimate.

        Parameters
        ----------
        estimate : Estimate
            The estimate of the step.
        notes : list of (Measurement, float)
            The measurements of the leading filter, as of `HypothesisFilter.notes`.
        """
        diagnostics: dict[str, float | Array] = dict(self._blank)
        wrong = set[str]()
        for group, names in self._groups.items():
            doubting = [h for h in self._hypotheses if group in h.doubts]
            probability = sum(exp(h.weight) for h in doubting)
            for name in names:
                diagnostics[f"doubt.{name}"] = probability
                if probability > 0.5:
                    wrong.add(name)
                    diagnostics[f"since.{name}"] = doubting[0].doubts[group].since
        estimate.flagged = [
            (m.instrument, m.time)
            for m, nis in notes
            if nis >= 0.0 and (m.instrument in wrong or nis > self._gross[len(m.value)])
        ]
        end_report.unchecked(self._report, self._row)
        diagnostics.update(zip(self._labels, self._row.tolist(), strict=True))
        diagnostics["hypotheses"] = float(len(self._hypotheses))
        if self._owners:
            diagnostics.update(summary(diagnostics, self._owners))
        estimate.diagnostics = diagnostics
