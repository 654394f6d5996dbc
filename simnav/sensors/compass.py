"""Magnetic compass and gyrocompass: true heading."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from simnav.geometry.earth import ROTATION_RATE, principal_radii
from simnav.kinds import HEADING, Component, Kind
from simnav.sensors.instrument import AidSpec, Instrument, register_instrument
from simnav.spec import NonNegative, quantity
from simnav.types import Array, TapStates

__all__ = ["Gyrocompass", "MagneticCompass"]

HEADING_COMPONENT = (Component("heading", "deg", cyclic=True),)


@register_instrument(Kind("true heading", "heading", HEADING_COMPONENT, HEADING), example={"sigma_deg": 1.0})
class MagneticCompass(AidSpec):
    """Heading of a magnetic compass, corrected for variation.

    What hard and soft iron leave is a deviation of one cycle, B sin(heading) + C cos(heading) (Bowditch, *The American
    Practical Navigator*, 2019, chapter 8: the semicircular coefficients); B and C are drawn with ``deviation``, on top
    of ``fixed_deviation`` = (B, C). The constant coefficient A is the bias.
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "deviation")
    untold: ClassVar[tuple[str, ...]] = ("deviation",)

    kind: Literal["magnetic_compass"] = "magnetic_compass"
    sigma: NonNegative = quantity("deg")
    bias: NonNegative = quantity("deg", 0.0)
    bias_instability: NonNegative = quantity("deg", 0.0)
    deviation: NonNegative = quantity("deg", 0.0)
    fixed_bias: float = quantity("deg", 0.0)
    fixed_deviation: tuple[float, float] = quantity("deg", (0.0, 0.0))

    def build(self, name: str, seed: int, *, water_depth: float | None = None) -> Instrument:
        """See `AidSpec.build`."""
        return _MagneticCompass(self, name, seed)


class _MagneticCompass(Instrument):
    def __init__(self, spec: MagneticCompass, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.deviation = self.drawn("deviation", np.full(2, spec.deviation)) + spec.fixed_deviation
        self._deviates = bool(self.deviation.any())

    def observe(self, tap: TapStates) -> Array:
        heading = tap.attitude[:, 2:]
        if not self._deviates:
            return heading
        b, c = self.deviation
        value: Array = heading + b * np.sin(heading) + c * np.cos(heading)
        return value


@register_instrument(Kind("true heading", "heading", HEADING_COMPONENT, HEADING), example={"sigma_deg": 0.5})
class Gyrocompass(AidSpec):
    """Heading of a gyrocompass.

    With ``speed_error`` it is not corrected for the vessel's own motion: it settles where its axis lies along the
    horizontal part of Earth and transport rate, and reads too much by atan2(v_N / (R_M + h), omega cos(latitude) +
    v_E / (R_N + h)) (Bowditch 2019, chapter 8: the speed, or steaming, error).
    """

    kind: Literal["gyrocompass"] = "gyrocompass"
    sigma: NonNegative = quantity("deg")
    bias: NonNegative = quantity("deg", 0.0)
    bias_instability: NonNegative = quantity("deg", 0.0)
    speed_error: bool = False
    fixed_bias: float = quantity("deg", 0.0)

    def build(self, name: str, seed: int, *, water_depth: float | None = None) -> Instrument:
        """See `AidSpec.build`."""
        return _Gyrocompass(self, name, seed)


class _Gyrocompass(Instrument):
    def __init__(self, spec: Gyrocompass, name: str, seed: int):
        super().__init__(spec, name, seed)
        self._speed_error = spec.speed_error

    def observe(self, tap: TapStates) -> Array:
        heading = tap.attitude[:, 2]
        if self._speed_error:
            latitude, height = tap.position[:, 0], tap.position[:, 2]
            meridian, prime_vertical = principal_radii(latitude)
            north = ROTATION_RATE * np.cos(latitude) + tap.velocity[:, 1] / (prime_vertical + height)
            heading = heading + np.arctan2(tap.velocity[:, 0] / (meridian + height), north)
        return heading[:, None]
