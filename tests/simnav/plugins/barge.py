"""A barge with its own engine: linear damping, and Coriolis forces from the mass matrix."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.world import Hull, ManoeuvringVessel, register_vessel
from simnav.world.manoeuvring.hull import coriolis


@register_vessel
class Barge(ManoeuvringVessel):
    """A barge of 20 m."""

    kind: Literal["barge"] = "barge"

    @property
    def hull(self) -> Hull:
        """Coefficients in SI units."""
        mass = np.diag([1.1e5, 1.8e5, 4.0e6])
        turning = coriolis(mass)
        return Hull(
            mass,
            surge={"u|u|": -900.0} | turning["surge"],
            sway={"v": -9e3, "v|v|": -3e4} | turning["sway"],
            yaw={"r": -1.5e6, "r|r|": -2e7} | turning["yaw"],
            length=20.0,
            thrust=8e3,
            moment=9e4,
            most_steering=1.0,
        )
