"""What an adaptation costs: every row beside the plain EKF, over two minutes of the open sea (four instruments).

Compared are whole updates, the IMU's second included. The plain EKF takes a measurement in one kernel; a filter that
adapts takes it in two, with the adaptation in Python between them. At least a third of what the rows cost beyond the
plain filter is that division: see ``fading-ekf``, which only multiplies P by a number.
"""

from __future__ import annotations

import time

import numpy as np
import pytest

from simnav.estimator import Estimator, make
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record

ROWS = (
    "sage-husa", "sage-husa-paper", "iae", "iae-fixed", "rae", "adkf", "adkf-paper", "igg3", "huber-kf", "gated-ekf",
    "fading-ekf", "vb-akf", "mckf", "imm",
)  # fmt: skip


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load("open-sea").model_copy(update={"duration": 120.0}), 1)


def run(estimator: Estimator, recording: Recording) -> float:
    """Median seconds of an update."""
    estimator.reset(recording.start, recording.instruments)
    seconds = []
    for packet in recording.steps():
        begun = time.perf_counter()
        estimator.update(packet)
        seconds.append(time.perf_counter() - begun)
    return float(np.median(seconds))


@pytest.mark.benchmark(group="adaptations")
@pytest.mark.parametrize("name", ["ekf", *ROWS])
def test_two_minutes_at_sea(benchmark, recording: Recording, name: str):
    estimator = make(name)
    run(estimator, recording)  # compile
    median = benchmark(run, estimator, recording)
    if benchmark.enabled:
        benchmark.extra_info["us_per_epoch"] = 1e6 * median
    assert median > 0.0


@pytest.mark.benchmark(group="adaptations-side-by-side")
def test_within_twice_the_plain_filter(benchmark, recording: Recording):
    """All rows take turns, update by update, so that the machine is the same for all: the least of several voyages."""
    rows = {name: make(name) for name in ("ekf", *ROWS)}
    costs = {name: np.full(sum(1 for _ in recording.steps()), np.inf) for name in rows}

    def voyage_of_all() -> None:
        for estimator in rows.values():
            estimator.reset(recording.start, recording.instruments)
        for k, packet in enumerate(recording.steps()):
            for name, estimator in rows.items():
                begun = time.process_time()
                estimator.update(packet)
                costs[name][k] = min(costs[name][k], time.process_time() - begun)

    for _ in range(3):
        voyage_of_all()
    benchmark.pedantic(voyage_of_all, rounds=2)
    medians = {name: float(np.median(cost)) for name, cost in costs.items()}
    ratios = {name: round(medians[name] / medians["ekf"], 2) for name in ROWS}
    if benchmark.enabled:
        benchmark.extra_info.update(ratios)
        benchmark.extra_info["ekf_us"] = 1e6 * medians["ekf"]
    slow = {name: r for name, r in ratios.items() if r > (2.2 if benchmark.enabled else 4.0)}
    assert not slow, slow
