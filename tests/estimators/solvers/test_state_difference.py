"""The difference of estimates: that by which one was displaced, and zero for what one of them lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from simnav.estimators.solvers.state_difference import difference, differences, mean_of
from simnav.types import Estimate
from tests.cases.displaced import displaced

OTHER = Estimate(3.0, np.array([0.9, 0.2, 4.0]), np.array([3.0, -1.0, 0.1]), np.array([0.02, -0.01, 2.0]), np.eye(9))


def test_many_at_a_time_have_the_bits_of_each_by_itself():
    rng = np.random.default_rng(4)
    errors = rng.standard_normal((8, 9)) * np.repeat((5.0, 0.3, 0.02), 3)
    displaced_ones = [displaced(OTHER, error, np.eye(9)) for error in errors]
    found = differences(displaced_ones, OTHER)
    np.testing.assert_allclose(found, errors, rtol=1e-5, atol=1e-8)
    np.testing.assert_array_equal(found, [difference(one, OTHER) for one in displaced_ones])


def test_what_one_of_them_lacks_is_zero():
    moved = displaced(OTHER, np.ones(9), np.eye(9))
    lacking = [replace(moved, velocity=None), replace(moved, position=None, attitude=None), moved]
    found = differences(lacking, OTHER) != 0.0
    np.testing.assert_array_equal(found[:, ::3], [[True, False, True], [False, True, False], [True, True, True]])
    np.testing.assert_array_equal(differences([moved], replace(OTHER, attitude=None))[0, 6:], 0.0)


def test_attitudes_differ_by_the_rotation_between_them():
    rng = np.random.default_rng(6)
    for one, other in rng.uniform(-1.0, 1.0, (40, 2, 3)) * (np.pi, 0.5 * np.pi, np.pi):
        found = difference(replace(OTHER, attitude=one), replace(OTHER, attitude=other))
        between = Rotation.from_euler("ZYX", one[::-1]) * Rotation.from_euler("ZYX", other[::-1]).inv()
        np.testing.assert_allclose(found[6:], between.as_rotvec(), atol=1e-9)
        np.testing.assert_array_equal(found[:6], 0.0)
        back = displaced(replace(OTHER, attitude=other), found, np.eye(9))
        np.testing.assert_allclose(back.attitude, one, atol=1e-9)


def test_a_mean_has_the_spread_of_its_parts():
    error = np.array([3.0, -4.0, 1.0, 0.2, 0.1, -0.1, 0.0, 0.0, 0.02])
    moved, weights = displaced(OTHER, error, 4.0 * np.eye(9)), np.array([0.25, 0.75])
    mean = mean_of([OTHER, moved], weights)
    np.testing.assert_allclose(difference(mean, OTHER), 0.75 * error, rtol=1e-5, atol=1e-8)
    spread = 0.25 * 0.75 * np.outer(error, error)
    np.testing.assert_allclose(mean.covariance, 3.25 * np.eye(9) + spread, rtol=1e-5, atol=1e-7)
    assert mean_of([replace(OTHER, velocity=None)] * 2, weights).velocity is None
