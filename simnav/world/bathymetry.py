"""Bathymetry: a grid of depths, random with a seed of its own or from a file, and the chart of it that navigators have.

The random relief (`simnav.world.relief`) lies on a plane that may slope. It is that of a place: the same in all runs.
The true bottom is the chart, or the chart plus an error of the chart: a random relief with exponential covariance,
which each run draws anew.

``[surroundings.bathymetry]`` takes the place of ``water_depth_m``: whatever asks for the bottom finds it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from math import cos, degrees, pi, sin
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from simnav.geometry.earth import principal_radii
from simnav.spec import NonNegative, Positive, SpecError, quantity
from simnav.streams import stream
from simnav.types import Array
from simnav.world.depth_grid import DepthGrid
from simnav.world.grid_files import read_grid
from simnav.world.relief import relief
from simnav.world.start import Start
from simnav.world.surroundings import SurroundingsError, SurroundingSpec, register_surrounding

__all__ = ["Bathymetry", "Bottom"]

#: The largest number of nodes.
_MOST_NODES = 4_000_000
#: Depths are given to this [m], as charts have them.
_RESOLUTION = 0.001


@register_surrounding
class Bathymetry(SurroundingSpec):
    """Depths of the bottom on a grid.

    Attributes
    ----------
    latitude, longitude : float or None
        Middle of the grid [rad]. With a file they may be left out: the grid is then all of the file.
    extent : (float, float)
        Length of the grid, north and east [m].
    spacing : float
        Of the nodes; with a file it is that of the file [m].
    depth : float
        Mean depth in the middle of the grid [m].
    roughness : float
        Standard deviation of the depth about the plane [m].
    scale : float
        Below it the relief is fractal [m].
    hurst : float
        Hurst exponent of the relief, between 0 and 1: the fractal dimension is 3 - hurst.
    slope : float
        How much deeper the plane becomes with the distance.
    slope_direction : float
        Direction in which it becomes deeper, from north to east [rad].
    seed : int
        Of the relief. It does not depend on the run.
    file : str
        A GeoTIFF or NetCDF file in place of the random relief (`simnav.world.grid_files`); empty for none.
    variable : str
        Variable of a NetCDF file; empty: the only one over latitude and longitude.
    values : str
        What the file has: ``elevation``, positive up, or ``depth``.
    chart_error : float
        Standard deviation of the difference between the true depth and that of the chart [m].
    chart_error_scale : float
        Distance over which this difference is correlated [m].

    Examples
    --------
    >>> spec = Bathymetry.from_toml({"latitude_deg": 54.0, "longitude_deg": 7.9, "depth_m": 60, "roughness_m": 0})
    >>> spec.build("bathymetry", 1).depth(np.array([[spec.latitude, spec.longitude, 0.0]]), np.zeros(1))
    array([60.])
    """

    files: ClassVar[tuple[str, ...]] = ("file",)

    kind: Literal["bathymetry"] = "bathymetry"
    latitude: float | None = quantity("deg", None)
    longitude: float | None = quantity("deg", None)
    extent: tuple[Positive, Positive] = quantity("m", (4000.0, 4000.0))
    spacing: Positive = quantity("m", 10.0)
    depth: Positive = quantity("m", 100.0)
    roughness: NonNegative = quantity("m", 5.0)
    scale: Positive = quantity("m", 300.0)
    hurst: float = Field(0.8, gt=0.0, lt=1.0)
    slope: NonNegative = quantity("percent", 0.0)
    slope_direction: float = quantity("deg", 0.0)
    seed: int = Field(1, ge=0)
    file: str = ""
    variable: str = ""
    values: Literal["elevation", "depth"] = "elevation"
    chart_error: NonNegative = quantity("m", 0.0)
    chart_error_scale: Positive = quantity("m", 50.0)

    @model_validator(mode="after")
    def _placed(self) -> Self:
        if (self.latitude is None) != (self.longitude is None):
            raise ValueError("latitude_deg and longitude_deg of the middle belong together")
        if self.file:
            made = sorted(
                {"spacing", "depth", "roughness", "scale", "hurst", "slope", "slope_direction", "seed"}
                & self.model_fields_set
            )
            if made:
                raise ValueError(f"{made[0]}: it is of a random relief; with a file leave it out")
            self.grid()  # an error of the file is one of the scenario
            return self
        if self.variable or "values" in self.model_fields_set:
            raise ValueError("variable and values belong to a file")
        if self.latitude is None:
            raise ValueError("latitude_deg and longitude_deg of the middle are missing")
        rows, columns = self._shape()
        if min(rows, columns) < 2 or rows * columns > _MOST_NODES:
            raise ValueError(
                f"extent_m = {list(self.extent)} with spacing_m = {self.spacing:g} makes {rows} by {columns} nodes; "
                f"there should be two or more each way, and at most {_MOST_NODES} together"
            )
        return self

    @model_serializer(mode="wrap")
    def _with_content(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """The digest of a scenario changes with the content of its file."""
        table: dict[str, Any] = serialize(self)
        if self.file:
            table["content"] = hashlib.blake2b(self.grid().depth.tobytes(), digest_size=16).hexdigest()
        return table

    def _shape(self) -> tuple[int, int]:
        rows, columns = (round(length / self.spacing) + 1 for length in self.extent)
        return rows, columns

    def grid(self) -> DepthGrid:
        """The depths of the chart.

        Raises
        ------
        SpecError
            If the file is not valid, or has no depths where they should be.
        """
        if self.file:
            return _of_file(self, Path(self.file).stat().st_mtime_ns if Path(self.file).exists() else 0)
        return _random(self)

    def chart(self) -> Mapping[str, Any]:
        """See `SurroundingSpec.chart`."""
        return _chart(self.grid())

    def check(self, name: str, start: Start | None) -> None:
        """See `SurroundingSpec.check`."""
        if start is None:
            return
        grid = self.grid()
        if not grid.lies(start.latitude, start.longitude):
            place = np.array([start.latitude, start.longitude, 0.0])
            raise ValueError(f"surroundings.{name}: the voyage starts elsewhere: {grid.outside(place)}")
        deep = float(grid.at(grid.offset(np.array([[start.latitude, start.longitude, 0.0]])))[0][0])
        if -start.altitude >= deep:
            raise ValueError(
                f"start.depth_m = {-start.altitude:g} is below the bottom, which surroundings.{name} has there at "
                f"{deep:.1f} m"
            )

    def build(self, name: str, seed: int) -> Bottom:
        """See `SurroundingSpec.build`."""
        grid = self.grid()
        if self.chart_error:
            rows, columns = grid.depth.shape
            north, east = grid.spacing.tolist()
            rng = stream(seed, "surroundings", name, "chart_error")
            error = relief((rows, columns), (north, east), self.chart_error, self.chart_error_scale, 0.5, rng)
            grid = DepthGrid(grid.middle, grid.spacing, grid.depth + error)
        return Bottom(grid, name)


class Bottom:
    """The true bottom of one run.

    Attributes
    ----------
    grid : DepthGrid
        Its depths.
    """

    def __init__(self, grid: DepthGrid, name: str = "bathymetry"):
        self.grid, self._name = grid, name

    def within(self, position: Array) -> Array:
        """(n, 2) places of (n, 3) positions on the grid, north and east of its middle [m].

        Raises
        ------
        SurroundingsError
            If one of them is outside of the grid.
        """
        offset = self.grid.offset(position)
        out = ~self.grid.inside(offset)
        if out.any():
            raise SurroundingsError(
                f"surroundings.{self._name}: {self.grid.outside(position[int(np.argmax(out))])}; the voyage should "
                "stay on the grid"
            )
        return offset

    def depth(self, position: Array, time: Array) -> Array:
        """The (n,) depths of the bottom below the mean sea surface [m] at n positions and times."""
        return self.grid.at(self.within(position))[0]


@lru_cache(maxsize=8)
def _random(spec: Bathymetry) -> DepthGrid:
    """The plane with the relief of a specification."""
    assert spec.latitude is not None
    assert spec.longitude is not None
    shape, step = spec._shape(), spec.spacing
    north, east = (step * (np.arange(n) - 0.5 * (n - 1)) for n in shape)
    along = cos(spec.slope_direction) * north[:, None] + sin(spec.slope_direction) * east[None]
    depth = spec.depth + spec.slope * along
    if spec.roughness:
        rng = stream(spec.seed, "bathymetry", "relief")
        depth = depth + relief(shape, (step, step), spec.roughness, spec.scale, spec.hurst, rng)
    if depth.min() <= 0.0:
        raise SpecError(
            f"bathymetry: depth_m = {spec.depth:g}, roughness_m = {spec.roughness:g} and slope_percent = "
            f"{100.0 * spec.slope:g} make land: the least depth is {depth.min():.1f} m; it should be above 0"
        )
    depth = np.round(depth / _RESOLUTION) * _RESOLUTION
    return DepthGrid(np.array([spec.latitude, spec.longitude, 0.0]), np.array([step, step]), depth)


@lru_cache(maxsize=8)
def _of_file(spec: Bathymetry, modified: int) -> DepthGrid:
    """The depths of a file, or of the part of it that is asked for."""
    path, given = Path(spec.file), read_grid(Path(spec.file), spec.variable)
    latitude, longitude, value = given.latitude, given.longitude, given.value
    if spec.latitude is not None and spec.longitude is not None:
        meridian, prime = principal_radii(spec.latitude)
        reach = 0.5 * spec.extent[0] / meridian, 0.5 * spec.extent[1] / (prime * cos(spec.latitude))
        rows = abs(latitude - spec.latitude) <= reach[0]
        longitude = longitude + 2.0 * pi * np.round((spec.longitude - longitude) / (2.0 * pi))  # also across its edge
        order = np.argsort(longitude, kind="stable")
        order = order[np.append(np.diff(longitude[order]) > 1e-9, True)]  # 0 and 360 degrees are one place
        longitude, value = longitude[order], value[:, order]
        columns = abs(longitude - spec.longitude) <= reach[1]
        if rows.sum() < 2 or columns.sum() < 2:
            raise SpecError(
                f"{path}: it spans {_span(latitude)} N, {_span(longitude)} E: the place latitude_deg = "
                f"{degrees(spec.latitude):g}, longitude_deg = {degrees(spec.longitude):g} is elsewhere, or extent_m = "
                f"{list(spec.extent)} has fewer than two nodes"
            )
        latitude, longitude, value = latitude[rows], longitude[columns], value[np.ix_(rows, columns)]
    if value.size > _MOST_NODES:
        raise SpecError(
            f"{path}: {value.shape[0]} by {value.shape[1]} nodes are too many, {_MOST_NODES} go; latitude_deg, "
            "longitude_deg and extent_m take a part"
        )
    depth = -value if spec.values == "elevation" else value
    bad = ~(np.isfinite(depth) & (depth > 0.0))
    if bad.any():
        i, j = (int(k[0]) for k in np.nonzero(bad))
        number = "no value" if not np.isfinite(value[i, j]) else f"the {spec.values} {value[i, j]:g} m, which is land,"
        raise SpecError(
            f"{path}: it has {number} at {degrees(latitude[i]):.4f} N, {degrees(longitude[j]):.4f} E, and {bad.sum()} "
            f"nodes of this kind; latitude_deg, longitude_deg and extent_m should take a part of water"
        )
    middle = np.array([0.5 * (latitude[0] + latitude[-1]), 0.5 * (longitude[0] + longitude[-1]), 0.0])
    along, across = (float(radius) for radius in principal_radii(middle[0]))
    steps = (latitude[-1] - latitude[0]) / (len(latitude) - 1), (longitude[-1] - longitude[0]) / (len(longitude) - 1)
    spacing = np.array([steps[0] * along, steps[1] * across * cos(middle[0])])
    return DepthGrid(middle, spacing, np.ascontiguousarray(depth))


@lru_cache(maxsize=8)
def _chart(grid: DepthGrid) -> Mapping[str, Any]:
    """The chart of a grid, one object for all datasheets."""
    return grid.chart()


def _span(angle: Array) -> str:
    return f"{degrees(angle[0]):.4f} to {degrees(angle[-1]):.4f}"
