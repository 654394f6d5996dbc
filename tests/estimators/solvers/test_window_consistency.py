"""The graphs agree with each other and with the filters, and promise what they hold.

Over 50 seeds of a matched clean scenario: marginalisation must not make the window optimistic, and on Gaussian data
it must not cost accuracy. Its window is short here, so that what it says is for the most part what left the window.
"""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimator import Estimator, make
from simnav.geometry import earth, rotation
from simnav.recording import Recording
from simnav.scenario import Scenario, load
from simnav.source import record
from simnav.types import NavigationStates
from tests.cases.realised import imu_biases

SEEDS = 50
GROUPS = {"position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9), "biases": slice(9, 15)}


def errors(states: NavigationStates, truth: NavigationStates) -> np.ndarray:
    """(T, 9) errors of position, velocity and attitude."""
    turn = rotation.dcm_from_rpy(states.attitude) @ np.swapaxes(rotation.dcm_from_rpy(truth.attitude), 1, 2)
    position = earth.relative_position(states.position, truth.position)
    return np.hstack([position, states.velocity - truth.velocity, rotation.rotation_vector_from_dcm(turn)])


def run(estimator: Estimator, recording: Recording) -> tuple[NavigationStates, np.ndarray, np.ndarray]:
    """States, biases (T, 6) and covariances (T, 15, 15) at the ends of the steps."""
    estimator.reset(recording.start, recording.instruments)
    estimates, biases, covariances = [], [], []
    for step in recording.steps():
        estimates.append(estimator.update(step))
        if hasattr(estimator, "chain"):
            model, covariance = estimator.chain.front, estimator.chain.predicted_covariance(estimator.covariance)
        else:
            model, covariance = estimator.model, estimator.covariance
        np.testing.assert_allclose(covariance[:9, :9], estimates[-1].covariance)
        biases.append(model.bias.copy())
        covariances.append(covariance[:15, :15].copy())
    states = NavigationStates(
        recording.data.truth.time,
        *(np.array([getattr(e, a) for e in estimates]) for a in ("position", "velocity", "attitude")),
    )
    return states, np.array(biases), np.array(covariances)


def both(scenario: Scenario) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Errors (50, T, 15) and covariances (50, T, 15, 15) of filter and window."""
    rows = {"ekf": {}, "sw-fgo": {"window": 5}}
    found = {row: ([], []) for row in rows}
    for seed in range(SEEDS):
        recording = record(scenario, seed)
        truth = recording.data.truth
        biases = imu_biases(scenario, seed, truth.time)
        for row, parameters in rows.items():
            states, estimated, covariance = run(make(row, **parameters), recording)
            found[row][0].append(np.hstack([errors(states, truth), estimated - biases]))
            found[row][1].append(covariance)
    return {row: (np.array(e), np.array(P)) for row, (e, P) in found.items()}


@pytest.fixture(scope="module")
def clean() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """On the open sea, which turns at once."""
    s = load("open-sea")
    return both(s.model_copy(update={"duration": 100.0, "manoeuvres": s.manoeuvres[1:]}))


@pytest.fixture(scope="module")
def disoriented() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """There without compass and GNSS velocity, the heading 15 degrees off, one sigma."""
    s = load("open-sea")
    tilt, _, _ = s.initial_error.attitude
    start = s.initial_error.model_copy(update={"attitude": (tilt, tilt, np.radians(15.0))})
    left = {k: v for k, v in s.instruments.items() if k not in ("gyrocompass", "gnss_velocity")}
    changes = {"duration": 60.0, "manoeuvres": s.manoeuvres[1:], "instruments": left, "initial_error": start}
    return both(s.model_copy(update=changes))


@pytest.mark.parametrize("group", GROUPS)
def test_the_window_is_consistent(clean, assert_consistent, group: str):
    e, P = clean["sw-fgo"]
    at = GROUPS[group]
    assert_consistent(e[..., at], P[..., at, at])


@pytest.mark.parametrize("group", GROUPS)
def test_the_window_is_consistent_where_a_filter_is_not(disoriented, assert_consistent, group: str):
    """The marginal prior keeps the linearisation it left the window with; that must not be the first guess."""
    e, P = disoriented["sw-fgo"]
    at = GROUPS[group]
    assert_consistent(e[..., at], P[..., at, at])
    if group == "attitude":
        e, P = (x[:, 1:10] for x in disoriented["ekf"])
        assert np.mean(e[..., at] * np.linalg.solve(P[..., at, at], e[..., at, None])[..., 0]) > 3.0


@pytest.mark.parametrize("group", GROUPS)
def test_on_gaussian_data_the_window_is_as_accurate_as_the_filter(clean, group: str):
    """The same RMSE within 2 %, the same promise within 1 %."""
    ours, theirs = clean["sw-fgo"], clean["ekf"]
    at = GROUPS[group]
    rmse = [np.sqrt(np.mean(e[..., at] ** 2, axis=(0, 1))) for e, _ in (ours, theirs)]

    np.testing.assert_allclose(*rmse, rtol=0.02)
    sigma = [np.sqrt(np.mean(np.diagonal(P, axis1=2, axis2=3)[..., at], axis=(0, 1))) for _, P in (ours, theirs)]
    np.testing.assert_allclose(*sigma, rtol=0.01)


def shortened(name: str, duration: float) -> Recording:
    return record(load(name).model_copy(update={"duration": duration}), 1)


@pytest.mark.parametrize(("name", "duration", "window"), [("auv-survey", 20.0, 20), ("open-sea", 15.0, 5)])
def test_simplified_equals_unsimplified(name: str, duration: float, window: int):
    """A node for every sample of the IMU, or one factor for all samples between two measurements.

    What is left is that transition matrix and noise are made in steps of 0.2 s or of a sample (0.01 s).
    """
    recording = shortened(name, duration)
    simplified, full = make("sw-fgo", window=window), make("fgo-unsimplified", window=window)
    a, bias_a, P = run(simplified, recording)
    b, bias_b, Q = run(full, recording)
    assert len(full.chain.nodes) > 45 * len(simplified.chain.nodes)
    apart = np.hstack([errors(b, a), bias_b - bias_a])
    sigma, other = (np.sqrt(np.diagonal(x, axis1=1, axis2=2)) for x in (P, Q))

    assert np.abs(apart / sigma).max() < 1e-3
    assert np.abs(apart[:, :3]).max() < 1e-4  # m
    assert np.abs(apart[:, 3:6]).max() < 1e-5  # m/s
    assert np.abs(apart[:, 6:9]).max() < 3e-6  # rad
    np.testing.assert_allclose(other, sigma, rtol=3e-4)


@pytest.mark.parametrize(("name", "duration"), [("open-sea", 80.0), ("auv-survey", 120.0)])
def test_the_full_graph_smooths_like_rts(name: str, duration: float):
    """The batch solution, linearised where it ends, and the smoother of a filter, linearised where that was then."""
    recording = shortened(name, duration)
    batch, rts = make("fgo-full"), make("ekf-rts")
    for estimator in (batch, rts):
        run(estimator, recording)
    a, b = batch.smooth(), rts.smooth()
    sigma, other = (np.sqrt(np.diagonal(e.smoothed_covariance, axis1=1, axis2=2)) for e in (rts, batch))
    apart = np.abs(errors(a, b) / sigma)

    assert apart.max() < 0.03
    np.testing.assert_allclose(other, sigma, rtol=0.02)
    filtered = run(make("ekf"), recording)[0]
    assert np.abs(errors(filtered, b) / sigma)[:, :6].max() > 2.0  # and not because nothing was to be done
