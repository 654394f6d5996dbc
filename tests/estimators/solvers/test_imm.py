"""The mixture of noise levels, against an independent computation with a Gaussian mixture."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from simnav.estimator import EstimatorError, make
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.solvers.imm import mixture_update
from simnav.scenario import load
from simnav.source import record


def problem(seed: int, m: int = 3):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((7, 7))
    P, H = root @ root.T / 7.0, rng.standard_normal((m, 7))
    R = np.diag(rng.random(m) + 0.5)
    return P, H, R, 3.0 * rng.standard_normal(m)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("m", [1, 3])
def test_the_merged_update_has_the_moments_of_the_mixture(seed: int, m: int):
    P, H, R, v = problem(seed, m)
    levels, prior = np.array([1.0, 3.0, 10.0]), np.array([0.7, 0.2, 0.1])
    means, covariances, weights = [], [], []
    for level, p in zip(levels, prior):
        S = H @ P @ H.T + level**2 * R
        K = P @ H.T @ np.linalg.inv(S)
        means.append(K @ v)
        covariances.append(P - K @ S @ K.T)
        weights.append(p * multivariate_normal(np.zeros(m), S).pdf(v))
    weights = np.array(weights) / sum(weights)
    mean = weights @ np.array(means)
    spread = sum(w * (c + np.outer(x - mean, x - mean)) for w, c, x in zip(weights, covariances, means))

    got, probability, dx = P.copy(), prior.copy(), np.empty(7)
    cross = np.ascontiguousarray(P @ H.T)
    nis, expected, _ = mixture_update(got, cross, H @ cross, R, v, levels**2, np.eye(len(levels)), probability, dx)
    np.testing.assert_allclose(probability, weights, rtol=1e-9)
    assert expected == pytest.approx(weights @ levels**2)
    np.testing.assert_allclose(dx, mean, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(got, spread, rtol=1e-8, atol=1e-10)
    assert nis == pytest.approx(v @ np.linalg.solve(H @ P @ H.T + R, v))


def test_levels_of_no_probability_leave_the_kalman_filter():
    P, H, R, v = problem(9)
    cross = np.ascontiguousarray(P @ H.T)
    mine, plain, dx, expected = P.copy(), P.copy(), np.empty(7), np.empty(7)
    mixture_update(mine, cross, H @ cross, R, v, np.array([1.0, 100.0]), np.eye(2), np.array([1.0, 0.0]), dx)
    joseph_update(plain, cross, H @ cross + R, v, expected)
    np.testing.assert_allclose(mine, plain, atol=1e-12)
    np.testing.assert_allclose(dx, expected)


def test_levels_change_by_the_chain_first():
    """Where the levels are alike, the measurement says nothing of them: what is left is the chain."""
    P, H, R, v = problem(4)
    cross = np.ascontiguousarray(P @ H.T)
    chain, probability = np.array([[0.9, 0.05, 0.05], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]]), np.array([0.2, 0.5, 0.3])
    predicted = probability @ chain
    mixture_update(P, cross, H @ cross, R, v, np.ones(3), chain, probability, np.empty(7))
    np.testing.assert_allclose(probability, predicted)


def test_a_singular_innovation_covariance_changes_nothing():
    P = np.eye(2)
    H = np.array([[1.0, 0.0], [1.0, 0.0]])
    cross, probability = np.ascontiguousarray(P @ H.T), np.array([0.5, 0.5])
    nis, _, _ = mixture_update(
        P, cross, H @ cross, np.zeros((2, 2)), np.ones(2), np.ones(2), np.eye(2), probability, np.empty(2)
    )
    assert nis == -1.0
    np.testing.assert_array_equal(P, np.eye(2))
    np.testing.assert_array_equal(probability, [0.5, 0.5])


@pytest.mark.parametrize("n", [2, 3, 4])
def test_the_chain_is_a_chain(n: int):
    chain = make("imm", levels=tuple(range(1, n + 1)), stay=0.99, stay_high=0.8).transition
    np.testing.assert_allclose(chain.sum(axis=1), 1.0)
    np.testing.assert_allclose(np.diag(chain), [0.99, *[0.8] * (n - 1)])
    assert chain.min() > 0.0


def test_levels_that_cannot_be():
    with pytest.raises(EstimatorError, match=r"levels = 3, 1: two or more"):
        make("imm", levels="3,1")


def test_readings_of_one_time_of_several_channels_are_mixed_one_by_one():
    recording = record(load("satellites-open-sea").model_copy(update={"duration": 2.0}), 0)
    plain, mixed = make("ekf"), make("imm")
    for estimator in (plain, mixed):
        estimator.reset(recording.start, recording.instruments)
    assert plain.functions().predict_together is not None  # as the plain filter predicts them
    assert mixed.functions().predict_together is None
