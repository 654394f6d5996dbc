"""What smoothing costs: all 6000 s of coastal-voyage, and the graphs with and without the equivalent IMU factor.

Run with ``pytest tests/benchmarks/test_bench_smoother.py --benchmark-enable`` (``make bench``).
"""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from simnav.estimator import Estimator, make
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Measurements

SMOOTHERS = ["ekf-rts", "ekf-two-filter"]


@pytest.fixture(scope="module")
def steps(request) -> tuple[Recording, list[Measurements]]:
    """The whole voyage where benchmarks are measured, a piece of it where they are only tried."""
    measured = request.config.getoption("benchmark_enable")
    scenario = load("coastal-voyage")
    recording = record(scenario if measured else scenario.model_copy(update={"duration": 60.0}), 0)
    return recording, list(recording.steps())


def forward(estimator: Estimator, recording: Recording, steps: list[Measurements]) -> Estimator:
    """Run the filter."""
    estimator.reset(recording.start, recording.instruments)
    for step in steps:
        estimator.update(step)
    return estimator


@pytest.mark.parametrize("name", ["ekf", *SMOOTHERS])
def test_filter_and_smoother(benchmark, steps, name: str):
    """Forward and back, all included."""
    benchmark.group = "run of 6000 s: filter and smoother"

    def run() -> int:
        estimator = forward(make(name), *steps)
        smoothed = estimator.smooth()
        return 0 if smoothed is None else len(smoothed.time)

    smoothed = benchmark.pedantic(run, rounds=3, warmup_rounds=1)
    assert smoothed == (len(steps[1]) if name in SMOOTHERS else 0)


@pytest.mark.parametrize("name", SMOOTHERS)
def test_smoother_alone(benchmark, steps, name: str):
    """The way back, and its memory (extra_info) with what the filter stored for it."""
    benchmark.group = "run of 6000 s: smoother alone"
    forward(make(name), steps[0], steps[1][:10])
    tracemalloc.start()
    estimator = forward(make(name), *steps)
    stored = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak()
    estimator.smooth()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    smoothed = benchmark.pedantic(estimator.smooth, rounds=5)
    assert np.isfinite(smoothed.position).all()
    benchmark.extra_info["stored_MB"], benchmark.extra_info["peak_MB"] = stored / 1e6, peak / 1e6
    stops = estimator.smoother.stops
    benchmark.extra_info["us_per_stop"] = 1e6 * benchmark.stats.stats.min / stops if benchmark.enabled else 0
    assert stored < 2e4 * stops + 2e7  # B


@pytest.mark.parametrize("name", ["fgo-simplified", "fgo-unsimplified"])
def test_equivalent_imu_factor(benchmark, name: str):
    """The AUV smoothing paper (2022): 15 one-second epochs of the AUV's survey, in a window of 5, with and without."""
    benchmark.group = "15 epochs, window of 5: a node per measurement, or per IMU sample"
    recording = record(load("auv-survey").model_copy(update={"duration": 15.0}), 0)
    steps = list(recording.steps())
    estimator = benchmark.pedantic(lambda: forward(make(name, window=5), recording, steps), rounds=3, warmup_rounds=1)
    nodes = len(estimator.chain.nodes)
    benchmark.extra_info["nodes"] = nodes
    if benchmark.enabled:
        benchmark.extra_info["ms_per_epoch"] = 1e3 * benchmark.stats.stats.min / len(steps)
    assert nodes <= 15 if name == "fgo-simplified" else nodes >= 500
