"""Depth sensor: depth below the mean sea surface, which is the WGS-84 ellipsoid here."""

from __future__ import annotations

from typing import Literal

from simnav.kinds import DEPTH, LARGEST_HEIGHT, Component, Kind
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, register_instrument
from simnav.spec import NonNegative, Vector, quantity
from simnav.types import Array, TapStates

__all__ = ["Depth"]


@register_instrument(
    Kind(
        "depth below the mean sea surface, positive down",
        "depth",
        (Component("depth", "m", limit=LARGEST_HEIGHT),),
        DEPTH,
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
    fixed_bias: float = quantity("m", 0.0)
    fixed_scale: float = quantity("percent", 0.0)

    def build(self, name: str, seed: int, *, water_depth: float | None = None) -> Instrument:
        """See `AidSpec.build`."""
        return _Depth(self, name, seed)


class _Depth(Instrument):
    def observe(self, tap: TapStates) -> Array:
        depth = -tap.position[:, 2:]
        if self.levered:
            depth = depth + self.lever_displacement(tap)[:, 2:]
        return (1.0 + self.scale) * depth
