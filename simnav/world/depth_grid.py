"""A grid of depths: bicubic interpolation with gradients, and the distance to the bottom along a ray.

The nodes are regular in metres north and east of the middle of the grid. Between them the depth is that of cubic
convolution, which is exact at the nodes and has continuous gradients. Beyond its edges a grid goes on level.

Source: R. G. Keys, *Cubic convolution interpolation for digital image processing*, IEEE Transactions on Acoustics,
Speech, and Signal Processing 29(6), 1981.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import degrees, inf, isnan, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import helper, kernel, ready
from simnav.geometry.earth import principal_radii, relative_position
from simnav.kernel_types import FlagVector, Matrix, Vector
from simnav.types import Array

__all__ = ["DepthGrid", "grid_of"]

#: Steps of Newton's method for a ray that is not vertical, and the least rate of approach to the bottom, in metres of
#: depth for each metre of the ray.
_STEPS, _GRAZING = 8, 0.1
#: A ray has arrived where the bottom is so near, and has met it where it is so near in the end [m].
_ARRIVED, _NEAR = 1e-6, 1e-3
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

    @cached_property
    def _nodes(self) -> Array:
        """The depths, as kernels take them."""
        return ready(self.depth)

    @cached_property
    def _spacing(self) -> tuple[float, float]:
        return float(self.spacing[0]), float(self.spacing[1])

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
        depth, gradient = np.empty(len(offset)), np.empty((len(offset), 2))
        _depths(self._nodes, *self._spacing, ready(offset), depth, gradient)
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
        n = len(offset)
        distance, gradient, met = np.empty(n), np.empty((n, 2)), np.empty(n, np.bool_)
        given = ready(offset), ready(depth), ready(ray)
        _distances(self._nodes, *self._spacing, *given, distance, gradient, met)
        return distance, gradient, met

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


@helper
def _between(place: float, spacing: float, last: int) -> tuple[int, float, float]:
    """The node before a place, the part of the way to the next one, and the derivative of that: zero beyond an edge."""
    node = place / spacing + 0.5 * last
    slope = 1.0 / spacing if 0.0 <= node <= last else 0.0
    node = min(max(node, 0.0), float(last))
    first = min(int(node), max(last - 1, 0))
    return first, node - first, slope


class _FourNodes(NamedTuple):
    """A number of each node around a place, from the one before the last node to the one after the next."""

    before: float
    last: float
    next: float
    after: float


@helper
def _weights(t: float) -> _FourNodes:
    """Weights of the nodes at a place between the nodes 0 and 1, of Keys."""
    t2 = t * t
    t3 = t2 * t
    return _FourNodes(
        -0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2
    )


@helper
def _slopes(t: float) -> _FourNodes:
    """Derivatives of `_weights`."""
    t2 = t * t
    return _FourNodes(-1.5 * t2 + 2.0 * t - 0.5, 4.5 * t2 - 5.0 * t, -4.5 * t2 + 4.0 * t + 0.5, 1.5 * t2 - t)


@helper
def _depth(nodes: Array, spacing_n: float, spacing_e: float, north: float, east: float) -> tuple[float, float, float]:
    """Depth and its derivatives at one place; all are NaN where the place is."""
    if isnan(north) or isnan(east):
        return nan, nan, nan
    rows, columns = nodes.shape[0] - 1, nodes.shape[1] - 1
    row, t, by_north = _between(north, spacing_n, rows)
    column, s, by_east = _between(east, spacing_e, columns)
    weight_n, weight_e, slope_n, slope_e = _weights(t), _weights(s), _slopes(t), _slopes(s)
    depth = gradient_n = gradient_e = 0.0
    for i in range(4):
        k = min(max(row + i - 1, 0), rows)
        along = across = 0.0
        for j in range(4):
            node = nodes[k, min(max(column + j - 1, 0), columns)]
            along += node * weight_e[j]
            across += node * slope_e[j]
        depth += along * weight_n[i]
        gradient_n += along * slope_n[i]
        gradient_e += across * weight_n[i]
    return depth, gradient_n * by_north, gradient_e * by_east


@kernel
def _depths(nodes: Matrix, spacing_n: float, spacing_e: float, offset: Matrix, depth: Vector, gradient: Matrix) -> None:
    """`DepthGrid.at`; the last two arrays are overwritten."""
    for i in range(offset.shape[0]):
        depth[i], gradient[i, 0], gradient[i, 1] = _depth(nodes, spacing_n, spacing_e, offset[i, 0], offset[i, 1])


@kernel
def _distances(
    nodes: Matrix,
    spacing_n: float,
    spacing_e: float,
    offset: Matrix,
    depth: Vector,
    ray: Matrix,
    distance: Vector,
    gradient: Matrix,
    met: FlagVector,
) -> None:
    """`DepthGrid.distance`; the last three arrays are overwritten."""
    for i in range(offset.shape[0]):
        north, east, down = ray[i, 0], ray[i, 1], ray[i, 2]
        found, slope_n, slope_e = _depth(nodes, spacing_n, spacing_e, offset[i, 0], offset[i, 1])
        along_ray = (found - depth[i]) / max(down, _GRAZING)
        met[i] = True
        if north != 0.0 or east != 0.0:
            above, closing = inf, 0.0
            for _ in range(_STEPS):
                found, slope_n, slope_e = _depth(
                    nodes, spacing_n, spacing_e, offset[i, 0] + along_ray * north, offset[i, 1] + along_ray * east
                )
                above = found - depth[i] - along_ray * down
                closing = down - (slope_n * north + slope_e * east)
                if not abs(above) > _ARRIVED:
                    break
                along_ray += above / max(closing, _GRAZING)
            met[i] = abs(above) < _NEAR and closing > _GRAZING
        distance[i], gradient[i, 0], gradient[i, 1] = along_ray, slope_n, slope_e
