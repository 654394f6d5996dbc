"""Terrain-aided navigation: horizontal position fixes from matching the bottom with a chart."""

from __future__ import annotations

from typing import Literal

from simnav.geometry import earth
from simnav.kinds import HORIZONTAL_POSITION, Kind, geodetic_components
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, Pair, SigmaPair, register_instrument
from simnav.spec import Vector, quantity
from simnav.types import Array, TapStates

__all__ = ["TerrainFix"]


@register_instrument(
    Kind("horizontal position", "fix", geodetic_components(height=False), HORIZONTAL_POSITION, geodetic=True),
    example={"rate_hz": 0.3, "sigma_m": [5.0, 5.0]},
)
class TerrainFix(AidSpec):
    """Latitude and longitude of the instrument; errors north and east [m].

    ``bias_instability`` is the error that neighbouring fixes share, since they match the same stretch of chart.
    """

    kind: Literal["terrain_fix"] = "terrain_fix"
    sigma: SigmaPair = quantity("m")
    bias: SigmaPair = quantity("m", (0.0, 0.0))
    bias_instability: SigmaPair = quantity("m", (0.0, 0.0))
    lever_arm: Vector = quantity("m", ZERO)
    fixed_bias: Pair = quantity("m", (0.0, 0.0))

    def build(self, name: str, seed: int, *, water_depth: float | None = None) -> Instrument:
        """See `AidSpec.build`."""
        return _TerrainFix(self, name, seed)


class _TerrainFix(Instrument):
    def observe(self, tap: TapStates) -> Array:
        position = earth.displace(tap.position, self.lever_displacement(tap)) if self.levered else tap.position
        return position[:, :2]
