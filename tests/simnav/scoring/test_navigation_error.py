"""Errors against independent computations: Earth-centred coordinates, known rotations, missing components."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from simnav.recording import Recording
from simnav.scoring import errors, smoothed_errors
from simnav.scoring.navigation_error import attitude_error, state_errors
from simnav.types import NavigationStates

ALL = np.ones((1, 9), dtype=bool)


def earth_centred(position: np.ndarray) -> np.ndarray:
    """Textbook conversion to Earth-centred Cartesian coordinates, WGS-84."""
    latitude, longitude, height = position
    e2 = 6.69437999014e-3
    n = 6378137.0 / np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    return np.array(
        [
            (n + height) * np.cos(latitude) * np.cos(longitude),
            (n + height) * np.cos(latitude) * np.sin(longitude),
            (n * (1.0 - e2) + height) * np.sin(latitude),
        ]
    )


def one(position: Any = (0.0, 0.0, 0.0), attitude: Any = (0.0, 0.0, 0.0)) -> NavigationStates:
    return NavigationStates(np.zeros(1), np.array([position]), np.zeros((1, 3)), np.array([attitude]))


def test_chosen_errors_come_back(recording: Recording, make_trial: Any) -> None:
    rng = np.random.default_rng(1)
    wanted = rng.normal(0.0, [30.0] * 3 + [1.0] * 3 + [0.5] * 3, (100, 9))
    found = errors(make_trial(recording, wanted), recording)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=2e-9)  # a nanometre of latitude is rounding


@given(
    st.floats(-1.4, 1.4),
    st.floats(-3.2, 3.2),
    st.floats(-100, 3000),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
)
def test_position_error_agrees_with_cartesian_coordinates(
    latitude: float, longitude: float, height: float, offset: list[float]
) -> None:
    truth = np.array([latitude, longitude, height])
    estimate = truth + np.array([offset[0] / 6.36e6, offset[1] / 6.38e6 / np.cos(latitude), -offset[2]])
    found = state_errors(one(estimate), one(truth), ALL)[0, :3]
    s, c, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    axes = np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])
    # Curvature over 50 m, tan(latitude) included, is the only difference.
    np.testing.assert_allclose(found, axes @ (earth_centred(estimate) - earth_centred(truth)), atol=5e-3)


def test_longitude_wraps_at_the_date_line() -> None:
    found = state_errors(one([0.0, -np.pi + 1e-7, 0.0]), one([0.0, np.pi - 1e-7, 0.0]), ALL)
    assert found[0, 1] == pytest.approx(2e-7 * 6378137.0, rel=1e-6)


@given(
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1),
    st.floats(0.0, np.pi - 1e-6),
    st.lists(st.floats(-1.5, 1.5), min_size=3, max_size=3),
)
def test_attitude_error_is_the_rotation_vector(axis: list[float], angle: float, rpy: list[float]) -> None:
    vector = angle * np.array(axis) / np.linalg.norm(axis)
    true = Rotation.from_euler("ZYX", rpy[::-1])
    estimate = (Rotation.from_rotvec(vector) * true).as_euler("ZYX")[::-1]
    np.testing.assert_allclose(attitude_error(estimate[None], np.array([rpy]))[0], vector, atol=1e-7)


def test_an_attitude_error_of_pi_has_length_pi() -> None:
    found = attitude_error(np.array([[0.0, 0.0, np.pi], [np.pi, 0.0, 0.0]]), np.zeros((2, 3)))
    np.testing.assert_allclose(np.abs(found), [[0.0, 0.0, np.pi], [np.pi, 0.0, 0.0]], atol=1e-12)


def test_heading_alone_is_the_difference_of_headings() -> None:
    mask = np.array([[False, False, True]])
    truth = np.array([[0.3, -0.2, 3.0]])
    for rest in (np.nan, 0.0):  # whatever the estimator puts in what it does not estimate
        found = attitude_error(np.array([[rest, rest, -3.0]]), truth, mask)
        np.testing.assert_allclose(found, [[np.nan, np.nan, 2.0 * np.pi - 6.0]], atol=1e-12)


def test_a_reference_with_heading_only_gives_the_heading_error() -> None:
    found = attitude_error(np.array([[0.1, 0.2, 0.5]]), np.array([[np.nan, np.nan, 0.4]]))
    np.testing.assert_allclose(found, [[np.nan, np.nan, 0.1]], atol=1e-12)


def test_level_without_heading_is_compared_at_the_same_heading() -> None:
    mask = np.array([[True, True, False]])
    truth = np.array([[0.0, 0.0, np.pi / 2]])
    found = attitude_error(np.array([[0.01, 0.0, np.nan]]), truth, mask)
    np.testing.assert_allclose(found, [[0.0, 0.01, np.nan]], atol=1e-12)  # roll on an eastern heading is about east


def test_a_reference_without_height_or_velocity_leaves_the_rest(recording: Recording, make_trial: Any) -> None:
    truth = recording.data.truth
    trial = make_trial(recording, [3.0, 4.0, 5.0, 0.1, 0.2, 0.3, 0.0, 0.0, 0.01])
    position, velocity = truth.position.copy(), np.full_like(truth.velocity, np.nan)
    position[:, 2] = np.nan
    position[7] = np.nan  # a gap
    partial = NavigationStates(truth.time, position, velocity, truth.attitude)
    found = errors(trial, replace(recording, data=replace(recording.data, truth=partial)))
    np.testing.assert_allclose(found[0, :2], [3.0, 4.0], rtol=1e-4)  # radii at height 0 instead of -20 m
    assert np.isnan(found[:, 2:6]).all()
    assert np.isnan(found[7, :3]).all()
    assert np.isfinite(found[:, 6:]).all()


def test_what_is_not_estimated_is_nan(recording: Recording, make_trial: Any) -> None:
    mask = np.ones((100, 9), dtype=bool)
    mask[:, 2] = mask[50:, 0] = False
    found = errors(make_trial(recording, np.ones(9), estimated=mask), recording)
    np.testing.assert_array_equal(np.isfinite(found), mask)


def test_a_trial_of_another_recording_is_refused(recording: Recording, make_trial: Any, make_recording: Any) -> None:
    trial = make_trial(recording, np.zeros(9))
    with pytest.raises(ValueError, match="was not run on this recording of tiny-v1"):
        errors(trial, make_recording(steps=50))
    with pytest.raises(ValueError, match="was not run on this recording"):
        errors(replace(trial, time=trial.time + 0.5), recording)


def test_smoothed_errors(recording: Recording, make_trial: Any) -> None:
    trial = make_trial(recording, np.full(9, 0.1))
    assert smoothed_errors(trial, recording) is None
    better = make_trial(recording, np.full(9, 0.05))
    trial = replace(trial, smoothed=NavigationStates(better.time, better.position, better.velocity, better.attitude))
    found = smoothed_errors(trial, recording)
    assert found is not None
    np.testing.assert_allclose(found, 0.05, atol=2e-9)
    nothing = np.zeros((100, 9), dtype=bool)  # an estimator that only smooths
    found = smoothed_errors(replace(trial, estimated=nothing), recording)
    assert found is not None
    np.testing.assert_allclose(found, 0.05, atol=2e-9)
