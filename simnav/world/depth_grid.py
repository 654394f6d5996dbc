"""A grid of depths: bicubic interpolation with gradients, and the distance to the bottom along a ray.

The nodes are regular in metres north and east of the middle of the grid. Between them the depth is that of cubic
convolution, which is exact at the nodes and has continuous gradients. Beyond its edges a grid goes on level.

Source: R. G. Keys, *Cubic convolution interpolation for digital image processing*, IEEE Transactions on Acoustics,
Speech, and Signal Processing 29(6), 1981.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import principal_radii, relative_position
from simnav.types import Array

__all__ = ["DepthGrid", "grid_of"]

#: Steps of Newton's method for a ray that is not vertical, and the least rate of approach to the bottom, in metres of
#: depth for each metre of the ray.
_STEPS, _GRAZING = 8, 0.1
#: A ray has arrived where the bottom is so near [m].
_ARRIVED = 1e-6
#: Charts that are kept as grids.
_MOST_KEPT = 16
_kept: dict[int, tuple[Any, DepthGrid]] = {}


@dataclass(frozen=True, eq=False)
class DepthGrid:
    """Depths of the bottom at nodes.

    Attributes
    ----------
    middle : (3,) array
        Latitude and longitude of the middle of the grid [rad], and 0.
    spacing : (2,) array
        Of the nodes, north and east [m].
    depth : (r, c) array
        Below the mean sea surface, rows from south to north, columns from west to east [m].

    Examples
    --------
    >>> grid = DepthGrid(np.zeros(3), np.array([10.0, 10.0]), np.array([[40.0, 42.0], [40.0, 42.0]]))
    >>> grid.at(np.zeros((1, 2)))[0]
    array([41.])
    """

    middle: Array
    spacing: Array
    depth: Array

    @property
    def half(self) -> Array:
        """(2,) distances from the middle to the outermost nodes, north and east [m]."""
        return 0.5 * self.spacing * (np.array(self.depth.shape) - 1.0)

    def offset(self, position: Array) -> Array:
        """(n, 2) places north and east of the middle [m] of (n, 3) positions."""
        return np.asarray(relative_position(position, self.middle)[..., :2])

    def inside(self, offset: Array) -> NDArray[np.bool_]:
        """(n,) mask of the places that lie on the grid; a grid of one node is everywhere."""
        if self.depth.size == 1:
            return np.ones(len(offset), np.bool_)
        return np.asarray((abs(offset) <= self.half + 1e-6).all(axis=1))

    def span(self) -> str:
        """The corners, for messages: ``53.98 to 54.02 N, 7.86 to 7.94 E``."""
        meridian, prime = principal_radii(self.middle[0])
        north = np.degrees(self.middle[0] + np.array([-1.0, 1.0]) * self.half[0] / meridian)
        east = np.degrees(self.middle[1] + np.array([-1.0, 1.0]) * self.half[1] / (prime * np.cos(self.middle[0])))
        return f"{north[0]:.4f} to {north[1]:.4f} N, {east[0]:.4f} to {east[1]:.4f} E"

    def at(self, offset: Array) -> tuple[Array, Array]:
        """Depth and gradient at n places.

        Parameters
        ----------
        offset : (n, 2) array
            North and east of the middle [m].

        Returns
        -------
        depth : (n,) array
            [m]
        gradient : (n, 2) array
            Derivative of the depth northwards and eastwards; zero beyond the edges.
        """
        n = len(offset)
        index, weight, slope = [], [], []
        for axis in range(2):
            last = self.depth.shape[axis] - 1
            u = offset[:, axis] / self.spacing[axis] + 0.5 * last
            within = (u >= 0.0) & (u <= last)
            u = np.clip(u, 0.0, last)
            first = np.minimum(u.astype(np.intp), max(last - 1, 0))
            t = u - first
            index.append(np.clip(first[:, None] + np.arange(-1, 3), 0, last))
            w, dw = _weights(t)
            weight.append(w)
            slope.append(dw * (within / self.spacing[axis])[:, None])
        nodes = self.depth[index[0][:, :, None], index[1][:, None, :]]
        along = np.matmul(nodes, weight[1][:, :, None])[:, :, 0]
        depth = np.sum(along * weight[0], axis=1)
        gradient = np.empty((n, 2))
        gradient[:, 0] = np.sum(along * slope[0], axis=1)
        gradient[:, 1] = np.sum(np.matmul(nodes, slope[1][:, :, None])[:, :, 0] * weight[0], axis=1)
        return depth, gradient

    def distance(self, offset: Array, depth: Array, ray: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Distance to the bottom from n places along a ray from each, by Newton's method.

        Parameters
        ----------
        offset : (n, 2) array
            Places north and east of the middle [m].
        depth : (n,) array
            Depth of the places [m].
        ray : (n, 3) array
            Unit vectors, north-east-down, that point down.

        Returns
        -------
        distance : (n,) array
            [m]; negative below the bottom.
        gradient : (n, 2) array
            Of the depth where the ray meets the bottom.
        met : (n,) array of bool
            Whether the ray comes to the bottom there, to a millimetre and not grazing.
        """
        found, gradient = self.at(offset)
        level = ~ray[:, :2].any()
        distance = (found - depth) / np.maximum(ray[:, 2], _GRAZING)
        if level:
            return distance, gradient, np.ones(len(distance), np.bool_)
        above, closing = np.full(len(distance), np.inf), np.empty(len(distance))
        moving = np.arange(len(distance))
        for _ in range(_STEPS):  # a ray that has arrived stays as it is, whatever other rays do
            there, down = distance[moving], ray[moving, 2]
            found, gradient[moving] = self.at(offset[moving] + there[:, None] * ray[moving, :2])
            above[moving] = found - depth[moving] - there * down
            closing[moving] = down - np.sum(gradient[moving] * ray[moving, :2], axis=1)
            moving = moving[abs(above[moving]) > _ARRIVED]
            if not len(moving):
                break
            distance[moving] += above[moving] / np.maximum(closing[moving], _GRAZING)
        return distance, gradient, (abs(above) < 1e-3) & (closing > _GRAZING)

    def chart(self) -> dict[str, Any]:
        """The grid as a datasheet has it: `grid_of` makes a grid of it again."""
        return {
            "latitude": float(self.middle[0]),
            "longitude": float(self.middle[1]),
            "spacing": self.spacing.tolist(),
            "depth": self.depth,
        }

    @classmethod
    def level(cls, depth: float) -> DepthGrid:
        """A bottom of the same depth everywhere."""
        return cls(np.zeros(3), np.ones(2), np.full((1, 1), depth))

    def lies(self, latitude: float, longitude: float) -> bool:
        """Whether a place [rad] is on the grid."""
        return bool(self.inside(self.offset(np.array([[latitude, longitude, 0.0]])))[0])

    def outside(self, position: Array) -> str:
        """A sentence about a (3,) position that is not on the grid."""
        return (
            f"{degrees(position[0]):.4f} N, {degrees(position[1]):.4f} E is outside of the grid of depths, which spans "
            f"{self.span()}"
        )


def grid_of(chart: Mapping[str, Any]) -> DepthGrid:
    """The grid of a chart (`DepthGrid.chart`), which is made once for each chart."""
    kept = _kept.get(id(chart))
    if kept is not None and kept[0] is chart:
        return kept[1]
    grid = DepthGrid(
        np.array([chart["latitude"], chart["longitude"], 0.0]),
        np.asarray(chart["spacing"], dtype=np.float64),
        np.asarray(chart["depth"], dtype=np.float64),
    )
    while len(_kept) >= _MOST_KEPT:
        _kept.pop(next(iter(_kept)))
    _kept[id(chart)] = chart, grid
    return grid


def _weights(t: Array) -> tuple[Array, Array]:
    """(n, 4) weights of the nodes -1 to 2 at n places between the nodes 0 and 1, and their derivatives."""
    t2 = t * t
    t3 = t2 * t
    weight, slope = np.empty((len(t), 4)), np.empty((len(t), 4))
    weight[:, 0], slope[:, 0] = -0.5 * t3 + t2 - 0.5 * t, -1.5 * t2 + 2.0 * t - 0.5
    weight[:, 1], slope[:, 1] = 1.5 * t3 - 2.5 * t2 + 1.0, 4.5 * t2 - 5.0 * t
    weight[:, 2], slope[:, 2] = -1.5 * t3 + 2.0 * t2 + 0.5 * t, -4.5 * t2 + 4.0 * t + 0.5
    weight[:, 3], slope[:, 3] = 0.5 * t3 - 0.5 * t2, 1.5 * t2 - t
    return weight, slope
