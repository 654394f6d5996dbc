"""Where on a chart a profile of depths fits: terrain contour matching.

A profile is a number of soundings whose places are known relative to the vehicle as it is now. It is laid on the chart
with the vehicle at each node of a search area. How well it fits there says the mean absolute difference between the
depths of the profile and those of the chart (bilinear between nodes). It is the mean of the smallest four fifths, so a
few false soundings do not change it. A common difference of all depths, their median, may be taken away first: a tide,
or the bias of a depth sensor.

The local minima of the difference, and the best nodes, are then refined below the spacing of the nodes: Gauss-Newton
steps with Huber's weights, on the depths and the gradients of `simnav.world.depth_grid`.

The covariance of a place is that of least squares: the variance of the residuals over the curvature, J'J. Residuals of
neighbouring pings are alike where the chart is wrong or the track is bent, so it is multiplied by the mean ratio of the
covariance that allows for this (by Newey and West), if that is larger.

Sources: J. P. Golden, *Terrain contour matching (TERCOM): a cruise missile guidance aid*, Proceedings of SPIE 238,
1980; W. K. Newey and K. D. West, *A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix*, Econometrica 55(3), 1987; P. J. Huber, *Robust estimation of a location parameter*, The Annals of
Mathematical Statistics 35(1), 1964.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array
from simnav.world.depth_grid import DepthGrid

__all__ = ["Match", "Profile", "match", "scan"]

#: Soundings that the scan of all nodes takes at most, and differences that it keeps at a time.
_SCANNED, _AT_A_TIME = 120, 2_000_000
#: So many local minima are refined, and so many of the best nodes: near the right place the difference may rise faster
#: than the nodes lie apart.
_CANDIDATES = 8
#: Steps of the refinement, and the step after which it ends, in metres.
_STEPS, _SMALL = 15, 0.01
#: Huber's weights fall beyond so many robust standard deviations; a sounding beyond the second is false.
_HUBER, _FALSE = 2.0, 4.0
#: The share of the absolute differences, the smallest ones, of which the measure is the mean.
_KEPT = 0.8
#: The median of absolute normal variates is the standard deviation over this.
_MEDIAN = 1.4826


@dataclass(frozen=True, eq=False)
class Profile:
    """Soundings of n places.

    Attributes
    ----------
    place : (n, 2) array
        North and east of the vehicle as it is now [m].
    depth : (n,) array
        Of the bottom there, below the mean sea surface [m].
    sigma : (n,) array
        White noise of the depths, one sigma [m].
    ping : (n,) int array
        Number of the ping, ascending; soundings of one ping have the same.
    """

    place: Array
    depth: Array
    sigma: Array
    ping: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.depth)


@dataclass(frozen=True, eq=False)
class Match:
    """A place where a profile fits.

    Attributes
    ----------
    place : (2,) array
        Of the vehicle, north and east of the middle of the chart [m].
    covariance : (2, 2) array
        [m^2]
    difference : float
        Mean of the smallest four fifths of the absolute differences [m].
    used : (n,) array of bool
        The soundings that are not false.
    gain : (n, 2) array
        By how much the place is wrong if the depth of a sounding is, to first order; zero for those that are not used.
    gradient : (n, 2) array
        Of the chart below each sounding.
    """

    place: Array
    covariance: Array
    difference: float
    used: NDArray[np.bool_]
    gain: Array
    gradient: Array

    @property
    def pull(self) -> Array:
        """(n, 2, 2) array: by how much the place is wrong if that of a sounding in the profile is, to first order.

        If all are moved by the same, the place is moved by the opposite.
        """
        return -self.gain[:, :, None] * self.gradient[:, None]


def match(grid: DepthGrid, profile: Profile, middle: Array, reach: Array, *, remove_offset: bool) -> list[Match]:
    """The places in a search area where a profile fits best, the best one first.

    Parameters
    ----------
    grid : DepthGrid
        The chart.
    profile : Profile
        The soundings, four or more.
    middle, reach : (2,) array
        Middle of the area, north and east of that of the chart, and half of its sides [m].
    remove_offset : bool
        Whether a common difference of the depths is taken away.

    Returns
    -------
    list of Match
        Different places: two of them are further apart than the spacing of the nodes. They may lie outside of the area,
        if the difference still falls at its edge. It is empty where the chart tells no place at all.
    """
    corner, difference = scan(grid, profile, middle, reach, remove_offset=remove_offset)
    if not difference.size:
        return []
    found: list[Match] = []
    last = np.array(grid.depth.shape) - 1.0
    for node in _minima(difference):
        refined = _refined(grid, profile, (corner + node - 0.5 * last) * grid.spacing, remove_offset)
        if refined is not None:
            found.append(refined)
    found.sort(key=lambda one: one.difference)
    different: list[Match] = []
    for one in found:
        if all((abs(one.place - other.place) > grid.spacing).any() for other in different):
            different.append(one)
    return different


def scan(grid: DepthGrid, profile: Profile, middle: Array, reach: Array, *, remove_offset: bool) -> tuple[Array, Array]:
    """The difference with the vehicle at each node of a search area.

    Parameters
    ----------
    grid, profile, middle, reach, remove_offset
        As of `match`.

    Returns
    -------
    corner : (2,) array
        Row and column of the first node of the area that has all of the profile on the chart.
    difference : (r, c) array
        [m]; of the size 0 if no node has.
    """
    if len(profile) > _SCANNED:
        some = np.linspace(0, len(profile) - 1, _SCANNED).astype(np.intp)
    else:
        some = np.arange(len(profile))
    depth, u = profile.depth[some], profile.place[some] / grid.spacing
    first = np.floor(u).astype(np.intp)
    part = u - first
    last = np.array(grid.depth.shape) - 1
    centre, side = middle / grid.spacing + 0.5 * last, reach / grid.spacing
    low = np.maximum(np.ceil(centre - side), -first.min(axis=0)).astype(np.intp)
    high = np.minimum(np.floor(centre + side), last - 1 - first.max(axis=0)).astype(np.intp)
    shape = high - low + 1
    if (shape < 1).any():
        return low, np.empty((0, 0))
    difference = np.empty(shape)
    step = max(1, _AT_A_TIME // (len(some) * int(shape[1])))
    for row in range(int(low[0]), int(high[0]) + 1, step):
        rows = min(step, int(high[0]) + 1 - row)
        apart = np.empty((rows, int(shape[1]), len(some)))
        for i, (k, j) in enumerate(first.tolist()):
            nodes = grid.depth[row + k : row + k + rows + 1, low[1] + j : high[1] + j + 2]
            along = nodes[:, :-1] + part[i, 1] * (nodes[:, 1:] - nodes[:, :-1])
            apart[:, :, i] = along[:-1] + part[i, 0] * (along[1:] - along[:-1]) - depth[i]
        if remove_offset:
            apart -= np.median(apart, axis=2, keepdims=True)
        difference[row - low[0] : row - low[0] + rows] = _measure(apart)
    return low, difference


def _measure(apart: Array) -> Array:
    """The mean of the smallest four fifths of the absolute values along the last axis."""
    count = max(1, int(_KEPT * apart.shape[-1]))
    return np.asarray(np.partition(abs(apart), count - 1, axis=-1)[..., :count].mean(axis=-1))


def _minima(difference: Array) -> NDArray[np.intp]:
    """(k, 2) nodes that none of their neighbours is below, and the best nodes."""
    rows, columns = difference.shape
    around = np.pad(difference, 1, constant_values=np.inf)
    least = np.ones(difference.shape, np.bool_)
    for i in range(3):
        for j in range(3):
            least &= difference <= around[i : i + rows, j : j + columns]
    minima = np.flatnonzero(least)
    minima = minima[np.argsort(difference.ravel()[minima], kind="stable")[:_CANDIDATES]]
    best = np.argsort(difference, axis=None, kind="stable")[:_CANDIDATES]
    return np.column_stack(np.unravel_index(np.union1d(minima, best), difference.shape))


def _residuals(grid: DepthGrid, profile: Profile, place: Array, remove_offset: bool) -> tuple[Array, Array, float]:
    """(n,) differences of the depths about their median, (n, 2) gradients, robust standard deviation."""
    depth, gradient = grid.at(place + profile.place)
    residual = profile.depth - depth
    if remove_offset:
        residual = residual - np.median(residual)
    spread = max(_MEDIAN * float(np.median(abs(residual))), float(profile.sigma.min()), 1e-6)
    return residual, gradient, spread


def _refined(grid: DepthGrid, profile: Profile, place: Array, remove_offset: bool) -> Match | None:
    """The place near a node where the profile fits best; None where the bottom has no shape."""
    for _ in range(_STEPS):
        residual, gradient, spread = _residuals(grid, profile, place, remove_offset)
        weight = np.minimum(1.0, _HUBER * spread / np.maximum(abs(residual), 1e-12))
        step = _solved(gradient, residual, weight, remove_offset)
        if step is None:
            return None
        step *= min(1.0, 1.0 / float((abs(step) / grid.spacing).max(initial=1e-12)))
        place = place + step
        if abs(step).max() < _SMALL:
            break
    residual, gradient, spread = _residuals(grid, profile, place, remove_offset)
    used = abs(residual) <= _FALSE * spread
    design = _design(gradient[used], remove_offset)
    normal = design.T @ design
    if len(design) <= design.shape[1] or not _regular(normal):
        return None
    inverse = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    gain = np.zeros((len(profile), 2))
    gain[used] = design @ inverse[:, :2]
    covariance = _covariance(design, inverse, residual[used], profile, used)
    return Match(place, covariance, float(_measure(residual)), used, gain, gradient)


def _design(gradient: Array, remove_offset: bool) -> Array:
    return np.column_stack([gradient, np.ones(len(gradient))]) if remove_offset else gradient


def _solved(gradient: Array, residual: Array, weight: Array, remove_offset: bool) -> Array | None:
    """(2,) the step of weighted least squares; None where the gradients do not tell both components."""
    design = _design(gradient, remove_offset)
    normal = design.T @ (weight[:, None] * design)
    if not _regular(normal):
        return None
    return np.asarray(np.linalg.solve(normal, design.T @ (weight * residual))[:2])


def _regular(normal: Array) -> bool:
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-30))
    return bool(np.diag(normal).min() > 1e-12 and np.linalg.eigvalsh(normal / np.outer(scale, scale))[0] > 1e-6)


def _covariance(design: Array, inverse: Array, residual: Array, profile: Profile, used: NDArray[np.bool_]) -> Array:
    """(2, 2) covariance of a place; ``inverse`` is that of the normal matrix."""
    n, p = design.shape
    residual = residual - design @ (inverse @ (design.T @ residual))
    variance = max(float(residual @ residual) / (n - p), float(np.mean(profile.sigma[used] ** 2)))
    plain = variance * inverse[:2, :2]
    _, ping = np.unique(profile.ping[used], return_inverse=True)
    score = np.zeros((int(ping.max()) + 1, p))
    np.add.at(score, ping, design * residual[:, None])
    middle = score.T @ score
    lags = round(len(score) ** 0.5)
    for lag in range(1, min(lags, len(score) - 1) + 1):
        product = score[lag:].T @ score[:-lag]
        middle += (1.0 - lag / (lags + 1.0)) * (product + product.T)
    alike = (inverse @ middle @ inverse)[:2, :2] * n / (n - p)
    ratio = 0.5 * float(np.trace(np.linalg.solve(plain, alike)))
    return np.asarray(max(1.0, ratio) * plain)
