"""Obstacles around a vessel that block and reflect signals: quays, cranes, bridges, cliffs, a ship alongside.

An obstacle is a prism: a polygon on the map, from a height ``bottom`` to a height ``top`` above the ellipsoid. A ray
from an antenna in the direction of a satellite is **blocked** if it meets a face. A wall **reflects** a signal as a
mirror: with the distance d of the antenna from the wall's plane, the wall's outward normal m and the direction u of the
satellite, the ray leaves the image of the antenna behind the wall, and the reflected signal travels further by::

    excess = 2 d (u . m)

if the point of reflection lies on the wall, and neither leg of the way is blocked. Of several reflections that with the
shortest way counts.

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, sections 9.3.4 and 10.4.1; the excess is that of a plane wave on a plane mirror.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, inf, sin
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, SerializerFunctionWrapHandler, ValidationError, model_serializer, model_validator

from simnav.compiled import Array, Integers, helper, kernel
from simnav.geometry.earth import relative_position
from simnav.kernel_types import FlagMatrix, IntegerVector, Matrix
from simnav.spec import Positive, Spec, SpecError, quantity, without_later
from simnav.world.geojson import read_buildings
from simnav.world.surroundings import SurroundingSpec, register_surrounding

__all__ = ["Obstacle", "ObstacleMap", "Obstacles", "Paths"]

_Corner = tuple[float, float]
#: A polygon of a smaller area is a line or a point [m^2].
_LEAST_AREA = 1e-3
#: Points of a ray nearer than this do not count: those of the wall that reflects it [m].
_NEAREST = 1e-6


class Obstacle(Spec):
    """A prism: over a polygon, or over a rectangle.

    Attributes
    ----------
    name : str
        Name, for messages.
    corners : tuple of (float, float)
        Corners of the polygon, north and east of the origin of the map [m]; three or more, in order.
    centre : (float, float) or None
        Of the rectangle, north and east of the origin [m].
    size : (float, float) or None
        Length and width of the rectangle [m].
    heading : float
        Direction of its length [rad].
    bottom, top : float
        Heights above the ellipsoid [m].
    """

    later: ClassVar[Mapping[str, Any]] = {"corners": (), "centre": None, "size": None, "heading": 0.0}

    name: str = ""
    corners: Annotated[tuple[_Corner, ...], Field(max_length=1000)] = quantity("m", ())
    centre: _Corner | None = quantity("m", None)
    size: tuple[Positive, Positive] | None = quantity("m", None)
    heading: float = quantity("deg", 0.0)
    bottom: float = quantity("m", 0.0)
    top: float = quantity("m")

    @model_validator(mode="after")
    def _proper(self) -> Self:
        if not self.bottom < self.top:
            raise ValueError(f"obstacle {self.name!r}: top_m = {self.top:g} should be above bottom_m = {self.bottom:g}")
        if (self.centre is None) != (self.size is None) or (self.centre is None) != bool(self.corners):
            raise ValueError(f"obstacle {self.name!r}: it has either corners_m, or centre_m and size_m")
        if self.centre is None and len(self.corners) < 3:
            raise ValueError(f"obstacle {self.name!r}: corners_m are three or more, not {len(self.corners)}")
        if abs(_area(self.outline())) < _LEAST_AREA:
            raise ValueError(f"obstacle {self.name!r}: its corners_m lie on a line; they should enclose an area")
        return self

    @model_serializer(mode="wrap")
    def _without_later(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return without_later(serialize(self), self.later)

    def outline(self) -> Array:
        """The (k, 2) corners, north and east of the origin [m]."""
        if self.centre is None or self.size is None:
            return np.array(self.corners)
        half, c, s = 0.5 * np.array(self.size), cos(self.heading), sin(self.heading)
        ends = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * half
        return np.asarray(self.centre + ends @ np.array([[c, s], [-s, c]]))


@register_surrounding
class Obstacles(SurroundingSpec):
    """Obstacles of a place.

    Attributes
    ----------
    latitude, longitude : float or None
        Origin of the map [rad]; with a file it may be left out, and is then the first corner in the file.
    obstacle : tuple of Obstacle
        The obstacles.
    file : str
        A GeoJSON file with further obstacles (`simnav.world.geojson`); empty for none.
    """

    files: ClassVar[tuple[str, ...]] = ("file",)

    kind: Literal["obstacles"] = "obstacles"
    latitude: float | None = quantity("deg", None)
    longitude: float | None = quantity("deg", None)
    obstacle: Annotated[tuple[Obstacle, ...], Field(max_length=1000)] = ()
    file: str = ""

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if (self.latitude is None) != (self.longitude is None):
            raise ValueError("latitude_deg and longitude_deg belong together")
        if self.latitude is None and (self.obstacle or not self.file):
            raise ValueError("latitude_deg and longitude_deg of the origin are missing")
        if self.file:
            self.every()  # an error of the file is one of the scenario
        return self

    @model_serializer(mode="wrap")
    def _without_file(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The digest of a scenario without a file is what it was before there were any."""
        table: dict[str, Any] = serialize(self)
        if not self.file:
            table.pop("file", None)
        return table

    def every(self) -> tuple[tuple[float, float], tuple[Obstacle, ...]]:
        """The origin of the map [rad], and all obstacles, those of the file included.

        Raises
        ------
        SpecError
            If the file is not valid.
        """
        buildings = read_buildings(Path(self.file)) if self.file else []
        if self.latitude is None or self.longitude is None:
            latitude, longitude = buildings[0].corners[0].tolist()
        else:
            latitude, longitude = self.latitude, self.longitude
        origin, found = np.array([latitude, longitude, 0.0]), list(self.obstacle)
        for building in buildings:
            place = np.column_stack([building.corners, np.zeros(len(building.corners))])
            corners = tuple(map(tuple, relative_position(place, origin)[:, :2].tolist()))
            try:
                found.append(Obstacle(name=building.name, corners=corners, bottom=building.bottom, top=building.top))
            except ValidationError as error:
                raise SpecError(f"{self.file}: {error.errors()[0]['msg'].removeprefix('Value error, ')}") from None
        return (latitude, longitude), tuple(found)

    def build(self, name: str, seed: int) -> ObstacleMap:
        """See `SurroundingSpec.build`."""
        return ObstacleMap(self)


class Paths(NamedTuple):
    """The ways of the signals of c satellites to an antenna at n times.

    Attributes
    ----------
    blocked : (n, c) array of bool
        Whether the direct way is blocked.
    excess : (n, c) array
        How much longer the reflected way is [m]; infinite without a reflection.
    excess_rate : (n, c) array
        Its derivative by the motion of the antenna [m/s]; zero without a reflection.
    """

    blocked: NDArray[np.bool_]
    excess: Array
    excess_rate: Array


class ObstacleMap:
    """The obstacles of a run.

    Parameters
    ----------
    spec : Obstacles
        Their specification.
    """

    def __init__(self, spec: Obstacles):
        origin, obstacles = spec.every()
        self._origin = np.array([*origin, 0.0])
        self._names = [o.name or f"number {k}" for k, o in enumerate(obstacles, 1)]
        polygons = [o.outline() for o in obstacles]
        polygons = [p if _area(p) > 0.0 else p[::-1] for p in polygons]
        walls = [np.hstack([p, np.roll(p, -1, axis=0)]) for p in polygons]
        self._walls = np.ascontiguousarray(np.concatenate(walls) if walls else np.empty((0, 4)))
        self._first = np.cumsum([0, *(len(w) for w in walls)]).astype(np.int64)
        self._heights = np.array([(o.bottom, o.top) for o in obstacles]).reshape(-1, 2)

    def paths(self, position: Array, velocity: Array, elevation: Array, azimuth: Array) -> Paths:
        """The ways of signals from c directions to an antenna at n times.

        Parameters
        ----------
        position, velocity : (n, 3) array
            Of the antenna: latitude, longitude [rad], height [m]; north-east-down [m/s].
        elevation, azimuth : (n, c) array
            Directions [rad].

        Raises
        ------
        SpecError
            If the antenna is within an obstacle: the message names it.
        """
        place = relative_position(position, self._origin)
        place[:, 2] = position[:, 2]
        shape = elevation.shape
        blocked, excess, rate = np.empty(shape, np.bool_), np.empty(shape), np.empty(shape)
        moving, up, around = (np.ascontiguousarray(a, dtype=np.float64) for a in (velocity, elevation, azimuth))
        scene = self._walls, self._first, self._heights
        found = _trace(scene, place, moving, up, around, blocked, excess, rate)
        if found >= 0:
            inside, row = found % len(self._names), found // len(self._names)
            north, east, height = place[row]
            raise SpecError(
                f"the antenna is within the obstacle {self._names[inside]!r}, {north:.1f} m north and {east:.1f} m "
                f"east of the origin at a height of {height:.1f} m; move the obstacle or the vessel"
            )
        return Paths(blocked, excess, rate)


def _area(corners: Array) -> float:
    """Area of a polygon, positive if its corners run from north to east."""
    north, east = corners.T
    return float(0.5 * np.sum(north * np.roll(east, -1) - np.roll(north, -1) * east))


@helper
def _within(walls: Array, first: int, last: int, north: float, east: float) -> bool:
    """Whether a point is inside a polygon (the number of walls to the north of it is odd)."""
    inside = False
    for k in range(first, last):
        e0, e1 = walls[k, 1], walls[k, 3]
        if (e0 > east) != (e1 > east):
            crossing = walls[k, 0] + (east - e0) / (e1 - e0) * (walls[k, 2] - walls[k, 0])
            if crossing > north:
                inside = not inside
    return inside


@helper
def _meets(
    scene: tuple[Array, Integers, Array],
    skip: int,
    point: tuple[float, float, float],
    ray: tuple[float, float, float],
    reach: float,
) -> bool:
    """Whether a ray meets a face within a distance; ``skip`` is a wall that does not count."""
    walls, first, heights = scene
    n, e, h = point
    un, ue, up = ray
    for b in range(heights.shape[0]):
        bottom, top = heights[b, 0], heights[b, 1]
        for k in range(first[b], first[b + 1]):
            if k == skip:
                continue
            dn, de = walls[k, 2] - walls[k, 0], walls[k, 3] - walls[k, 1]
            across = un * de - ue * dn
            if across == 0.0:
                continue
            an, ae = walls[k, 0] - n, walls[k, 1] - e
            t = (an * de - ae * dn) / across
            s = (an * ue - ae * un) / across
            if t > _NEAREST and t < reach and s >= 0.0 and s <= 1.0 and bottom <= h + t * up <= top:
                return True
        if up != 0.0:
            for level in range(2):
                t = (heights[b, level] - h) / up
                if t > _NEAREST and t < reach and _within(walls, first[b], first[b + 1], n + t * un, e + t * ue):
                    return True
    return False


@kernel
def _trace(
    scene: tuple[Matrix, IntegerVector, Matrix],
    place: Matrix,
    velocity: Matrix,
    elevation: Matrix,
    azimuth: Matrix,
    blocked: FlagMatrix,
    excess: Matrix,
    rate: Matrix,
) -> int:
    """Overwrite the last three arrays with the fields of `Paths`.

    ``scene`` holds walls (w, 4): both ends, north and east; the first wall of each obstacle; bottom and top of each.
    ``place`` is (n, 3): north, east, height. Returns -1, or ``row * obstacles + obstacle`` if an antenna is within one.
    """
    walls, first, heights = scene
    for i in range(place.shape[0]):
        n, e, h = place[i, 0], place[i, 1], place[i, 2]
        for b in range(heights.shape[0]):
            if heights[b, 0] <= h <= heights[b, 1] and _within(walls, first[b], first[b + 1], n, e):
                found: int = i * heights.shape[0] + b
                return found
        for j in range(elevation.shape[1]):
            level = cos(elevation[i, j])
            un, ue, up = level * cos(azimuth[i, j]), level * sin(azimuth[i, j]), sin(elevation[i, j])
            excess[i, j], rate[i, j] = inf, 0.0
            blocked[i, j] = _meets(scene, -1, (n, e, h), (un, ue, up), inf)
            for b in range(heights.shape[0]):
                for k in range(first[b], first[b + 1]):
                    dn, de = walls[k, 2] - walls[k, 0], walls[k, 3] - walls[k, 1]
                    length = (dn * dn + de * de) ** 0.5
                    if length == 0.0:
                        continue
                    mn, me = de / length, -dn / length
                    away = (n - walls[k, 0]) * mn + (e - walls[k, 1]) * me
                    along = un * mn + ue * me
                    if away <= 0.0 or along <= 0.0:
                        continue
                    further = 2.0 * away * along
                    if further >= excess[i, j]:
                        continue
                    t = away / along
                    qn, qe, qh = n - 2.0 * away * mn + t * un, e - 2.0 * away * me + t * ue, h + t * up
                    s = ((qn - walls[k, 0]) * dn + (qe - walls[k, 1]) * de) / (length * length)
                    if s < 0.0 or s > 1.0 or qh < heights[b, 0] or qh > heights[b, 1]:
                        continue
                    back = (un - 2.0 * along * mn, ue - 2.0 * along * me, up)  # from the antenna to the wall
                    if _meets(scene, k, (n, e, h), back, t) or _meets(scene, k, (qn, qe, qh), (un, ue, up), inf):
                        continue
                    excess[i, j] = further
                    rate[i, j] = 2.0 * along * (velocity[i, 0] * mn + velocity[i, 1] * me)
    return -1
