"""A voyage of a learning task: recording, plain filter, oracle and truth, step by step, or all steps in advance."""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.estimator import UnsuitableScenario
from simnav.estimators.adaptations.truth import TrueNoise
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.geometry.earth import radii_scalar
from simnav.log import LogWarning
from simnav.recording import AidStream, Recording
from simnav.scenario import Scenario
from simnav.source import open_source
from simnav.types import Array, Estimate, InitialState, Instruments

from .features import Context
from .reference import Linear, ReferenceFilter

__all__ = ["Prepared", "Voyage", "prepare", "recorded"]


def recorded(scenario: Scenario, seed: int, steps: int | None = None) -> Recording:
    """The recording of a voyage, or of its first steps; what a log warns of is not repeated here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        source = open_source(scenario, seed)
        until = source.duration if steps is None else min(source.duration, steps * source.step)
        data = source.advance(until)
    return Recording(
        scenario.id, seed, source.instruments, source.initial_truth, source.start, source.faults, data, source.note
    )


class Voyage:
    """A running voyage: `advance` runs the plain filter and the oracle over the measurements of the next step.

    Parameters
    ----------
    scenario : Scenario
        Scenario of the voyage.
    seed : int
        Seed of the run.
    names : list of str
        The instruments, as the events are to number them (`ReferenceFilter`).
    steps : int, optional
        Number of steps of the voyage; None: the whole run.
    oracle : bool
        Whether the oracle runs, too. Otherwise, or if it has no estimate, its numbers are NaN.

    Attributes
    ----------
    recording : Recording
        The recording of the whole run.
    filter : ReferenceFilter
        The plain filter at the end of the step; ``filter.linear`` holds the events of the step.
    step : int
        Number of the step; -1 before the first.
    context : (11,) array
        Numbers on the voyage before the step (`simnav.estimators.learning.features.Context`).
    error : (9,) array
        Error of the plain filter at the end of the step: position north, east, down [m], velocity [m/s], two zeros,
        heading [rad]; NaN for components that are not estimated, or that the reference of a log does not hold.
    oracle : (3,) array
        The oracle's horizontal error and its horizontal sigma s [m], and the root of the mean of ``p^2 + s^2`` from the
        start on, p the horizontal error of the plain filter [m].
    faulty : (e,) bool array
        Which of the events' measurements a fault has touched.
    estimate : Estimate
        Estimate of the plain filter at the end of the step.
    truth : (3, 3) array
        True position, velocity and attitude at the end of the step.
    """

    def __init__(
        self, scenario: Scenario, seed: int, names: list[str], steps: int | None = None, *, oracle: bool = True
    ):
        self.recording = recording = recorded(scenario, seed, steps)
        if not len(recording.data.truth):
            raise ValueError(f"scenario {scenario.id}: the run is shorter than one step")
        self._packets = list(recording.steps())
        self.filter = ReferenceFilter(names)
        self.filter.reset(recording.start, recording.instruments)
        self._knowing: OracleEstimator | None = None
        if oracle:
            self._knowing = OracleEstimator(TrueNoise())
            self._knowing.reveal(recording)
            try:
                self._knowing.reset(recording.start, recording.instruments)
            except UnsuitableScenario:
                self._knowing = None
        self._context = Context(recording.start, recording.instruments.step)
        self._streams = [recording.data.aids.get(name) for name in names]
        self.oracle = np.full(3, np.nan)
        self._squares, self._known = 0.0, 0
        self.step, self.steps = -1, len(recording.data.truth)

    def advance(self) -> bool:
        """Take the next step; False where the voyage is over."""
        if self.step + 1 == self.steps:
            return False
        self.step += 1
        packet = self._packets[self.step]
        truth, k = self.recording.data.truth, self.step
        self.truth = np.stack([truth.position[k], truth.velocity[k], truth.attitude[k]])
        self.context = self._context.numbers()
        self.estimate = estimate = self.filter.update(packet)
        self._context.move(estimate)
        self.error = _error(estimate, self.truth)
        if self._knowing is not None:
            knowing = self._knowing.update(packet)
            error = _error(knowing, self.truth)
            assert knowing.covariance is not None
            sigma = math.sqrt(max(knowing.covariance[0, 0] + knowing.covariance[1, 1], 0.0))
            square = float(self.error[0] ** 2 + self.error[1] ** 2) + sigma * sigma
            if square == square:  # the reference of a log may have gaps
                self._squares, self._known = self._squares + square, self._known + 1
            usual = math.sqrt(self._squares / self._known) if self._known else math.nan
            self.oracle = np.array([math.hypot(error[0], error[1]), sigma, usual])
        linear = self.filter.linear
        self.faulty = np.zeros(self.filter.count, np.bool_)
        for e in range(self.filter.count):
            if linear.size[e]:
                stream = self._streams[linear.instrument[e]]
                assert stream is not None
                self.faulty[e] = _touched(stream, linear.time[e])
        return True


class Prepared(NamedTuple):
    """All S steps of a voyage ahead: the events of step k are those from ``edges[k]`` up to ``edges[k + 1]``."""

    linear: Linear
    edges: NDArray[np.int64]  # (S + 1,)
    end: Array  # (S,)
    context: Array  # (S, 11)
    error: Array  # (S, 9)
    oracle: Array  # (S, 3)
    faulty: NDArray[np.bool_]  # (e,)
    start_covariance: Array  # (n, n)
    instruments: Instruments
    start: InitialState


def prepare(
    scenario: Scenario, seed: int, names: list[str], steps: int | None = None, *, oracle: bool = True
) -> Prepared:
    """A whole `Voyage`, its steps one after the other: the same numbers."""
    voyage = Voyage(scenario, seed, names, steps, oracle=oracle)
    n = voyage.filter.model.size
    parts: list[Linear] = []
    faulty, edges, ends, contexts, errors, oracles = [], [0], [], [], [], []
    while voyage.advance():
        count = voyage.filter.count
        parts.append(Linear._make(array[:count].copy() for array in voyage.filter.linear))
        faulty.append(voyage.faulty)
        edges.append(edges[-1] + count)
        ends.append(voyage.estimate.time)
        contexts.append(voyage.context)
        errors.append(voyage.error)
        oracles.append(voyage.oracle)
    linear = Linear._make(np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    assert linear.transition.shape[1] == n
    return Prepared(
        linear, np.array(edges), np.array(ends), np.stack(contexts), np.stack(errors), np.stack(oracles),
        np.concatenate(faulty), voyage.filter.start_covariance, voyage.recording.instruments,
        voyage.recording.start,
    )  # fmt: skip


def _touched(stream: AidStream, time: float) -> bool:
    k = min(int(np.searchsorted(stream.time, time - 1e-9)), len(stream.time) - 1)
    return bool(stream.faults[k])


def _error(estimate: Estimate, truth: Array) -> Array:
    """Estimate minus truth, in plain floats: once a step."""
    error = np.zeros(9)
    (latitude, longitude, height), velocity, attitude = truth.tolist()
    estimated = estimate.mask()
    if estimate.position is None:
        error[:3] = np.nan
    else:
        meridian, prime = radii_scalar.function(math.sin(latitude))
        above = height if height == height else 0.0
        position = estimate.position.tolist()
        error[0] = (position[0] - latitude) * (meridian + above)
        error[1] = math.remainder(position[1] - longitude, math.tau) * (prime + above) * math.cos(latitude)
        error[2] = height - position[2]
    error[3:6] = np.nan if estimate.velocity is None else estimate.velocity - velocity
    error[8] = np.nan if estimate.attitude is None else math.remainder(estimate.attitude[2] - attitude[2], math.tau)
    error[:6] = np.where(estimated[:6], error[:6], np.nan)
    error[8] = error[8] if estimated[8] else np.nan
    return error
