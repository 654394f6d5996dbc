"""Doppler velocity log: velocity over the ground in body axes, while it has bottom lock."""

from __future__ import annotations

from math import inf
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from simnav import kinds
from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector
from simnav.kinds import Kind, speed_components
from simnav.sensors.instrument import (
    ZERO,
    AidSpec,
    Instrument,
    SigmaTriple,
    Triple,
    register_instrument,
)
from simnav.sensors.observation import (
    BODY_VELOCITY,
    CompiledInstrument,
)
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.types import Array, TapStates
from simnav.world.surroundings import FlatBottom, Surroundings

__all__ = ["Dvl"]


@register_instrument(
    Kind(
        "velocity over the ground of the transducer, in body axes",
        "velocity",
        speed_components("forward", "starboard", "down"),
        kinds.BODY_VELOCITY,
        log_columns=("ground_forward", "ground_starboard", "=0"),
    ),
    example={"phase_s": 0.3, "sigma_m_s": 0.02},
)
class Dvl(AidSpec):
    """Velocity of the transducer over the ground, along axes that are the body axes up to the misalignment::

        u = C' v + omega x l
        value = (1 + k) R(eta)' u

    v is the velocity of the vessel north-east-down, C the direction cosine matrix from body axes to north-east-down,
    omega the angular rate of the body relative to the Earth, l the lever arm and k the scale-factor error. The
    instrument's axes are turned from the body axes by the rotation vector eta, with the rotation matrix R(eta); to
    first order R(eta)' u = u - eta x u. The white noise of a ping has the variance sigma^2 + (speed_noise |u|)^2; the
    datasheet gives sigma. The DVL has bottom lock while the altitude of the transducer is between ``minimum_altitude``
    and ``maximum_altitude``; without a bottom (`simnav.world.surroundings`) it always has.

    Attributes
    ----------
    speed_noise : float
        Part of the white noise that grows with speed, one sigma [-].
    minimum_altitude, maximum_altitude : float
        Altitudes of the transducer between which it has bottom lock [m].
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "speed_noise")

    kind: Literal["dvl"] = "dvl"
    sigma: SigmaTriple = quantity("m_s")
    speed_noise: NonNegative = quantity("percent", 0.0)
    bias: SigmaTriple = quantity("m_s", ZERO)
    bias_instability: SigmaTriple = quantity("m_s", ZERO)
    scale: NonNegative = quantity("percent", 0.0)
    misalignment: SigmaTriple = quantity("deg", ZERO)
    lever_arm: Vector = quantity("m", ZERO)
    lever_arm_sigma: SigmaTriple = quantity("m", ZERO)
    minimum_altitude: NonNegative = quantity("m", 0.0)
    maximum_altitude: Positive = quantity("m", inf)
    fixed_bias: Triple = quantity("m_s", ZERO)
    fixed_scale: float = quantity("percent", 0.0)
    fixed_misalignment: Vector = quantity("deg", ZERO)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Dvl(self, name, seed)


class _Dvl(CompiledInstrument):
    code = BODY_VELOCITY

    def __init__(self, spec: Dvl, name: str, seed: int):
        super().__init__(spec, name, seed)
        turn = self.drawn("misalignment", np.asarray(spec.misalignment)) + spec.fixed_misalignment
        self.misalignment = turn
        self.parameters.axes = (1.0 + self.scale) * dcm_from_rotation_vector(turn).T
        self.parameters.speed_variance = spec.speed_noise**2
        self.parameters.lowest, self.parameters.highest = spec.minimum_altitude, spec.maximum_altitude

    def enter(self, surroundings: Surroundings) -> None:
        """See `Instrument.enter`. The kernel knows a flat bottom; any other bottom is asked here."""
        super().enter(surroundings)
        bottom = surroundings.get("bottom")
        self.in_kernel = bottom is None or isinstance(bottom, FlatBottom)
        if isinstance(bottom, FlatBottom):
            self.parameters.water_depth = bottom.water_depth

    def reading(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
        """See `Instrument.reading`."""
        value, sigma, there = super().reading(tap)
        if not self.in_kernel:
            place = displace(tap.position, self.lever_displacement(tap))
            altitude = place[:, 2] + self.surroundings["bottom"].depth(place, tap.time)
            lowest, highest = self.parameters.lowest.item(), self.parameters.highest.item()
            there = (lowest <= altitude) & (altitude <= highest)
        return value, sigma, there
