"""Profiles of depths laid on a chart: the scan of all nodes, the refined place and its covariance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from scipy.stats import chi2

from simnav.types import Array
from simnav.world.depth_grid import DepthGrid
from simnav.world.profile_match import Profile, match, scan
from simnav.world.relief import relief

STEP = 10.0
ALONG = np.column_stack([np.linspace(-98.0, 0.0, 50), np.linspace(-60.0, 0.0, 50)])


def rough(seed: int = 3) -> DepthGrid:
    rng = np.random.default_rng(seed)
    depth = 90.0 + relief((61, 71), (STEP, STEP), 5.0, 150.0, 0.8, rng)
    return DepthGrid(np.zeros(3), np.full(2, STEP), depth)


def sounded(grid: DepthGrid, at: Array, noise: float = 0.0, seed: int = 1) -> Profile:
    """A profile of a vehicle that has come to a place north and east of the middle [m]."""
    depth = grid.at(at + ALONG)[0] + noise * np.random.default_rng(seed).standard_normal(len(ALONG))
    return Profile(ALONG, depth, np.full(len(ALONG), max(noise, 0.01)), np.arange(len(ALONG)))


@pytest.mark.parametrize("remove_offset", [False, True])
def test_the_scan_is_the_mean_of_the_smallest_four_fifths_at_each_node(remove_offset: bool) -> None:
    grid = rough()
    profile = sounded(grid, np.array([33.0, -47.0]))
    corner, difference = scan(
        grid, profile, np.array([20.0, -30.0]), np.array([60.0, 45.0]), remove_offset=remove_offset
    )
    north, east = (STEP * (np.arange(n) - 0.5 * (n - 1)) for n in grid.depth.shape)
    chart = RegularGridInterpolator((north, east), grid.depth)
    assert difference.shape == (13, 9)
    for i, j in ((0, 0), (4, 8), (12, 5)):
        node = np.array([north[int(corner[0]) + i], east[int(corner[1]) + j]])
        apart = chart(node + ALONG) - profile.depth
        apart = apart - np.median(apart) if remove_offset else apart
        assert difference[i, j] == pytest.approx(np.mean(np.sort(abs(apart))[:40]), abs=1e-9)


def test_only_nodes_that_have_all_of_the_profile_on_the_chart_are_scanned() -> None:
    grid = rough()
    corner, difference = scan(grid, sounded(grid, np.zeros(2)), np.zeros(2), grid.half, remove_offset=True)
    assert corner.tolist() == [10, 6]
    assert difference.shape == (61 - 10 - 1, 71 - 6 - 1)
    far = scan(grid, sounded(grid, np.zeros(2)), np.array([5000.0, 0.0]), np.full(2, 100.0), remove_offset=True)[1]
    assert far.size == 0


def test_a_place_is_found_below_the_spacing_whatever_the_tide_is() -> None:
    grid, at = rough(), np.array([33.7, -46.2])
    profile = sounded(grid, at)
    best = match(grid, profile, np.zeros(2), np.full(2, 150.0), remove_offset=True)[0]
    np.testing.assert_allclose(best.place, at, atol=0.01)
    tide = Profile(profile.place, profile.depth + 1.5, profile.sigma, profile.ping)
    np.testing.assert_allclose(
        match(grid, tide, np.zeros(2), np.full(2, 150.0), remove_offset=True)[0].place, at, atol=0.01
    )
    # With the offset left in, another hill fits better.
    elsewhere = match(grid, tide, np.zeros(2), np.full(2, 150.0), remove_offset=False)[0].place
    assert np.linalg.norm(elsewhere - at) > 50.0


def test_the_covariance_is_that_of_the_errors() -> None:
    grid, at, squares = rough(), np.array([12.0, 28.0]), []
    for seed in range(16):
        best = match(grid, sounded(grid, at, 0.3, seed), at, np.full(2, 15.0), remove_offset=True)[0]
        error = best.place - at
        squares.append(float(error @ np.linalg.solve(best.covariance, error)))
    # It takes the larger one of two covariances, so the errors may be smaller.
    assert 0.5 * 2 * 16 < sum(squares) < chi2.ppf(0.999, 2 * 16)


def test_the_gain_says_what_wrong_depths_and_a_wrong_track_do() -> None:
    grid, at = rough(), np.array([12.0, 28.0])
    profile = sounded(grid, at)
    best = match(grid, profile, at, np.full(2, 15.0), remove_offset=False)[0]
    np.testing.assert_allclose(best.pull.sum(axis=0), -np.eye(2), atol=1e-9)
    wrong = 0.02 * np.sin(np.arange(50.0))
    moved = match(
        grid, Profile(profile.place, profile.depth + wrong, np.full(50, 0.1), profile.ping), at, np.full(2, 15.0),
        remove_offset=False,
    )[0]  # fmt: skip
    np.testing.assert_allclose(moved.place - best.place, best.gain.T @ wrong, atol=0.01)
    longer = Profile(1.002 * profile.place, profile.depth, np.full(50, 0.1), profile.ping)
    stretched = match(grid, longer, at, np.full(2, 15.0), remove_offset=False)[0]
    expected = np.einsum("nij,nj->i", best.pull, 0.002 * ALONG)
    np.testing.assert_allclose(stretched.place - best.place, expected, atol=0.04)


def test_two_equal_hills_are_two_places_and_a_plane_is_none() -> None:
    north, east = (STEP * (np.arange(n) - 0.5 * (n - 1)) for n in (61, 71))
    hill = [
        np.exp(-((north[:, None] - 40.0) ** 2 + (east[None] - middle) ** 2) / (2.0 * 50.0**2))
        for middle in (-150.0, 150.0)
    ]
    grid = DepthGrid(np.zeros(3), np.full(2, STEP), 90.0 - 20.0 * (hill[0] + hill[1]))
    found = match(grid, sounded(grid, np.array([70.0, -120.0])), np.zeros(2), np.full(2, 250.0), remove_offset=True)
    places = sorted(tuple(np.round(one.place).tolist()) for one in found[:2])
    assert places == [(70.0, -120.0), (70.0, 180.0)]
    plane = DepthGrid(np.zeros(3), np.full(2, STEP), 90.0 + 0.02 * np.repeat(north[:, None], 71, axis=1))
    assert match(plane, sounded(plane, np.zeros(2)), np.zeros(2), np.full(2, 100.0), remove_offset=True) == []


def test_a_few_false_soundings_change_little() -> None:
    grid, at = rough(), np.array([33.7, -46.2])
    profile = sounded(grid, at, 0.1)
    depth = profile.depth.copy()
    depth[[4, 17, 30, 44]] -= [6.0, 15.0, 3.0, 20.0]
    best = match(
        grid, Profile(ALONG, depth, profile.sigma, profile.ping), np.zeros(2), np.full(2, 150.0), remove_offset=True
    )[0]
    assert np.flatnonzero(~best.used).tolist() == [4, 17, 30, 44]
    assert np.linalg.norm(best.place - at) < 1.5
