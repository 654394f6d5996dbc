"""PROTOTYPE"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, log, radians
from typing import ClassVar

import numpy as np

from simnav.estimators.composition import Solver
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.doubted_instruments import Doubt
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

from .admission import Admission
from .hypotheses import uncertain_start
from .hypothesis_filter import HypothesisFilter, Step
from .innovation_consistency import InnovationTest
from .state_difference import differences, displaced

__all__ = ["MultipleHypothesis"]


@dataclass
class Branch:
    """One hypothesis."""

    doubts: Mapping[str, str]
    filter: HypothesisFilter
    weight: float
    since: float

    @property
    def kind(self):
        return "+".join(self.doubts.values()) or "sound"


P = dict(drift=4.0, drift_time=100.0, wild=15.0, wild_time=40.0, log=0.5, log_time=1000.0, log_jump=1.0, gyro=0.3, accel=0.1, imu_jump=1.0, imu_walk=0.2,
    turn=5.0, turn_time=60.0, rare_imu=30.0, rare_compass=2.0, rare_drift=1.0, rare_wild=1.0, rare_log=1.0, speak=7.0, lost=0.2, rare_lost=30.0)


class MultipleHypothesis(Solver):
    """The solver."""

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    sets_aside: ClassVar[bool] = True

    def __init__(
        self, model: ModelChoice, *, period: float = 5.0, onset: float = 2000.0, end: float = 100.0, watch: float = 20.0,
        start: float = 0.02, filters: int = 6, same: int = 2, alarm: float = 3.0, least: float = 12.0,
    ):  # fmt: skip
        self._choice = model
        self.period, self.onset, self.end, self.start, self.filters = period, onset, end, start, int(filters)
        self.watch, self.same, self.alarm, self.least = watch, int(same), alarm, least
        self.all_kinds = {"drift": Doubt("fix", P["drift"], P["drift_time"], 0.0), "wild": Doubt("fix", P["wild"], P["wild_time"], P["wild"]),
            "log": Doubt("log", P["log"], P["log_time"], P["log_jump"]), "imu": Doubt("imu", P["imu_walk"], 0.0, P["imu_jump"], radians(P["gyro"]), P["accel"]),
            "compass": Doubt("compass", radians(P["turn"]), P["turn_time"], radians(P["turn"])), "lost": Doubt("", P["lost"], 0.0, 0.0)}
        self.regular = ("drift", "wild")

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        instruments = by_source(instruments, self._choice, self.label)

        def made(own: InitialState) -> HypothesisFilter:
            one = HypothesisFilter(copy.deepcopy(self._choice))
            one.row, one.reports_all = self.label, self.reports_all
            one.reset(own, instruments)
            return one

        self.branches = [Branch({}, made(start), log(1.0 - self.start), start.time)]
        if self.start:
            self.branches.append(Branch({}, made(uncertain_start(start)), log(self.start), start.time))
        self._spare = [made(start) for _ in range(self.filters + 1 - len(self.branches))]
        self._anchor = Branch({}, made(start), 0.0, start.time)
        first = self.branches[0].filter
        self._anchor.filter.take_over(first)
        self.kinds = {k: d for k, d in self.all_kinds.items() if d.group in first.model.doubtful or not d.group}
        self._next = start.time + self.period
        self._regular = start.time + self.watch
        self._begin_period()
        self._admission = Admission(instruments, first._names)
        self._innovation_test = InnovationTest()
        self._keys = {n: (f"innovation.{n}", f"nis.{n}") for n in first._names}
        self.history = []

    def _begin_period(self):
        self._steps, self._norm, self._nis, self._freedom, self._excess = [], 0.0, 0.0, 0.0, []

    def update(self, measurements: Measurements) -> Estimate:
        alive = self.branches
        step = Step(measurements.imu, self._admission.admit(measurements, alive[0].filter.model.time), measurements.time)
        for b in alive:
            b.filter.advance(step)
            b.weight += b.filter.evidence
        self._norm += self._normalise()
        lead = alive[0]
        self._nis += lead.filter.nis
        self._freedom += lead.filter.freedom
        self._steps.append(step)
        self._excess.append(lead.filter.nis - lead.filter.freedom - self.alarm * (2.0 * lead.filter.freedom) ** 0.5)
        notes = lead.filter.notes
        if measurements.time >= self._next - 1e-6:
            self._next = measurements.time + self.period
            self._branch(measurements.time)
        estimate = self._mean()
        diagnostics = {k: np.nan for p in self._keys.values() for k in p}
        for m, nis, size in notes:
            if nis < 0.0:
                self._admission.skipped += 1
            else:
                self._innovation_test.add(nis, len(m.value))
                a, b = self._keys[m.instrument]
                diagnostics[a], diagnostics[b] = size, nis
        self._innovation_test.end_epoch()
        diagnostics["variance_factor"] = self._innovation_test.variance_factor
        diagnostics["inconsistent"] = float(self._innovation_test.inconsistent)
        diagnostics["skipped"] = float(self._admission.skipped)
        for g in ("fix", "log", "imu", "compass"):
            diagnostics["doubt." + g] = sum(exp(b.weight) for b in alive if g in b.doubts)
        estimate.diagnostics = diagnostics
        self.history.append((measurements.time, [(b.kind, b.weight, b.since) for b in alive]))
        return estimate

    def _normalise(self):
        self.branches.sort(key=lambda b: -b.weight)
        best = self.branches[0].weight
        total = best + log(sum(exp(b.weight - best) for b in self.branches))
        for b in self.branches:
            b.weight -= total
        return total

    @property
    def covariance(self) -> Array:
        return self.branches[0].filter.covariance

    def _branch(self, time: float) -> None:
        """Hypotheses are begun from the anchor."""
        anchor = self._anchor
        alarmed = self._freedom > 0 and self._nis - self._freedom > self.alarm * (2.0 * self._freedom) ** 0.5
        regular = time >= self._regular - 1e-6
        if regular:
            self._regular = time + self.watch
        for name, doubt in self.kinds.items():
            if alarmed or (regular and name in self.regular and name not in anchor.doubts.values()):
                interval = self.watch if name in self.regular and not alarmed else self.period
                self._child(time, interval / self.onset / P["rare_" + name], doubt, name)
        for group in anchor.doubts:
            self._child(time, self.period / self.end, None, group)
        best = max(b.weight for b in self.branches)
        for b in [b for b in self.branches if b.weight < best - self.least]:
            self._drop(b)
        self._normalise()
        lead = self.branches[0]
        anchor.filter.take_over(lead.filter)
        anchor.doubts, anchor.weight = lead.doubts, lead.weight
        self._begin_period()

    def _drop(self, b):
        self.branches.remove(b)
        self._spare.append(b.filter)

    def _child(self, time, p, doubt, name):
        anchor, f = self._anchor, self._spare.pop()
        f.take_over(anchor.filter)
        if doubt is None:
            f.model.believe(f.covariance, name)
            doubts = {g: k for g, k in anchor.doubts.items() if g != name}
        else:
            doubts = {**anchor.doubts, doubt.group: name} if doubt.group else anchor.doubts
        child = Branch(doubts, f, anchor.weight + log(min(p, 0.5)) - self._norm, time - self.period)
        onset = (next((k for k, x in enumerate(self._excess) if x > max(0.0, 0.3 * max(self._excess))), 0),)
        if name == "log":
            onset = (onset[0], onset[0] + 1)
        for k, step in enumerate(self._steps):
            if doubt is not None and k in onset:
                if doubt.group:
                    f.model.doubt(f.covariance, doubt)
                else:
                    f.loosen(doubt.sigma)
            f.advance(step)
            child.weight += f.evidence
        self.branches.append(child)
        alike = [b for b in self.branches if b.doubts == child.doubts]
        if len(alike) > self.same:
            self._drop(min(alike, key=lambda b: b.weight))
        elif len(self.branches) > self.filters:
            self._drop(min(self.branches, key=lambda b: b.weight))

    def _mean(self) -> Estimate:
        kept = [b for b in self.branches if b.weight > self.branches[0].weight - P["speak"]]
        first = kept[0].filter.estimate()
        if len(kept) == 1:
            return first
        estimates = [first, *(b.filter.estimate() for b in kept[1:])]
        apart = differences(estimates, first)
        weights = np.exp([b.weight for b in kept])
        weights /= weights.sum()
        mean = weights @ apart
        apart -= mean
        covariance = (weights[:, None] * apart).T @ apart
        for w, one in zip(weights.tolist(), estimates, strict=True):
            covariance += w * one.covariance
        return displaced(first, mean, covariance)
