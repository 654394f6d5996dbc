"""Consistency of the Kalman solvers over 50 seeds on matched clean scenarios: ANEES within its 95 % band.

The realised biases of the IMU, which no recording holds, are read off the simulated IMU: the same seed and datasheet
without white noise, fed with zeros, delivers its turn-on bias and random walk, for each process has a stream of its
own.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from simnav import earth, rotation
from simnav.estimator import make
from simnav.scenario import Scenario, load
from simnav.source import record
from simnav.types import ImuSamples

SEEDS = 50
DURATION = 100.0
FILTERS = {
    "ekf": ("ekf", {}),
    "iekf": ("iekf", {}),
    "inekf": ("inekf", {}),
    "inekf, right": ("inekf", {"error": "right"}),
    "ekf-23": ("ekf-23", {"lever_arm": 0.0, "delay": 0.0}),
}
LINEAR = {"kf": ("kf", {}), "kf-23": ("kf-23", {"lever_arm": 0.0, "delay": 0.0})}
GROUPS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9), "biases": slice(9, 15)}


def open_sea() -> Scenario:
    """As it is: made for this, but the turn comes at once."""
    s = load("open-sea")
    return s.model_copy(update={"duration": DURATION, "manoeuvres": s.manoeuvres[1:]})


def uuv() -> Scenario:
    """The UUV of paper 003 without faults; its DVL draws a scale factor and a misalignment."""
    s = load("uuv-surface")
    dvl = s.instruments["dvl"].model_copy(update={"speed_noise": 0.0, "bias": (0.0, 0.0, 0.0)})
    changes = {"faults": (), "duration": DURATION, "instruments": {**s.instruments, "dvl": dvl}}
    return s.model_copy(update={**changes, "manoeuvres": s.manoeuvres[1:]})


def aligned() -> Scenario:
    """The open sea within the range of a linear filter: aligned to 0.05 degrees, accelerometers of 20 ug."""
    s = open_sea()
    imu, start = s.instruments["imu"], s.initial_error
    better = imu.accelerometer.model_copy(update={"bias": 0.1 * imu.accelerometer.bias})
    return s.model_copy(
        update={
            "initial_error": start.model_copy(update={"attitude": tuple(0.1 * x for x in start.attitude)}),
            "instruments": {**s.instruments, "imu": imu.model_copy(update={"accelerometer": better})},
        }
    )


def biases(scenario: Scenario, seed: int, time: np.ndarray) -> np.ndarray:
    """(T, 6) realised biases of gyroscopes and accelerometers."""
    spec = scenario.instruments["imu"]
    quiet = {n: getattr(spec, n).model_copy(update={"random_walk": 0.0}) for n in ("gyroscope", "accelerometer")}
    zeros = np.zeros((len(time), 3))
    real = spec.model_copy(update=quiet).build(seed).sense(ImuSamples(time, np.full(len(time), 1.0), zeros, zeros))
    return np.hstack([real.angular_rate, real.specific_force])


def nees(estimator, recording, true_bias: np.ndarray) -> dict[str, np.ndarray]:
    """Normalised estimation error squared of each group, every epoch."""
    estimator.reset(recording.start, recording.instruments)
    position, velocity, attitude, bias, covariance = [], [], [], [], []
    for packet in recording.steps():
        estimate = estimator.update(packet)
        position.append(estimate.position)
        velocity.append(estimate.velocity)
        attitude.append(estimate.attitude)
        bias.append(estimator.model.bias + (estimator.x[9:15] if hasattr(estimator, "x") else 0.0))
        covariance.append(estimator.covariance[:15, :15].copy())
    truth, P = recording.data.truth, np.array(covariance)
    turn = rotation.dcm_from_rpy(np.array(attitude)) @ np.swapaxes(rotation.dcm_from_rpy(truth.attitude), 1, 2)
    e = np.hstack([
        earth.relative_position(np.array(position), truth.position),
        np.array(velocity) - truth.velocity,
        rotation.rotation_vector_from_dcm(turn),
        np.array(bias) - true_bias,
    ])  # fmt: skip
    return {
        group: np.einsum("ti,ti->t", e[:, at], np.linalg.solve(P[:, at, at], e[:, at, None])[..., 0])
        for group, at in GROUPS.items()
    }


def anees(scenario: Scenario, filters: dict) -> dict[str, dict[str, np.ndarray]]:
    """By filter and group: NEES by epoch, averaged over seeds and divided by its dimension."""
    out = {name: dict.fromkeys(GROUPS, 0.0) for name in filters}
    for seed in range(SEEDS):
        recording = record(scenario, seed)
        true_bias = biases(scenario, seed, recording.data.truth.time)
        for name, (row, parameters) in filters.items():
            for group, values in nees(make(row, **parameters), recording, true_bias).items():
                out[name][group] = out[name][group] + values / (SEEDS * (GROUPS[group].stop - GROUPS[group].start))
    return out


def check(values: np.ndarray, group: str) -> None:
    """In the band on average, and at most epochs (of which 5 % may be outside by chance, in a row)."""
    d = GROUPS[group].stop - GROUPS[group].start
    low, high = chi2.ppf([0.025, 0.975], SEEDS * d) / (SEEDS * d)
    assert low < values.mean() < high
    assert np.mean((values > low) & (values < high)) > 0.8


@pytest.fixture(scope="module", params=[open_sea, uuv], ids=lambda f: f.__name__)
def feedback(request) -> dict[str, dict[str, np.ndarray]]:
    """Of the filters with feedback: one recording a seed for all of them."""
    return anees(request.param(), FILTERS)


@pytest.fixture(scope="module")
def linear() -> dict[str, dict[str, np.ndarray]]:
    """Of the filters without."""
    return anees(aligned(), LINEAR)


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("name", FILTERS)
def test_filters_with_feedback(feedback, name: str, group: str):
    check(feedback[name][group], group)


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("name", LINEAR)
def test_linear_filters_within_their_range(linear, name: str, group: str):
    check(linear[name][group], group)


def test_the_linear_filter_out_of_its_range():
    """Milli-g accelerometers: after 100 s free inertial navigation is off by 1 m/s, and velocity is not consistent."""
    assert anees(uuv(), {"kf": ("kf", {})})["kf"]["velocity"][-20:].mean() > 5.0
