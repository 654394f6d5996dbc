"""Depth sensor: depth below the mean sea surface, which is the WGS-84 ellipsoid in simnav."""

from __future__ import annotations

from typing import Literal

from simnav import kinds
from simnav.kinds import LARGEST_HEIGHT, Component, Kind
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, SigmaTriple, register_instrument
from simnav.sensors.observation import DEPTH, CompiledInstrument
from simnav.spec import NonNegative, Vector, quantity

__all__ = ["Depth"]


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
    """Depth of the sensor itself, positive down."""

    kind: Literal["depth"] = "depth"
    sigma: NonNegative = quantity("m")
    bias: NonNegative = quantity("m", 0.0)
    bias_instability: NonNegative = quantity("m", 0.0)
    scale: NonNegative = quantity("percent", 0.0)
    lever_arm: Vector = quantity("m", ZERO)
    lever_arm_sigma: SigmaTriple = quantity("m", ZERO)
    fixed_bias: float = quantity("m", 0.0)
    fixed_scale: float = quantity("percent", 0.0)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Depth(self, name, seed)


class _Depth(CompiledInstrument):
    code = DEPTH
