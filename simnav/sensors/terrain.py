"""Terrain-aided navigation: horizontal position fixes from matching the measured bottom with a chart."""

from __future__ import annotations

from typing import Literal

from simnav import kinds
from simnav.kinds import Kind, geodetic_components
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, Pair, SigmaPair, SigmaTriple, register_instrument
from simnav.sensors.observation import HORIZONTAL_POSITION, CompiledInstrument
from simnav.spec import Vector, quantity

__all__ = ["TerrainFix"]


@register_instrument(
    Kind("horizontal position", "fix", geodetic_components(height=False), kinds.HORIZONTAL_POSITION, geodetic=True),
    example={"rate_hz": 0.3, "sigma_m": [5.0, 5.0]},
)
class TerrainFix(AidSpec):
    """Latitude and longitude of the instrument; errors north and east [m].

    ``bias_instability`` is the common error of neighbouring fixes, which match the same part of the chart.
    """

    kind: Literal["terrain_fix"] = "terrain_fix"
    sigma: SigmaPair = quantity("m")
    bias: SigmaPair = quantity("m", (0.0, 0.0))
    bias_instability: SigmaPair = quantity("m", (0.0, 0.0))
    lever_arm: Vector = quantity("m", ZERO)
    lever_arm_sigma: SigmaTriple = quantity("m", ZERO)
    fixed_bias: Pair = quantity("m", (0.0, 0.0))

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _TerrainFix(self, name, seed)


class _TerrainFix(CompiledInstrument):
    code = HORIZONTAL_POSITION
