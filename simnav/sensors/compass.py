"""Magnetic compass and gyrocompass: true heading."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from simnav.kinds import HEADING, Component, Kind
from simnav.sensors.instrument import AidSpec, Instrument, register_instrument
from simnav.sensors.observation import COMPASS, GYROCOMPASS, CompiledInstrument
from simnav.spec import NonNegative, quantity

__all__ = ["Gyrocompass", "MagneticCompass"]

HEADING_COMPONENT = (Component("heading", "deg", cyclic=True),)


@register_instrument(Kind("true heading", "heading", HEADING_COMPONENT, HEADING), example={"sigma_deg": 1.0})
class MagneticCompass(AidSpec):
    """Heading of a magnetic compass, corrected for variation.

    The remaining deviation by hard iron is B sin(heading) + C cos(heading), with the semicircular coefficients B and C
    (Bowditch, *The American Practical Navigator*, 2019, chapter 8). B and C are drawn with the standard deviation
    ``deviation``, and ``fixed_deviation`` = (B, C) is added. The constant coefficient A is the bias.

    Attributes
    ----------
    deviation : float
        Semicircular coefficients B and C of the deviation that remains, one sigma [rad].
    """

    errors: ClassVar[tuple[str, ...]] = (*AidSpec.errors, "deviation")
    unstated: ClassVar[tuple[str, ...]] = ("deviation",)

    kind: Literal["magnetic_compass"] = "magnetic_compass"
    sigma: NonNegative = quantity("deg")
    bias: NonNegative = quantity("deg", 0.0)
    bias_instability: NonNegative = quantity("deg", 0.0)
    deviation: NonNegative = quantity("deg", 0.0)
    fixed_bias: float = quantity("deg", 0.0)
    fixed_deviation: tuple[float, float] = quantity("deg", (0.0, 0.0))

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _MagneticCompass(self, name, seed)


class _MagneticCompass(CompiledInstrument):
    code = COMPASS

    def __init__(self, spec: MagneticCompass, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.deviation = self.drawn("deviation", np.full(2, spec.deviation)) + spec.fixed_deviation
        self.parameters.deviation, self.parameters.has_deviation = self.deviation, self.deviation.any()


@register_instrument(Kind("true heading", "heading", HEADING_COMPONENT, HEADING), example={"sigma_deg": 0.5})
class Gyrocompass(AidSpec):
    """Heading of a gyrocompass.

    With ``speed_error`` the reading is not corrected for the motion of the vessel: the axis of the compass settles
    along the horizontal component of Earth rate plus transport rate, so the heading is too large by atan2(v_N / (R_M +
    h), omega cos(latitude) + v_E / (R_N + h)), with the velocity north v_N and east v_E, the radii of curvature R_M and
    R_N, the height h and the Earth rate omega (Bowditch 2019, chapter 8: the speed, or steaming, error).

    Attributes
    ----------
    speed_error : bool
        Whether the reading has the speed (steaming) error.
    """

    kind: Literal["gyrocompass"] = "gyrocompass"
    sigma: NonNegative = quantity("deg")
    bias: NonNegative = quantity("deg", 0.0)
    bias_instability: NonNegative = quantity("deg", 0.0)
    speed_error: bool = False
    fixed_bias: float = quantity("deg", 0.0)

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Gyrocompass(self, name, seed)


class _Gyrocompass(CompiledInstrument):
    code = GYROCOMPASS

    def __init__(self, spec: Gyrocompass, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.parameters.has_speed_error = spec.speed_error
