"""Rays of sound in water whose speed of sound is linear in depth between the depths of a table.

A ray keeps p = cos(theta) / c, with its angle theta from the horizontal (Snell's law). In a layer in which the speed is
linear it is an arc. From the depth z1 with the speed c1 to z2 with c2 it covers, with s = sin(theta) =
sqrt(1 - p^2 c^2), the horizontal distance and the time ::

    x = p (c1 + c2) |z2 - z1| / (s1 + s2)
    t = |z2 - z1| / (c2 - c1) log(c2 (1 + s1) / (c1 (1 + s2)))

(written here so that nothing is lost where the speed is constant). The time is computed as t + p (distance - x), which
an error of p changes in second order only, because dt/dp = p dx/dp.

The ray of a reading is the one that does not turn; there is at most one. Where the distance is too large for it, it is
the first to arrive of those that turn once, above the upper end or below the lower one, without touching the surface or
the bottom. Elsewhere there is a shadow. The sea is flat: rays bend by a radius of some 90 km, the Earth by 6400 km.

Source: F. B. Jensen, W. A. Kuperman, M. B. Porter and H. Schmidt, *Computational Ocean Acoustics*, 2nd ed., Springer
2011, section 3.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array
from simnav.world.sound_speed import Profile

__all__ = ["Rays", "trace"]

#: Halvings of an interval of p, or of turning depths.
_HALVINGS = 60
#: Rays are as close to grazing as this.
_GRAZING = 1.0 - 1e-15
#: Turning depths that are tried in each layer; between two of them the distance is taken for monotonic.
_TURNS = 48


@dataclass(frozen=True)
class Rays:
    """The rays from n first points to n second points.

    Attributes
    ----------
    time : (n,) array
        Travel time [s]; NaN in a shadow.
    depression : (n,) array
        Angle of the ray below the horizontal at the first point, where it leaves towards the second one [rad].
    """

    time: Array
    depression: Array


def _covered(nodes: Array, speed: Array, slowness: Array) -> tuple[Array, Array]:
    """Horizontal distances [m] and times [s] of rays through (n, m) nodes of a path, for (n,) values of p."""
    thick = np.abs(np.diff(nodes, axis=1))
    sine = np.sqrt(np.maximum(1.0 - (slowness[:, None] * speed) ** 2, 0.0))
    c1, c2, s1, s2 = speed[:, :-1], speed[:, 1:], sine[:, :-1], sine[:, 1:]
    layer = thick > 0.0
    both = np.where(layer, s1 + s2, 1.0)
    cross = np.where(layer, c2 * s1 + c1 * s2, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = slowness[:, None] * (c1 + c2) * thick / both
        rate = (1.0 + (c1 + c2) / cross) / (c1 * (1.0 + s2))
        change = rate * (c2 - c1)
        share = np.where(change == 0.0, 1.0, np.log1p(change) / np.where(change == 0.0, 1.0, change))
        time = thick * rate * share
    return np.sum(np.where(layer, distance, 0.0), axis=1), np.sum(np.where(layer, time, 0.0), axis=1)


def trace(profile: Profile, first: Array, second: Array, distance: Array, bottom: float = inf) -> Rays:
    """The rays between pairs of points.

    Parameters
    ----------
    profile : Profile
        Speed of sound with depth.
    first, second : (n,) arrays
        Depths of the points [m].
    distance : (n,) array
        Horizontal distance between them [m].
    bottom : float
        Depth of the bottom [m].

    Returns
    -------
    Rays
        NaN in a shadow.

    Examples
    --------
    >>> still = Profile(np.array([0.0]), np.array([1500.0]))
    >>> rays = trace(still, np.array([10.0]), np.array([50.0]), np.array([30.0]))
    >>> (1500.0 * rays.time).round(6), np.degrees(rays.depression).round(3)
    (array([50.]), array([53.13]))
    """
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    upper, lower = np.minimum(first, second), np.maximum(first, second)
    nodes = profile.between(upper, lower)
    speed = profile.at(nodes)
    fastest = speed.max(axis=1)
    low, high = np.zeros(len(first)), _GRAZING / fastest
    reached, _ = _covered(nodes, speed, high)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        short = _covered(nodes, speed, middle)[0] < distance
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    slowness = 0.5 * (low + high)
    at, time = _covered(nodes, speed, slowness)
    time = time + slowness * (distance - at)
    down = np.where(second >= first, 1.0, -1.0)
    direct = (reached >= distance) | _level(profile, upper, lower, fastest)
    for i in np.flatnonzero(~direct).tolist():
        time[i], slowness[i], down[i] = _turning(profile, float(upper[i]), float(lower[i]), float(distance[i]), bottom)
    cosine = np.minimum(slowness * profile.at(first), 1.0)
    return Rays(time, down * np.arccos(cosine))


def _level(profile: Profile, upper: Array, lower: Array, fastest: Array) -> NDArray[np.bool_]:
    """Whether a ray may run on horizontally at an end, because the speed is largest there and does not change."""
    found = np.zeros(len(upper), np.bool_)
    for end, beyond in ((lower, lower + 1.0), (upper, upper - 1.0)):
        found |= (profile.at(end) == fastest) & (profile.at(beyond) == fastest)
    return found


def _turning(
    profile: Profile, upper: float, lower: float, distance: float, bottom: float
) -> tuple[float, float, float]:
    """Time [s], p [s/m] and sign of the depression at both ends of the first ray that turns once; NaN without one."""
    best = (np.nan, np.nan, 1.0)
    for end, limit, sign in ((lower, min(bottom, float(profile.depth[-1])), 1.0), (upper, 0.0, -1.0)):
        if sign * (limit - end) <= 0.0:
            continue
        inside = profile.depth[(profile.depth > min(end, limit)) & (profile.depth < max(end, limit))]
        edges = np.sort(np.concatenate([[end, limit], inside]))[:: int(sign)]
        share = np.arange(1, _TURNS + 1) / _TURNS
        depths = (edges[:-1, None] + np.diff(edges)[:, None] * share).ravel()
        speed = profile.at(depths)
        between = profile.at(profile.between(np.array([upper]), np.array([lower]))).max()
        passed = np.maximum.accumulate(np.concatenate([[between], speed[:-1]]))
        turns = speed > passed
        begins = np.concatenate([[end], depths[:-1]])
        short = np.where(turns, _rays_between(profile, upper, lower, end, depths)[0] - distance, np.nan)
        # Rays turn from the depth on at which the speed is the largest so far.
        slower = profile.at(begins)
        share = np.clip((passed - slower) / np.where(turns, speed - slower, 1.0), 0.0, 1.0)
        begins = begins + share * (depths - begins)
        before = np.where(turns, _rays_between(profile, upper, lower, end, begins)[0] - distance, np.nan)
        for k in np.flatnonzero(turns & (before * short <= 0.0)).tolist():
            low, high, rising = begins[k], depths[k], short[k] > before[k]
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + high)
                if (_rays_between(profile, upper, lower, end, np.array([middle]))[0][0] < distance) == rising:
                    low = middle
                else:
                    high = middle
            covered, time, slowness = (float(a[0]) for a in _rays_between(profile, upper, lower, end, np.array([low])))
            time += slowness * (distance - covered)
            if not time >= best[0]:
                best = (time, slowness, sign)
    return best


def _rays_between(profile: Profile, upper: float, lower: float, end: float, turn: Array) -> tuple[Array, Array, Array]:
    """Distances, times and p of rays between two depths that turn at m depths beyond one end."""
    slowness, m = 1.0 / profile.at(turn), len(turn)
    total = []
    for first, last in ((np.full(m, upper), np.full(m, lower)), (np.minimum(end, turn), np.maximum(end, turn))):
        nodes = profile.between(first, last)
        total.append(_covered(nodes, profile.at(nodes), slowness))
    (x, t), (beyond, more) = total
    return x + 2.0 * beyond, t + 2.0 * more, slowness
