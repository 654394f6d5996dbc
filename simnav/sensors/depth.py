"""Depth sensor: depth below the mean sea surface.

The mean surface is the WGS-84 ellipsoid, unless the scenario has the part ``water_level`` of the surroundings (geoid,
tide, air pressure). Estimators take it for the ellipsoid. With the part ``water_column`` the sensor measures the
pressure of the water above it and converts it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from simnav import kinds
from simnav.geometry.earth import displace
from simnav.kinds import LARGEST_HEIGHT, Component, Kind
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, SigmaTriple, register_instrument
from simnav.sensors.observation import DEPTH, CompiledInstrument
from simnav.spec import NonNegative, Positive, Vector, quantity, register_unit
from simnav.types import Array, TapStates
from simnav.world.surroundings import Surroundings

__all__ = ["Depth"]

register_unit("kg_m3", 1.0)


@register_instrument(
    Kind(
        "depth below the mean sea surface, positive down",
        "depth",
        (Component("depth", "m", limit=LARGEST_HEIGHT),),
        kinds.DEPTH,
    ),
    example={"rate_hz": 0.5, "sigma_m": 0.2},
)
class Depth(AidSpec):
    """Depth of the sensor itself, positive down.

    With ``waves`` a sensor near the surface reads the pressure of the waves above it: the elevation of each component
    times exp(-k z), with its wave number k and the depth z of the sensor (linear waves in deep water, DNV-RP-C205
    section 3.2; near the bottom the factor is larger).

    With ``surroundings.water_column`` the sensor converts the pressure of that water by ``assumed_density`` and
    standard gravity, or, without it, by the formula of the standard ocean (`simnav.world.water_column`).

    Attributes
    ----------
    waves : bool
        Whether the sensor reads the pressure of the waves above it.
    assumed_density : float or None
        Density by which the sensor converts pressure [kg/m^3]; without it, the standard ocean.
    """

    later: ClassVar[Mapping[str, Any]] = {**AidSpec.later, "waves": False, "assumed_density": None}

    kind: Literal["depth"] = "depth"
    sigma: NonNegative = quantity("m")
    bias: NonNegative = quantity("m", 0.0)
    bias_instability: NonNegative = quantity("m", 0.0)
    scale: NonNegative = quantity("percent", 0.0)
    lever_arm: Vector = quantity("m", ZERO)
    lever_arm_sigma: SigmaTriple = quantity("m", ZERO)
    waves: bool = False
    assumed_density: Positive | None = quantity("kg_m3", None)
    fixed_bias: float = quantity("m", 0.0)
    fixed_scale: float = quantity("percent", 0.0)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Depth(self, name, seed)


class _Depth(CompiledInstrument):
    code = DEPTH

    def __init__(self, spec: Depth, name: str, seed: int):
        super().__init__(spec, name, seed)
        self._waves, self._density = spec.waves, spec.assumed_density

    def enter(self, surroundings: Surroundings) -> None:
        """See `Instrument.enter`. The kernel knows the ellipsoid only."""
        super().enter(surroundings)
        self.in_kernel = not self._waves and not {"water_level", "water_column"} & set(surroundings)

    def reading(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
        """See `Instrument.reading`."""
        value, sigma, there = super().reading(tap)
        if self.in_kernel:
            return value, sigma, there
        place = displace(tap.position, self.lever_displacement(tap))
        level, above = self.surroundings.get("water_level"), np.zeros(len(tap.time))
        if level is not None:
            above += level.height(place, tap.time) + level.apparent_depth(tap.time)
        column = self.surroundings.get("water_column")
        if column is not None:
            depth = np.maximum(above - place[:, 2], 0.0)
            above += column.reported(depth, place[:, 0], self._density) - depth
        waves = self.surroundings.get("sea") if self._waves else None
        if waves is not None:
            above += waves.elevation(place, tap.time, np.maximum(above - place[:, 2], 0.0))
        return value + (1.0 + self.scale) * above[:, None], sigma, there
