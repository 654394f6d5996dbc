"""The linear error-state filter: open loop, linear in the measurements, and the EKF where errors are small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from simnav import strapdown
from simnav.estimator import make
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.rows.kalman import Kf
from simnav.geometry import earth, rotation
from simnav.types import ImuDatasheet, TriadDatasheet

DEG = np.pi / 180.0


def moved(recording, name: str, offset: np.ndarray):
    """The recording with something added to all values of an instrument."""
    stream = recording.data.aids[name]
    aids = {**recording.data.aids, name: replace(stream, value=stream.value + offset)}
    return replace(recording, data=replace(recording.data, aids=aids))


def corrections(recording) -> np.ndarray:
    """The filter's correction after every step."""
    estimator = Kf()
    estimator.reset(recording.start, recording.instruments)
    out = []
    for packet in recording.steps():
        estimator.update(packet)
        out.append(estimator.x.copy())
    return np.array(out)


def test_it_is_linear_in_the_measurements(recording_of):
    """Twice the disturbance of a measurement has twice the effect, to rounding; the EKF has not this property."""
    recording = recording_of(1, 60.0)
    offset = np.array([0.5, -0.2, 0.1])
    none, once, twice = (corrections(moved(recording, "dvl", k * offset)) for k in (0.0, 1.0, 2.0))
    scale = np.abs(once - none).max(axis=0)
    assert scale[:9].min() > 0.0
    np.testing.assert_allclose((twice - none) / scale, 2.0 * (once - none) / scale, atol=1e-9)


def test_nothing_is_fed_back(recording_of):
    """The model's own trajectory is free inertial navigation, and its biases stay zero."""
    recording = recording_of(2, 60.0)
    estimator = Kf()
    estimator.reset(recording.start, recording.instruments)
    for packet in recording.steps():
        estimate = estimator.update(packet)
    start = recording.start
    free = strapdown.integrate(start.position, start.velocity, start.attitude, recording.data.imu)
    model = estimator.model
    assert np.linalg.norm(earth.relative_position(model.position, free.position[-1])) < 1e-3
    np.testing.assert_allclose(model.velocity, free.velocity[-1], atol=1e-4)
    assert not model.bias.any()
    # The output is corrected by the whole error.
    offset = earth.relative_position(estimate.position, model.position)
    np.testing.assert_allclose(offset, estimator.x[:3], rtol=1e-5, atol=1e-6)
    assert estimate.diagnostics["nominal_error"] == pytest.approx(np.linalg.norm(estimator.x[:3]))


def test_small_errors_give_the_ekf(recording_of, run_over):
    """With an IMU that is good for the time, both agree to a small part of sigma, and so do their covariances."""
    good = ImuDatasheet(
        50.0,
        TriadDatasheet(bias=0.01 * DEG / 3600, random_walk=0.001 * DEG / 60),
        TriadDatasheet(bias=1e-4, random_walk=1e-5),
    )
    sigmas = np.array([1.0, 1.0, 1.0, 0.02, 0.02, 0.02, 1e-4, 1e-4, 2e-4])
    recording = recording_of(3, 120.0, imu=good, sigmas=sigmas)
    a, P = run_over(make("ekf"), recording)
    b, Q = run_over(make("kf"), recording)
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert np.abs((a - b) / sigma).max() < 0.02
    np.testing.assert_allclose(np.diagonal(Q, axis1=1, axis2=2), np.diagonal(P, axis1=1, axis2=2), rtol=0.01)


def test_an_error_is_carried_like_the_state(recording_of):
    """`carry` against the propagation of a state that has that error."""
    recording = recording_of(4, 10.0)
    e = np.concatenate([[10.0, -5.0, 3.0, 0.1, 0.2, -0.1, 1e-4, -2e-4, 1e-4], 1e-6 * np.ones(3), 1e-4 * np.ones(3)])
    ends = []
    for sign in (0.0, 1.0):
        model = InertialModel(calibrate=False)
        P = model.begin(recording.start, recording.instruments)
        model.correct(sign * e)
        model.load(recording.data.imu)
        model.propagate(P, 3.3)
        ends.append(model)
    carried = e.copy()
    ends[0].carry(carried, 3.3)
    a, b = ends
    np.testing.assert_allclose(earth.relative_position(b.position, a.position), carried[:3], rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(b.velocity - a.velocity, carried[3:6], rtol=2e-3, atol=1e-5)
    turn = rotation.rotation_vector_from_dcm(b.dcm @ a.dcm.T)
    np.testing.assert_allclose(turn, carried[6:9], rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(b.bias - a.bias, carried[9:15], rtol=1e-9)
