"""What a one-second epoch of the Kalman filters costs, with and without the IMU's share.

One epoch: 100 IMU samples, GNSS position and velocity, a DVL half a second earlier, a gyrocompass: four measurements at
two times. "Update only" is the epoch's end without the IMU: one GNSS position, the increments being summed up.
"""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import make
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.types import Measurement

ROWS = ("kf", "ekf", "iekf", "inekf", "ekf-9", "kf-23", "ekf-23")


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load("open-sea").model_copy(update={"duration": 120.0}), 1)


@pytest.mark.benchmark(group="kalman epoch")
@pytest.mark.parametrize("row", ROWS)
def test_epoch(benchmark, recording: Recording, row: str):
    """A whole update, averaged over a run."""
    steps = list(recording.steps())

    def run():
        estimator = make(row)
        estimator.reset(recording.start, recording.instruments)
        for packet in steps:
            estimate = estimator.update(packet)
        return estimate

    estimate = benchmark(run)
    if benchmark.enabled:
        benchmark.extra_info["us_per_epoch"] = 1e6 * benchmark.stats.stats.min / len(steps)
    assert np.isfinite(estimate.position).all()


@pytest.mark.benchmark(group="kalman update only")
@pytest.mark.parametrize("row", ["ekf", "ekf-23"])
@pytest.mark.parametrize("kind", ["gnss_position", "dvl"])
def test_update_only(benchmark, recording: Recording, row: str, kind: str):
    """Covariance propagation with given increments, and one measurement."""
    from simnav.estimators.models.covariance_propagation import propagate_covariance

    estimator = make(row)
    estimator.reset(recording.start, recording.instruments)
    for packet in list(recording.steps())[:60]:
        estimator.update(packet)
    model, covariance = estimator.model, estimator.covariance
    measurement: Measurement = next(m for m in packet.aids if m.kind == kind)
    state, before = model.snapshot(), covariance.copy()
    none = np.zeros(len(model.calibration))

    def update():
        model.restore(state)
        covariance[:] = before
        propagate_covariance(covariance, model.transition, model.process_noise, model.calibration, none, none, 1.0)
        estimator._use([measurement], model.samples, model.time, [])

    benchmark(update)
    assert np.trace(covariance[:3, :3]) <= np.trace(before[:3, :3]) * 1.5
