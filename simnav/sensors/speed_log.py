"""Speed log: forward speed through the water."""

from __future__ import annotations

from typing import Literal

from simnav import kinds
from simnav.kinds import Kind, speed_components
from simnav.sensors.instrument import ZERO, AidSpec, Instrument, register_instrument
from simnav.sensors.observation import WATER_SPEED, CompiledInstrument
from simnav.spec import NonNegative, Vector, quantity

__all__ = ["SpeedLog"]


@register_instrument(
    Kind("forward speed through the water", "velocity", speed_components("speed"), kinds.WATER_SPEED),
    example={"sigma_m_s": 0.1},
)
class SpeedLog(AidSpec):
    """Forward component of the sensor's velocity through the water, (1 + k) (C' (v - c) + omega x l)_forward.

    v is the velocity of the vessel and c that of the water, north-east-down, C the direction cosine matrix from body
    axes to north-east-down, omega the angular rate, l the lever arm and k the scale-factor error.
    """

    kind: Literal["speed_log"] = "speed_log"
    sigma: NonNegative = quantity("m_s")
    bias: NonNegative = quantity("m_s", 0.0)
    bias_instability: NonNegative = quantity("m_s", 0.0)
    scale: NonNegative = quantity("percent", 0.0)
    lever_arm: Vector = quantity("m", ZERO)
    fixed_bias: float = quantity("m_s", 0.0)
    fixed_scale: float = quantity("percent", 0.0)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _SpeedLog(self, name, seed)


class _SpeedLog(CompiledInstrument):
    code = WATER_SPEED
