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
        self, model: ModelChoice, *, period: float = 5.0, onset: float = 2000.0, end: float = 100.0, young: float = 20.0,
        start: float = 0.02, filters: int = 9, drift: float = 4.0, drift_time: float = 100.0,
        wild: float = 15.0, wild_time: float = 40.0, log: float = 0.5, log_time: float = 30.0, log_jump: float = 1.0,
        gyro: float = 0.1, accel: float = 0.1, imu_jump: float = 2.0, imu_walk: float = 0.2, tests: int = 3,
        kinds: str = "drift,wild,log,imu",
    ):  # fmt: skip
        self._choice = model
        self.period, self.onset, self.end, self.start, self.filters = period, onset, end, start, filters
        self.young, self.tests = young, tests
        known = {"drift": Doubt("fix", drift, drift_time, 0.0), "wild": Doubt("fix", wild, wild_time, wild),
            "log": Doubt("log", log, log_time, log_jump), "imu": Doubt("imu", imu_walk, 0.0, imu_jump, radians(gyro), accel)}
        self.all_kinds = {k: known[k] for k in kinds.split(",") if k}

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        def made(own: InitialState) -> Branch:
            one = HypothesisFilter(copy.deepcopy(self._choice))
            one.together = int(self.tests)
            one.row, one.reports_all = self.label, self.reports_all
            one.reset(own, instruments)
            return Branch({}, one, since=start.time)

        self.branches = [made(start if k != 1 else uncertain_start(start)) for k in range(int(self.filters))]
        self.branches[0].weight = log(1.0 - self.start)
        self.branches[1].weight = log(self.start)
        possible = self.branches[0].filter.model.doubtful
        self.kinds = {k: d for k, d in self.all_kinds.items() if d.group in possible}
        self._turn = list(self.kinds)
        self._next = start.time + self.period
        self.history = []

    def update(self, measurements: Measurements) -> Estimate:
        alive = [b for b in self.branches if b.weight > -np.inf]
        for b in alive:
            b.estimate = b.filter.update(measurements)
            b.weight += b.filter.evidence
        best = max(b.weight for b in alive)
        total = best + log(sum(exp(b.weight - best) for b in alive))
        for b in alive:
            b.weight = max(b.weight - total, -60.0)
        alive.sort(key=lambda b: -b.weight)
        estimate = _mean(alive)
        estimate.diagnostics = dict(alive[0].estimate.diagnostics)
        estimate.flagged = alive[0].estimate.flagged
        for g in ("fix", "log", "imu"):
            estimate.diagnostics["doubt." + g] = sum(exp(b.weight) for b in alive if g in b.doubts)
        self.history.append((measurements.time, [(b.kind, b.weight, b.since) for b in alive]))
        if measurements.time >= self._next and self._turn:
            self._next = measurements.time + self.period
            self._branch(measurements.time)
        return estimate

    @property
    def covariance(self) -> Array:
        return max(self.branches, key=lambda b: b.weight).filter.covariance

    def _branch(self, time: float) -> None:
        """The next hypothesis in turn is begun from the most probable one."""
        kind = self._turn.pop(0)
        self._turn.append(kind)
        doubt = self.kinds[kind]
        parents = sorted((b for b in self.branches if b.weight > -np.inf), key=lambda b: -b.weight)
        if kind not in parents[0].doubts.values():
            for parent in parents:
                if doubt.group not in parent.doubts:
                    self._child(parent, time, self.period * len(self._turn) / self.onset, doubt, kind)
                    break
        for parent in parents[:1]:
            for group in parent.doubts:
                if parent.doubts[group] == kind:
                    self._child(parent, time, self.period * len(self._turn) / self.end, None, group)
                    break

    def _child(self, parent, time, p, doubt, name):
        free = sorted((b for b in self.branches if b is not parent and (b.weight == -np.inf or time - b.since >= self.young - 0.1)), key=lambda b: b.weight)
        if not free:
            return
        one = free[0]
        if one.weight > parent.weight + log(p):
            return
        one.filter.take_over(parent.filter)
        model, P = one.filter.model, one.filter.covariance
        if doubt is None:
            model.believe(P, name)
            one.doubts = {g: k for g, k in parent.doubts.items() if g != name}
        else:
            model.doubt(P, doubt)
            one.doubts = {**parent.doubts, doubt.group: name}
        one.weight, one.since = parent.weight + log(p), time


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
