"""Fixtures for tests of estimators: recordings, and the benchmark of an epoch.

A test suite asks for them in its ``conftest.py`` or in a test module::

    pytest_plugins = ["simnav.testing.fixtures"]

They are not registered by the entry point ``pytest11``. pytest imports the plugins of that group in every test run of
the environment, also for other projects. These runs would then import simnav and Gymnasium, and see its fixtures.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import pytest

from simnav import scenario, source
from simnav.estimator import Estimator
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.testing import contract_check

__all__ = ["BenchmarkEpochs", "RecordingOf", "benchmark_epochs", "contract_recording", "recording_of"]


class RecordingOf(Protocol):
    """The type of the fixture `recording_of`."""

    def __call__(self, given: str | Path | Scenario, seed: int = 0, duration: float | None = None) -> Recording:
        """Record a scenario, see the fixture."""


class BenchmarkEpochs(Protocol):
    """The type of the fixture `benchmark_epochs`."""

    def __call__(
        self, make_estimator: Callable[[], Estimator], recording: Recording | None = None, epochs: int = 60
    ) -> Estimator:
        """Time the epochs of an estimator, see the fixture."""


@pytest.fixture(scope="session")
def _recordings() -> dict[tuple[Any, ...], Recording]:
    """The recordings that were made in this session."""
    return {}


@pytest.fixture
def recording_of(_recordings: dict[tuple[Any, ...], Recording]) -> RecordingOf:
    """A function that records a scenario: ``recording_of("open-sea", seed=1, duration=60.0)``.

    The scenario is a name, a TOML file or a `simnav.Scenario`; ``duration`` [s] shortens it. A recording is made once
    in a session, and every call returns a copy, so that a test may change it.
    """

    def recording_of(given: str | Path | Scenario, seed: int = 0, duration: float | None = None) -> Recording:
        key = (given.model_dump_json() if isinstance(given, Scenario) else str(given), seed, duration)
        if key not in _recordings:
            chosen = given if isinstance(given, Scenario) else scenario.load(given)
            if duration is not None:
                chosen = chosen.model_copy(update={"duration": min(float(duration), chosen.duration)})
            _recordings[key] = source.record(chosen, seed)
        return copy.deepcopy(_recordings[key])

    return recording_of


@pytest.fixture
def contract_recording(_recordings: dict[tuple[Any, ...], Recording]) -> Recording:
    """The recording of the contract test: a minute with one instrument of every kind. Each test gets a copy."""
    key = ("the contract test",)
    if key not in _recordings:
        _recordings[key] = contract_check.contract_recording(0)
    return copy.deepcopy(_recordings[key])


@pytest.fixture
def benchmark_epochs(request: pytest.FixtureRequest, recording_of: RecordingOf) -> BenchmarkEpochs:
    """A function that times the epochs of an estimator with pytest-benchmark: ``benchmark_epochs(make_estimator)``.

    A round is one epoch. The first third of the epochs is not timed: kernels are loaded and windows filled. The
    default recording is the first minute of ``open-sea``. It returns the estimator. Without pytest-benchmark the test
    is skipped.
    """
    if not request.config.pluginmanager.hasplugin("benchmark"):
        pytest.skip("pytest-benchmark is not installed: pip install pytest-benchmark")
    benchmark = request.getfixturevalue("benchmark")

    def benchmark_epochs(
        make_estimator: Callable[[], Estimator], recording: Recording | None = None, epochs: int = 60
    ) -> Estimator:
        if recording is None:
            recording = recording_of("open-sea", duration=float(epochs))
        steps = list(itertools.islice(recording.steps(), epochs))
        if len(steps) < 3:
            raise ValueError(f"the recording has {len(steps)} epochs; at least 3 are wanted")
        estimator = make_estimator()
        if estimator.reference:
            estimator.reveal(recording)
        estimator.reset(recording.start, recording.instruments)
        warm = len(steps) // 3
        for packet in steps[:warm]:
            estimator.update(packet)
        rest = iter(steps[warm:])
        benchmark.pedantic(lambda: estimator.update(next(rest)), rounds=len(steps) - warm)
        return estimator

    return benchmark_epochs
