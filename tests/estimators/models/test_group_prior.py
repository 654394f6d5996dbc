"""The prior of a window on the group SE_2(3), against matrix logarithms, and what it is for."""

import numpy as np
import pytest
from scipy.linalg import logm

from simnav.estimator import EstimatorError, make
from simnav.estimators.models.group_prior import at_mean, at_node
from simnav.geometry.rotation import dcm_from_rotation_vector, left_jacobian, skew
from simnav.scenario import load
from simnav.scoring import score
from simnav.source import record
from simnav.trial import run_trial

N = 15


def element(position, velocity, dcm) -> np.ndarray:
    """The element of the group, a 5 x 5 matrix."""
    X = np.eye(5)
    X[:3, :3], X[:3, 3], X[:3, 4] = dcm, velocity, position
    return X


def logarithm(X: np.ndarray) -> np.ndarray:
    """Position, velocity and rotation of the logarithm of an element, in the order of a state's error."""
    L = logm(X).real
    return np.concatenate([L[:3, 4], L[:3, 3], [L[2, 1], L[0, 2], L[1, 0]]])


def moved(X: np.ndarray, step: np.ndarray) -> np.ndarray:
    """An element after a step of a state's error."""
    return element(X[:3, 4] + step[:3], X[:3, 3] + step[3:6], dcm_from_rotation_vector(step[6:9]) @ X[:3, :3])


def random_covariance(rng: np.random.Generator) -> np.ndarray:
    root = rng.normal(size=(N, N))
    return root @ root.T


def differences_to_group(Y: np.ndarray) -> np.ndarray:
    """The derivative of the right-invariant error of a mean state by the differences from it."""
    T = np.eye(9)
    T[:3, 6:9], T[3:6, 6:9] = skew(Y[:3, 4]), skew(Y[:3, 3])
    return T


@pytest.mark.parametrize(("angle", "tolerance"), [(1e-4, 1e-7), (0.05, 1e-6), (0.3, 1e-4), (1.0, 3e-3)])
def test_it_is_the_linearised_logarithm(angle: float, tolerance: float):
    """Mean exactly, covariance to second order in the angle, wherever the origin of positions and velocities is."""
    rng = np.random.default_rng(2)
    node = element(rng.normal(size=3), rng.normal(size=3), dcm_from_rotation_vector(rng.normal(size=3)))
    shift = rng.normal(size=N)
    shift[6:9] *= angle / np.linalg.norm(shift[6:9])
    mean_state, P = moved(node, shift), random_covariance(rng)
    linear, mean = np.empty((N, N)), np.empty(N)
    at_node(P, shift, linear, mean)

    def residual(step: np.ndarray) -> np.ndarray:
        return logarithm(mean_state @ np.linalg.inv(moved(node, step)))

    xi, h = residual(np.zeros(9)), 1e-6
    A = np.column_stack([(residual(-h * e) - residual(h * e)) / (2.0 * h) for e in np.eye(9)])
    np.testing.assert_allclose(A @ mean[:9], xi, atol=1e-7)
    N_ = np.linalg.solve(A, differences_to_group(mean_state))
    expected = N_ @ P[:9, :9] @ N_.T
    assert np.max(np.abs(linear[:9, :9] - expected)) < tolerance * np.max(np.abs(expected))
    np.testing.assert_allclose(linear[9:, 9:], P[9:, 9:])
    np.testing.assert_allclose(linear[:9, 9:], linear[9:, :9].T)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.02, 0.5, 3.0])
def test_what_is_left_behind_is_what_was_eliminated(angle: float):
    rng = np.random.default_rng(4)
    mean, linear = rng.normal(size=N), random_covariance(rng)
    mean[6:9] *= angle / np.linalg.norm(mean[6:9])
    covariance, shift, again, mean_again = np.empty((N, N)), np.empty(N), np.empty((N, N)), np.empty(N)
    at_mean(linear, mean, covariance, shift)
    np.testing.assert_allclose(shift[3:6], left_jacobian(mean[6:9]) @ mean[3:6], atol=1e-12)
    at_node(covariance, shift, again, mean_again)
    np.testing.assert_allclose(again, linear, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mean_again, mean, atol=1e-9)


def test_a_turn_that_nothing_measures_stays_unknown():
    """The track may be turned about the vertical: after a turn of the node this direction still has its variance."""
    rng = np.random.default_rng(6)
    position, velocity = rng.normal(size=3), rng.normal(size=3)
    mean_state = element(position, velocity, np.eye(3))
    unknown = np.zeros(N)
    unknown[:3], unknown[3:6], unknown[8] = np.cross([0, 0, 1], position), np.cross([0, 0, 1], velocity), 1.0
    P = 1e-6 * np.eye(N) + 1e3 * np.outer(unknown, unknown)
    turn = dcm_from_rotation_vector(np.array([0.0, 0.0, 0.2]))
    node = element(turn @ position, turn @ velocity, turn)
    shift = np.zeros(N)
    shift[:3], shift[3:6], shift[8] = position - node[:3, 4], velocity - node[:3, 3], -0.2
    linear, mean = np.empty((N, N)), np.empty(N)
    at_node(P, shift, linear, mean)
    there = np.zeros(N)
    there[:3], there[3:6], there[8] = np.cross([0, 0, 1], node[:3, 4]), np.cross([0, 0, 1], node[:3, 3]), 1.0
    information = there @ np.linalg.solve(linear, there)
    assert moved(node, shift) == pytest.approx(mean_state)
    assert 0.9e-3 < information < 0.01
    naive = there @ np.linalg.solve(P, there)  # as if the prior had been linearised there
    assert naive > 1e3 * information


def test_a_contradiction_that_leaves_the_window_does_not_turn_the_heading():
    """Gyroscopes that are disturbed for one second beside a DVL alone: seeds of their own."""
    ratio = []
    for seed in (2401, 2402, 2403):
        recording = record(load("lone-dvl"), seed)
        error = {
            prior: score(run_trial(make("sw-fgo", prior=prior), recording), recording, ["horizontal_rmse"])
            for prior in ("group", "differences")
        }
        ratio.append(error["group"]["horizontal_rmse"] / error["differences"]["horizontal_rmse"])
    assert np.exp(np.mean(np.log(ratio))) < 0.5


def test_another_prior_is_refused():
    with pytest.raises(EstimatorError, match="'prior' of estimator 'sw-fgo' is one of differences, group, not 'pose'"):
        make("sw-fgo", prior="pose")
