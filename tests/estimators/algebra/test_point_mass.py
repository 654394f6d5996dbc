"""Masses on a lattice: moments, products, maps and noise beside closed forms; the bound of terrain navigation."""

from __future__ import annotations

import numpy as np
import pytest

from simnav.estimators.algebra.point_mass import PointMass
from simnav.types import Array
from simnav.world.depth_grid import DepthGrid
from simnav.world.relief import relief

LONG = np.array([[9.0, 5.0], [5.0, 4.0]])
STREAK = 225.0 * np.outer([0.6, -0.8], [0.6, -0.8]) + 1e-4 * np.outer([0.8, 0.6], [0.8, 0.6])


@pytest.mark.parametrize(
    ("noise", "tolerance"),
    [(1e-6 * np.eye(2), 1e-7), (np.array([[0.01, -0.004], [-0.004, 0.02]]), 1e-4), (400.0 * LONG, 18.0), (STREAK, 0.5)],
)
def test_noise_of_any_size_adds_its_covariance(noise: Array, tolerance: float) -> None:
    """One is 20 times as wide as the density; the last one is long, and narrower than a step."""
    density = PointMass.gaussian(LONG)
    density.shift(np.array([3.0, -2.0]))
    before = density.moments()[1]
    np.testing.assert_allclose(before, LONG, rtol=1e-4)
    density.diffuse(noise)
    mean, covariance = density.moments()
    np.testing.assert_allclose(mean, [3.0, -2.0], atol=0.01 * np.sqrt(covariance.diagonal().max()))
    np.testing.assert_allclose(covariance, before + noise, rtol=0.0, atol=tolerance)
    assert density.weight.min() >= 0.0
    assert density.weight.sum() == pytest.approx(1.0)
    assert density.weight.size < 40000


def test_a_map_of_the_plane_needs_no_interpolation() -> None:
    density, matrix = PointMass.gaussian(LONG), np.array([[1.1, 0.2], [-0.1, 0.9]])
    mean, covariance = density.moments()
    density.move(matrix, np.array([5.0, 6.0]))
    moved, spread = density.moments()
    np.testing.assert_allclose(moved, matrix @ mean + [5.0, 6.0])
    np.testing.assert_allclose(spread, matrix @ covariance @ matrix.T)


def test_a_finer_lattice_keeps_the_mean() -> None:
    density = PointMass.gaussian(LONG)
    density.shift(np.array([1.0, 2.0]))
    steps, nodes = density.basis.copy(), int(density.active.sum())
    density.refine()
    np.testing.assert_allclose(density.basis, 0.5 * steps)
    assert 3 * nodes < density.active.sum() < 6 * nodes
    mean, covariance = density.moments()
    np.testing.assert_allclose(mean, [1.0, 2.0], atol=1e-6)
    np.testing.assert_allclose(covariance, LONG, rtol=0.03)


def test_a_product_with_a_gaussian_is_that_of_gaussians() -> None:
    density, precise = PointMass.gaussian(LONG), np.diag([0.5, 0.8])
    index = np.nonzero(density.active)
    off = density.places(index) - [1.0, 0.5]
    log_mean = density.take(index, -0.5 * np.einsum("ni,ij,nj->n", off, precise, off))
    covariance = np.linalg.inv(np.linalg.inv(LONG) + precise)
    mean, spread = density.moments()
    np.testing.assert_allclose(spread, covariance, rtol=2e-3)
    np.testing.assert_allclose(mean, covariance @ precise @ [1.0, 0.5], atol=2e-3)
    both = LONG + np.linalg.inv(precise)
    off0 = np.array([1.0, 0.5])
    expected = -0.5 * off0 @ np.linalg.inv(both) @ off0
    expected -= 0.5 * np.log(np.linalg.det(both) * np.linalg.det(precise))
    assert log_mean == pytest.approx(expected, abs=1e-3)
    assert density.take(np.nonzero(density.active), np.full(int(density.active.sum()), -np.inf)) == -np.inf


def test_it_keeps_the_bound_of_terrain_navigation() -> None:
    """Bergman's bound: the information grows with the square of the slope below, as one over the noise of a sounding.

    Bergman 1999, section 7.3: ``1/P' = 1/(P + Q) + slope slope' / R`` at the true place, mean over tracks.
    """
    rng = np.random.default_rng(5)
    grid = DepthGrid(np.zeros(3), np.array([10.0, 10.0]), 80.0 + relief((150, 150), (10.0, 10.0), 6.0, 120.0, 0.8, rng))
    step, noise, variance, first = np.array([6.0, 3.0]), 0.05**2 * np.eye(2), 0.3**2, 20.0**2 * np.eye(2)
    squares, bounds = [], []
    for _ in range(10):
        truth = rng.uniform(-250.0, 0.0, 2)
        density, information = PointMass.gaussian(first), np.linalg.inv(first)
        density.shift(truth + 20.0 * rng.standard_normal(2))
        for _ in range(30):
            truth = truth + step + 0.05 * rng.standard_normal(2)
            density.shift(step)
            density.diffuse(noise)
            depth, slope = grid.at(truth[None])
            sounding = depth[0] + 0.3 * rng.standard_normal()
            information = np.linalg.inv(np.linalg.inv(information) + noise) + np.outer(slope[0], slope[0]) / variance
            while True:
                index = np.nonzero(density.active)
                depths, slopes = grid.at(density.places(index))
                within = 0.25 * np.sum((slopes @ density.basis) ** 2, axis=1)
                if density.weight[index] @ within < 0.1 * variance or len(depths) > 3000:
                    break
                density.refine()
            spread = variance + within
            density.take(index, -0.5 * (sounding - depths) ** 2 / spread - 0.5 * np.log(spread))
        squares.append(np.sum((density.moments()[0] - truth) ** 2))
        bounds.append(np.trace(np.linalg.inv(information)))
    ratio = np.sqrt(np.mean(squares) / np.mean(bounds))
    assert 0.7 < ratio < 1.3


def test_a_lattice_that_is_coarser_than_its_density_is_refined_until_it_resolves_it() -> None:
    """Many weak likelihoods narrow a density below the steps that it began with; at last it stood on one node."""
    density, truth = PointMass.gaussian(100.0 * np.eye(2)), np.array([1.3, -2.1])
    information, coarse = np.eye(2) / 100.0, 0
    assert density.resolved
    for _ in range(200):
        while not density.resolved:
            density.refine()
            coarse += 1
        index = np.nonzero(density.active)
        off = density.places(index) - truth
        density.take(index, -0.5 * np.sum(off**2, axis=1) / 25.0)
        information += np.eye(2) / 25.0
    mean, covariance = density.moments()
    assert coarse >= 2
    np.testing.assert_allclose(covariance, np.linalg.inv(information), atol=0.03)
    np.testing.assert_allclose(mean, truth * (1.0 - information[0, 0] ** -1 / 100.0), atol=0.05)
