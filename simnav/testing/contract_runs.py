"""Runs of an estimator for the contract test: what it gave, what it wrote into, and where two runs differ."""

from __future__ import annotations

import copy
import hashlib
import operator
import pickle
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from simnav.estimator import Estimator
from simnav.recording import Recording
from simnav.types import Estimate, NavigationStates

__all__ = ["Output", "Watched", "difference", "digests", "parting", "run", "steps", "watch"]


def steps(estimator: Estimator, recording: Recording) -> Iterable[Estimate]:
    """The estimates of a run."""
    if estimator.reference:
        estimator.reveal(recording)
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        yield estimator.update(packet)


@dataclass(frozen=True)
class Output:
    """All that an estimator gave in a run."""

    estimates: list[Estimate]
    smoothed: NavigationStates | None


def run(estimator: Estimator, recording: Recording) -> Output:
    """A run over a copy of a recording: what is written into it does not reach the next run."""
    estimates = [copy.deepcopy(e) for e in steps(estimator, copy.deepcopy(recording))]
    return Output(estimates, copy.deepcopy(estimator.smooth()))


@dataclass(frozen=True)
class Watched:
    """What an estimator writes into: parts of its input, and where an estimate that it returned."""

    spoilt: list[str]
    rewritten: str | None


def watch(estimator: Estimator, recording: Recording) -> Watched:
    """A run in which the input and all estimates are compared with what they were."""
    before, same_lists = digests(recording), True
    kept: list[tuple[Estimate, Estimate]] = []
    if estimator.reference:
        estimator.reveal(recording)
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        given = list(packet.aids)
        estimate = estimator.update(packet)
        same_lists &= len(given) == len(packet.aids) and all(map(operator.is_, given, packet.aids))
        kept.append((estimate, copy.deepcopy(estimate)))
    estimator.smooth()
    after = digests(recording)
    spoilt = [name for name in before if before[name] != after[name]]
    spoilt += [] if same_lists else ["the list of measurements"]
    return Watched(spoilt, parting([a for a, _ in kept], [b for _, b in kept]))


def difference(first: Output, second: Output) -> str | None:
    """The first difference between two runs, as text; None if they are equal."""
    where = parting(first.estimates, second.estimates)
    if where is not None:
        return where
    a, b = first.smoothed, second.smoothed
    if (a is None) != (b is None):
        return "smooth() gives a trajectory in one run only"
    if a is not None and b is not None:
        for name in ("time", "position", "velocity", "attitude"):
            if not np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True):
                return f"{name} of the smoothed trajectory differs"
    return None


def parting(first: Sequence[Estimate], second: Sequence[Estimate]) -> str | None:
    """The first difference between two series of estimates, as text; None if they are equal."""
    for a, b in zip(first, second, strict=True):
        when = f"differs at {float(b.time):g} s"
        for name in ("time", "position", "velocity", "attitude", "covariance", "estimated"):
            x, y = getattr(a, name), getattr(b, name)
            if (x is None) != (y is None) or (x is not None and not np.array_equal(x, y, equal_nan=True)):
                return f"{name} {when}"
        if list(a.flagged) != list(b.flagged):
            return f"flagged {when}"
        for name in {**a.diagnostics, **b.diagnostics}:
            x, y = a.diagnostics.get(name), b.diagnostics.get(name)
            if x is None or y is None or not np.array_equal(x, y, equal_nan=True):
                return f"the diagnostic {name!r} {when}"
    return None


def digests(recording: Recording) -> dict[str, str]:
    """A digest of each part of what an estimator is given."""
    parts: dict[str, Any] = {
        "the initial state": recording.start,
        "the datasheets": (recording.instruments.imu, list(recording.instruments.values())),
        "the IMU samples": recording.data.imu,
    }
    parts |= {
        f"the measurements of {n}": (s.value, s.side) if s.channels else s.value for n, s in recording.data.aids.items()
    }
    return {name: hashlib.blake2b(pickle.dumps(part)).hexdigest() for name, part in parts.items()}
