"""What an estimator costs: one-second epochs of 100 IMU samples, everything included.

Run with ``pytest tests/benchmarks/test_bench_estimators.py --benchmark-enable`` (``make bench``).
"""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.estimators.rows.kalman import Ekf
from simnav.recording import Recording
from simnav.scenario import parse
from simnav.source import record
from simnav.types import Measurements

TOML = """
name = "bench"
version = 1
title = "IMU, GNSS, DVL, compass and depth at 1 Hz"
duration_s = 300.0
water_depth_m = 100.0
[start]
latitude_deg = 50.0
longitude_deg = -5.0
speed_m_s = 5.0
[vessel]
kind = "uuv"
[sea]
significant_height_m = 1.0
peak_period_s = 7.0
[instruments.imu]
rate_hz = 100.0
gyroscope = { bias_deg_h = 1.0, random_walk_deg_sqrt_h = 0.05 }
accelerometer = { bias_ug = 200.0, random_walk_ug_sqrt_hz = 50.0 }
[instruments.gnss]
kind = "gnss_position"
sigma_m = [1.5, 1.5, 3.0]
lever_arm_m = [2.0, 0.5, -5.0]
[instruments.dvl]
sigma_m_s = 0.02
lever_arm_m = [1.0, 0.0, 2.0]
[instruments.gyrocompass]
sigma_deg = 0.5
[instruments.depth]
sigma_m = 0.2
"""


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(parse(TOML), 0)


def epochs(estimator, recording: Recording):
    """A callable that runs the next epoch, beginning anew at the end."""
    steps: list[Measurements] = list(recording.steps())
    if estimator.reference:
        estimator.reveal(recording)
    estimator.reset(recording.start, recording.instruments)
    state = {"k": 0}

    def epoch() -> None:
        if state["k"] == len(steps):
            estimator.reset(recording.start, recording.instruments)
            state["k"] = 0
        state["result"] = estimator.update(steps[state["k"]])
        state["k"] += 1

    return epoch, state


@pytest.mark.parametrize("name", ["inertial", "ekf", "ship-ekf", "gnss-only", "dead-reckoning", "oracle"])
def test_epoch(benchmark, recording: Recording, name: str):
    """One epoch: 100 IMU samples, GNSS, DVL, compass, depth."""
    epoch, state = epochs(make(name), recording)
    benchmark.pedantic(epoch, rounds=290, warmup_rounds=5)
    assert np.isfinite(state["result"].covariance).all()
    if name == "ekf":
        assert state["result"].diagnostics["skipped"] == 0


def test_ekf_has_15_states_here(recording: Recording):
    estimator = Ekf()
    estimator.reset(recording.start, recording.instruments)
    assert estimator.model.size == 15


def test_update_without_propagation(benchmark, recording: Recording):
    """The same epoch once the IMU is preintegrated: four instruments, linearised and used."""
    estimator = Ekf()
    estimator.reset(recording.start, recording.instruments)
    steps = list(recording.steps())[:20]
    for step in steps:
        estimator.update(step)
    aids = steps[-1].aids
    covariance, model = estimator.covariance.copy(), estimator.model

    def update() -> None:
        estimator.covariance[:] = covariance
        estimator._use(aids, model.samples, model.time, [])

    benchmark(update)
    assert len(aids) == 4
