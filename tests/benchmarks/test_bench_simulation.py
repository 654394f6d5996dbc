"""Speed of simulation and inertial navigation, python-ins beside it in the same run.

Samples per second are in ``extra_info``; the peer does less (no IMU error but bias and white noise, no vessel, sea
or taps).
"""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pyins.inertial_sensor
import pyins.sim
import pyins.strapdown
import pytest

from simnav.scenario import Scenario, load
from simnav.simulation.simulator import simulate, simulate_many
from simnav.strapdown import integrate
from simnav.types import Array

SECONDS = 1200.0


@pytest.fixture(scope="module")
def voyage() -> Scenario:
    """The IMU alone: truth, sea state and all IMU errors."""
    scenario = load("coastal-voyage")
    assert scenario.sea is not None
    only_imu = {"imu": scenario.instruments["imu"], "gnss": scenario.instruments["gnss"]}
    return scenario.model_copy(update={"duration": SECONDS, "instruments": only_imu, "faults": ()})


def rate(benchmark, samples: float) -> None:
    if benchmark.stats:
        benchmark.extra_info["million samples per second"] = samples / benchmark.stats.stats.median / 1e6


@pytest.mark.benchmark(group="simulate IMU samples")
def test_simulate_own_truth(benchmark, voyage):
    simulate(voyage, 0)
    recording = benchmark(simulate, voyage, 1)
    rate(benchmark, len(recording.data.imu))
    assert len(recording.data.imu) == SECONDS * 100


@pytest.mark.benchmark(group="simulate IMU samples")
def test_simulate_shared_truth(benchmark, voyage):
    """Per run, where all runs share one truth that is there already."""
    shared = simulate_many(voyage.model_copy(update={"world_seed": 1}), range(10**6))
    next(shared)
    recording = benchmark.pedantic(lambda: next(shared), rounds=12)
    rate(benchmark, len(recording.data.imu))
    assert len(recording.data.imu) == SECONDS * 100


@pytest.mark.benchmark(group="simulate IMU samples")
def test_simulate_python_ins(benchmark, voyage):
    truth = simulate(voyage.model_copy(update={"step": 0.01, "duration": 60.0}), 1).data.truth
    parameters = pyins.inertial_sensor.Parameters.from_EstimationModel(
        pyins.inertial_sensor.EstimationModel(bias_sd=1e-5, noise=1e-5), 0
    )

    def peer() -> Array:
        _, imu = pyins.sim.generate_imu(
            truth.time,
            np.column_stack([np.degrees(truth.position[:, :2]), truth.position[:, 2]]),
            np.degrees(np.unwrap(truth.attitude, axis=0)),
            truth.velocity,
            sensor_type="increment",
        )
        gyro = parameters.apply(imu[["gyro_x", "gyro_y", "gyro_z"]], "increment")
        accelerometer = parameters.apply(imu[["accel_x", "accel_y", "accel_z"]], "increment")
        return np.hstack([gyro, accelerometer])

    samples = benchmark.pedantic(peer, rounds=5, warmup_rounds=1)
    rate(benchmark, len(samples))
    assert len(samples) == 6000


@pytest.mark.benchmark(group="simulate a whole voyage")
def test_simulate_6000_s_with_all_instruments(benchmark):
    """100 Hz IMU, every kind of aiding instrument, four faults."""
    scenario, survey = load("coastal-voyage"), load("auv-survey")
    ship = load("ship-dead-reckoning")
    aids = {**survey.aids, **ship.aids, "gnss_velocity": load("open-sea").instruments["gnss_velocity"]}
    scenario = scenario.model_copy(update={"instruments": {**scenario.instruments, **aids, **scenario.aids}})
    assert len({spec.kind for spec in scenario.aids.values()}) == 8
    simulate(scenario, 0)
    recording = benchmark.pedantic(simulate, (scenario, 1), rounds=5)
    rate(benchmark, len(recording.data.imu))
    assert recording.duration == 6000.0


@pytest.mark.benchmark(group="integrate IMU samples")
def test_integrate(benchmark, voyage):
    recording = simulate(voyage, 1)
    start = recording.initial_truth
    states = benchmark(integrate, start.position[0], start.velocity[0], start.attitude[0], recording.data.imu)
    rate(benchmark, len(states))
    assert np.isfinite(states.position).all()


@pytest.mark.benchmark(group="integrate IMU samples")
def test_integrate_python_ins(benchmark, voyage):
    recording = simulate(voyage, 1)
    imu, start = recording.data.imu, recording.initial_truth
    dt = imu.interval[:, None]
    readings = pd.DataFrame(
        np.hstack([imu.angular_rate * dt, imu.specific_force * dt]),
        index=imu.time,
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    readings = pd.concat([readings.iloc[:1].set_axis([0.0]), readings])
    pva = pd.Series(
        [
            *np.degrees(start.position[0, :2]),
            start.position[0, 2],
            *start.velocity[0],
            *np.degrees(start.attitude[0]),
        ],
        index=["lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=0.0,
    )

    def peer() -> pd.DataFrame:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            increments = pyins.strapdown.compute_increments_from_imu(readings, "increment")
            return pyins.strapdown.Integrator(pva).integrate(increments)

    states = benchmark.pedantic(peer, rounds=5, warmup_rounds=1)
    rate(benchmark, len(states))
    assert np.isfinite(states.to_numpy()).all()
