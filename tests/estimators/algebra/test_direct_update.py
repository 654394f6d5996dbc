"""The update of a state that is observed directly has the bits of Joseph's update of any state."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.algebra.direct_update import normalised_square, posterior
from simnav.estimators.algebra.joseph import joseph_update


def covariance(rng: np.random.Generator, m: int) -> np.ndarray:
    root = rng.standard_normal((m, m)) * 10.0 ** rng.uniform(-4.0, 2.0, (m, 1))
    return root @ root.T + np.diag(10.0 ** rng.uniform(-6.0, 1.0, m))


@pytest.mark.parametrize("m", [1, 2, 3])
def test_it_is_the_update_of_the_solver(m: int) -> None:
    rng = np.random.default_rng(m)
    for _ in range(300):
        predicted, noise, innovation = covariance(rng, m), covariance(rng, m), rng.standard_normal(m)
        after, correction, residual, found = predicted.copy(), np.empty(m), np.empty(m), np.empty((m, m))
        nis = joseph_update(after, predicted, predicted + noise, innovation, correction)
        assert posterior(innovation, predicted, noise, residual, found) == nis
        assert normalised_square(innovation, predicted, noise) == nis
        np.testing.assert_array_equal(residual, innovation - correction)
        np.testing.assert_array_equal(found, after)


@pytest.mark.parametrize("m", [1, 2, 3])
def test_a_singular_covariance_updates_nothing(m: int) -> None:
    predicted, noise, innovation = np.ones((m, m)), np.zeros((m, m)), np.arange(1.0, m + 1.0)
    predicted *= m > 1
    residual, found = np.empty(m), np.empty((m, m))
    assert posterior(innovation, predicted, noise, residual, found) == -1.0
    assert normalised_square(innovation, predicted, noise) == -1.0
    np.testing.assert_array_equal(residual, innovation)
    np.testing.assert_array_equal(found, predicted)
