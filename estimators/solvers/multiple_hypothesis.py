"""PROTOTYPE"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, log, radians
from typing import ClassVar

import numpy as np

from simnav.estimators.composition import Solver
from simnav.estimators.models.doubted_fixes import Doubt
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

from .hypotheses import uncertain_start
from .hypothesis_filter import HypothesisFilter
from .state_difference import difference, displaced

__all__ = ["MultipleHypothesis"]

SOUND = "sound"


@dataclass
class Branch:
    """One hypothesis."""

    doubts: dict
    filter: HypothesisFilter
    weight: float = -np.inf
    since: float = 0.0
    estimate: Estimate | None = None

    @property
    def kind(self):
        return "+".join(self.doubts.values()) or "sound"


class MultipleHypothesis(Solver):
    """The solver."""

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    sets_aside: ClassVar[bool] = True

    def __init__(
        self, model: ModelChoice, *, period: float = 5.0, onset: float = 2000.0, end: float = 100.0, watch: float = 20.0,
        start: float = 0.02, filters: int = 8, same: int = 3, alarm: float = 3.0, least: float = 20.0,
        drift: float = 4.0, drift_time: float = 100.0,
        wild: float = 15.0, wild_time: float = 40.0, log: float = 0.5, log_time: float = 30.0, log_jump: float = 1.0,
        gyro: float = 0.1, accel: float = 0.1, imu_jump: float = 2.0, imu_walk: float = 0.2,
        turn: float = 5.0, turn_time: float = 60.0, rate: float = 1.0,
        kinds: str = "drift,wild,log,imu,compass",
    ):  # fmt: skip
        self._choice = model
        self.period, self.onset, self.end, self.start, self.filters = period, onset, end, start, int(filters)
        self.watch, self.same, self.alarm, self.least, self.rate = watch, int(same), alarm, least, rate
        known = {"drift": Doubt("fix", drift, drift_time, 0.0), "wild": Doubt("fix", wild, wild_time, wild),
            "log": Doubt("log", log, log_time, log_jump), "imu": Doubt("imu", imu_walk, 0.0, imu_jump, radians(gyro), accel),
            "compass": Doubt("compass", radians(turn), turn_time, radians(turn))}
        self.all_kinds = {k: known[k] for k in kinds.split(",") if k}
        self.regular = ("drift", "wild")

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        def made(own: InitialState) -> HypothesisFilter:
            one = HypothesisFilter(copy.deepcopy(self._choice))
            one.highest_rate = self.rate
            one.row, one.reports_all = self.label, self.reports_all
            one.reset(own, instruments)
            return one

        self.branches = [Branch({}, made(start), log(1.0 - self.start), start.time)]
        if self.start:
            self.branches.append(Branch({}, made(uncertain_start(start)), log(self.start), start.time))
        self._free = [made(start) for _ in range(self.filters + 1 - len(self.branches))]
        self._anchor = Branch({}, made(start), 0.0, start.time)
        self._anchor.filter.take_over(self.branches[0].filter)
        possible = self.branches[0].filter.model.doubtful
        self.kinds = {k: d for k, d in self.all_kinds.items() if d.group in possible}
        self._next = start.time + self.period
        self._regular = start.time + self.watch
        self._packets, self._norm, self._surprise, self._freedom = [], 0.0, 0.0, 0.0
        self.history = []

    def update(self, measurements: Measurements) -> Estimate:
        alive = self.branches
        for b in alive:
            b.estimate = b.filter.update(measurements)
            b.weight += b.filter.evidence
        best = max(b.weight for b in alive)
        total = best + log(sum(exp(b.weight - best) for b in alive))
        self._norm += total
        for b in alive:
            b.weight -= total
        alive.sort(key=lambda b: -b.weight)
        lead = alive[0]
        self._surprise += lead.filter.surprise
        self._freedom += lead.filter.freedom
        self._packets.append(measurements)
        if measurements.time >= self._next - 1e-6:
            self._next = measurements.time + self.period
            self._branch(measurements.time)
        alive.sort(key=lambda b: -b.weight)
        estimate = _mean(alive)
        estimate.diagnostics = dict(alive[0].estimate.diagnostics)
        estimate.flagged = alive[0].estimate.flagged
        for g in ("fix", "log", "imu", "compass"):
            estimate.diagnostics["doubt." + g] = sum(exp(b.weight) for b in alive if g in b.doubts)
        self.history.append((measurements.time, [(b.kind, b.weight, b.since) for b in alive]))
        return estimate

    @property
    def covariance(self) -> Array:
        return max(self.branches, key=lambda b: b.weight).filter.covariance

    def _branch(self, time: float) -> None:
        """Hypotheses are begun from the anchor."""
        anchor = self._anchor
        alarmed = self._freedom > 0 and self._surprise - self._freedom > self.alarm * (2.0 * self._freedom) ** 0.5
        regular = time >= self._regular - 1e-6
        if regular:
            self._regular = time + self.watch
        born = []
        for name, doubt in self.kinds.items():
            if (alarmed or (regular and name in self.regular)) and name not in anchor.doubts.values():
                interval = self.watch if name in self.regular and not alarmed else self.period
                born.append(self._child(time, interval / self.onset, doubt, name))
        for group in anchor.doubts:
            born.append(self._child(time, self.period / self.end, None, group))
        for child in born:
            self._admit(child)
        best = max(b.weight for b in self.branches)
        for b in [b for b in self.branches if b.weight < best - self.least]:
            self._drop(b)
        total = log(sum(exp(b.weight) for b in self.branches))
        for b in self.branches:
            b.weight -= total
        lead = max(self.branches, key=lambda b: b.weight)
        anchor.filter.take_over(lead.filter)
        anchor.doubts, anchor.weight = lead.doubts, lead.weight
        self._packets, self._norm, self._surprise, self._freedom = [], 0.0, 0.0, 0.0

    def _drop(self, b):
        self.branches.remove(b)
        self._free.append(b.filter)

    def _child(self, time, p, doubt, name):
        if not self._free:
            self._drop(min(self.branches, key=lambda b: b.weight))
        anchor, f = self._anchor, self._free.pop()
        f.take_over(anchor.filter)
        if doubt is None:
            f.model.believe(f.covariance, name)
            doubts = {g: k for g, k in anchor.doubts.items() if g != name}
        else:
            f.model.doubt(f.covariance, doubt)
            doubts = {**anchor.doubts, doubt.group: name}
        child = Branch(doubts, f, anchor.weight + log(min(p, 0.5)) - self._norm, time - self.period)
        for packet in self._packets:
            child.estimate = f.update(packet)
            child.weight += f.evidence
        self.branches.append(child)
        return child

    def _admit(self, child):
        """Keep the number of filters, and of those with the same doubts, within their limits."""
        if child not in self.branches:
            return
        alike = [b for b in self.branches if b.doubts == child.doubts]
        if len(alike) > self.same:
            self._drop(min(alike, key=lambda b: b.weight))
        elif len(self.branches) > self.filters:
            self._drop(min(self.branches, key=lambda b: b.weight))


def _mean(branches: list[Branch]) -> Estimate:
    first = branches[0]
    kept = [b for b in branches if b.weight > -10.0]
    if len(kept) == 1:
        return copy.copy(first.estimate)
    apart = np.stack([difference(b.estimate, first.estimate) for b in kept])
    weights = np.exp([b.weight for b in kept]); weights /= weights.sum()
    mean = weights @ apart
    covariance = np.zeros((9, 9))
    for w, b, d in zip(weights, kept, apart - mean, strict=True):
        covariance += w * (b.estimate.covariance + np.outer(d, d))
    return displaced(first.estimate, mean, covariance)
