"""Rotations, against scipy.spatial.transform."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from simnav.geometry import rotation

angles = st.floats(-3.1, 3.1)
vectors = st.tuples(*[st.floats(-1.8, 1.8)] * 3).map(np.array)


@given(angles, st.floats(-1.56, 1.56), angles)
def test_rpy_agrees_with_scipy_and_returns(roll, pitch, yaw):
    rpy = np.array([roll, pitch, yaw])
    dcm = rotation.dcm_from_rpy(rpy)
    np.testing.assert_allclose(dcm, Rotation.from_euler("ZYX", rpy[::-1]).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(rotation.dcm_from_rpy(rotation.rpy_from_dcm(dcm)), dcm, atol=1e-14)


@given(vectors)
def test_rotation_vector_agrees_with_scipy_and_returns(vector):
    dcm = rotation.dcm_from_rotation_vector(vector)
    np.testing.assert_allclose(dcm, Rotation.from_rotvec(vector).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(rotation.rotation_vector_from_dcm(dcm), Rotation.from_matrix(dcm).as_rotvec(), atol=1e-9)


@pytest.mark.parametrize("axis", np.eye(3))
def test_rotation_vector_is_accurate_near_pi_and_near_zero(axis):
    for angle in (np.pi - 1e-9, np.pi - 1e-5, 1e-9, 0.0):
        back = rotation.rotation_vector_from_dcm(rotation.dcm_from_rotation_vector(angle * axis))
        np.testing.assert_allclose(back, angle * axis, atol=2e-15 * max(1.0, angle))


def test_quaternion_returns_for_all_branches():
    rotations = Rotation.random(200, random_state=1)
    dcm = np.concatenate([rotations.as_matrix(), [np.diag(d) for d in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1])]])
    q = rotation.quaternion_from_dcm(dcm)
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-15)
    np.testing.assert_allclose(Rotation.from_quat(q, scalar_first=True).as_matrix(), dcm, atol=1e-14)


@given(vectors, vectors)
def test_skew_is_the_cross_product(a, b):
    np.testing.assert_allclose(rotation.skew(a) @ b, np.cross(a, b), atol=1e-15)


def test_wrap_angle():
    wrapped = rotation.wrap_angle(np.array([np.pi, -np.pi, 7.0, -7.0, 0.0]))
    np.testing.assert_allclose(wrapped, [-np.pi, -np.pi, 7 - 2 * np.pi, 2 * np.pi - 7, 0.0])
