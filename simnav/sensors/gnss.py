"""GNSS receiver in the position domain: position and velocity of the antenna."""

from __future__ import annotations

from typing import Literal

from simnav import kinds
from simnav.kinds import Kind, geodetic_components, speed_components
from simnav.sensors.instrument import (
    ZERO,
    AidSpec,
    Instrument,
    SigmaTriple,
    Triple,
    register_instrument,
)
from simnav.sensors.observation import POSITION, VELOCITY, CompiledInstrument
from simnav.spec import Vector, quantity

__all__ = ["GnssPosition", "GnssVelocity"]


@register_instrument(
    Kind("position of the antenna", "fix", geodetic_components(height=True), kinds.POSITION, geodetic=True),
    example={"sigma_m": [1.5, 1.5, 3.0], "lever_arm_m": [1.0, 0.0, -3.0]},
)
class GnssPosition(AidSpec):
    """Position of the antenna; errors by axis, north-east-down [m].

    ``bias_instability`` and ``correlation_time`` describe the slow part of the error of a single receiver: the residual
    errors of orbit, clock and ionosphere, and mild multipath.

    Examples
    --------
    >>> gnss = GnssPosition.from_toml({"sigma_m": [2.1, 2.1, 4.0], "lever_arm_m": [0, 0, -8]})
    >>> gnss.datasheet("gnss").sigma
    array([2.1, 2.1, 4. ])
    """

    kind: Literal["gnss_position"] = "gnss_position"
    sigma: SigmaTriple = quantity("m")
    bias: SigmaTriple = quantity("m", ZERO)
    bias_instability: SigmaTriple = quantity("m", ZERO)
    lever_arm: Vector = quantity("m", ZERO)
    lever_arm_sigma: SigmaTriple = quantity("m", ZERO)
    fixed_bias: Triple = quantity("m", ZERO)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Position(self, name, seed)


class _Position(CompiledInstrument):
    code = POSITION


@register_instrument(
    Kind(
        "velocity of the antenna",
        "velocity",
        speed_components("velocity_north", "velocity_east", "velocity_down"),
        kinds.VELOCITY,
        log_columns=("velocity_north", "velocity_east", "=0"),
    ),
    example={"rate_hz": 2.0, "sigma_m_s": [0.1, 0.1, 0.1]},
)
class GnssVelocity(AidSpec):
    """Velocity of the antenna over the ground, v + C (omega x l); errors by axis, north-east-down [m/s].

    v is the velocity of the vessel north-east-down, C the direction cosine matrix from body axes to north-east-down,
    omega the angular rate of the body relative to the Earth and l the lever arm, both in body axes.
    """

    kind: Literal["gnss_velocity"] = "gnss_velocity"
    sigma: SigmaTriple = quantity("m_s")
    bias: SigmaTriple = quantity("m_s", ZERO)
    bias_instability: SigmaTriple = quantity("m_s", ZERO)
    lever_arm: Vector = quantity("m", ZERO)
    lever_arm_sigma: SigmaTriple = quantity("m", ZERO)
    fixed_bias: Triple = quantity("m_s", ZERO)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Velocity(self, name, seed)


class _Velocity(CompiledInstrument):
    code = VELOCITY
