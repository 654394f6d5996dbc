"""The level of the water and the pressure of the air above it: what a depth sensor takes for the surface.

Without this part of the surroundings the mean surface is the WGS-84 ellipsoid. With it the surface is at the height ::

    level = N + sum of A cos(2 pi t / T + phase)

above the ellipsoid: the undulation N of the geoid, which may slope or be that of a grid (`simnav.world.geoid`), and the
constituents of the tide. The air pressure
changes by a part that a pressure sensor takes for water, 1 hPa for about 1 cm (``pressure_change`` over the density and
gravity). The sea does not follow it here.

Sources: D. T. Pugh and P. L. Woodworth, *Sea-Level Science*, Cambridge 2014, chapters 3 and 7; the undulation is that
of a geoid model at the place, such as EGM2008.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    BeforeValidator,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from simnav.geometry.earth import relative_position
from simnav.spec import Positive, quantity, register_unit, without_later
from simnav.streams import stream
from simnav.types import Array
from simnav.world.geoid import read_geoid
from simnav.world.start import Start
from simnav.world.surroundings import SurroundingSpec, register_surrounding

__all__ = ["Level", "WaterLevel"]

register_unit("hpa", 100.0)
register_unit("mm_km", 1e-6)

#: Density of sea water [kg/m^3] times gravity [m/s^2].
_WEIGHT = 1025.0 * 9.81


def _listed(value: Any) -> Any:
    return tuple(value) if isinstance(value, (list, tuple)) else (value,)


Figures = Annotated[tuple[float, ...], BeforeValidator(_listed)]


@register_surrounding
class WaterLevel(SurroundingSpec):
    """The height of the mean surface above the ellipsoid, with the tide, and the pressure of the air.

    Attributes
    ----------
    geoid : float
        Undulation of the geoid at the first place that is asked for [m].
    geoid_slope : (float, float)
        Its change to the north and to the east [m/m].
    geoid_grid : str
        Path or name of a grid of undulations in their place; empty for none.
    tide_amplitude, tide_period : tuple of float
        Amplitude [m] and period [s] of each constituent; 12.42 h is the principal lunar one.
    tide_phase : tuple of float, optional
        Phase of each constituent at the start of the run [rad]; None: drawn for each run.
    pressure_change : float
        Change of the air pressure from the start of the run to ``pressure_time`` [Pa], then constant.
    pressure_time : float
        [s].
    """

    files: ClassVar[tuple[str, ...]] = ("geoid_grid",)
    later: ClassVar[Mapping[str, Any]] = {"geoid_grid": ""}

    kind: Literal["water_level"] = "water_level"
    geoid: float = quantity("m", 0.0)
    geoid_slope: tuple[float, float] = quantity("mm_km", (0.0, 0.0))
    geoid_grid: str = ""
    tide_amplitude: Figures = quantity("m", ())
    tide_period: Figures = quantity("h", ())
    tide_phase: Figures | None = quantity("deg", None)
    pressure_change: float = quantity("hpa", 0.0)
    pressure_time: Positive = quantity("h", 3600.0)

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        phases = self.tide_phase if self.tide_phase is not None else self.tide_period
        if not len(self.tide_amplitude) == len(self.tide_period) == len(phases):
            raise ValueError(
                f"tide_amplitude_m, tide_period_h and tide_phase_deg have {len(self.tide_amplitude)}, "
                f"{len(self.tide_period)} and {len(phases)} numbers; each constituent has one of each"
            )
        if any(not period > 0.0 for period in self.tide_period):
            raise ValueError(f"tide_period_h = {[p / 3600.0 for p in self.tide_period]}: periods are greater than 0")
        if self.geoid_grid and {"geoid", "geoid_slope"} & self.model_fields_set:
            raise ValueError(
                f"geoid_grid = {self.geoid_grid!r} has the undulations; geoid_m and geoid_slope_mm_km go without"
            )
        return self

    @field_validator("geoid_grid")
    @classmethod
    def _found(cls, name: str) -> str:
        """Where the grid is: an error of the file is one of the scenario."""
        return str(read_geoid(name).path) if name else name

    @model_serializer(mode="wrap")
    def _without_later(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """See `simnav.spec.without_later`."""
        return without_later(handler(self), self.later)

    def check(self, name: str, start: Start | None) -> None:
        """See `SurroundingSpec.check`."""
        if self.geoid_grid and start is not None:
            read_geoid(self.geoid_grid).undulation(np.array([[start.latitude, start.longitude, 0.0]]))

    def build(self, name: str, seed: int) -> Level:
        """See `SurroundingSpec.build`."""
        drawn = 2.0 * np.pi * stream(seed, "surroundings", name, "tide").random(len(self.tide_period))
        return Level(self, drawn if self.tide_phase is None else np.asarray(self.tide_phase))


class Level:
    """The level of the water in one run.

    Parameters
    ----------
    spec : WaterLevel
        Its description.
    phase : (k,) array
        Phases of the constituents of the tide at the start [rad].
    """

    def __init__(self, spec: WaterLevel, phase: Array):
        self.spec, self._phase = spec, phase
        self._origin: Array | None = None

    def height(self, position: Array, time: Array) -> Array:
        """The (n,) heights of the mean surface above the ellipsoid [m] at n positions and times."""
        if self._origin is None and len(position):
            self._origin = np.array(position[0])
        level = np.full(len(time), self.spec.geoid)
        if self.spec.geoid_grid:
            level = read_geoid(self.spec.geoid_grid).undulation(position)
        if any(self.spec.geoid_slope) and len(time):
            assert self._origin is not None
            level += relative_position(position, self._origin)[:, :2] @ np.asarray(self.spec.geoid_slope)
        for a, period, phase in zip(self.spec.tide_amplitude, self.spec.tide_period, self._phase, strict=True):
            level += a * np.cos(2.0 * np.pi * np.asarray(time) / period + phase)
        return level

    def apparent_depth(self, time: Array) -> Array:
        """The (n,) depths that a pressure sensor adds for the change of the air pressure [m]."""
        share = np.clip(np.asarray(time) / self.spec.pressure_time, 0.0, 1.0)
        return np.asarray(self.spec.pressure_change * share / _WEIGHT)
