"""A ferry of 5 m for a crossing in a harbour: milliAmpere, the prototype of an autonomous ferry at NTNU.

The mass matrix and the damping were identified from trials: A. A. Pedersen, *Optimization based system identification
for the milliAmpere ferry*, master's thesis, NTNU Trondheim 2019, in the form without coupling of surge. Dimensions and
the two azimuth thrusters, 1.8 m ahead of and behind the origin, are those of E. F. Brekke and others, *milliAmpere: an
autonomous ferry prototype*, J. Physics: Conference Series 2311, 2022. The thrusters are used for the surge force and,
turned abeam against each other, for the yaw moment. Assumed: 500 N a thruster ahead, half of it for the moment, their
time constants, and the areas above the water. The coefficients of the wind are those of a ferry (Blendermann 1994,
table 2).
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.spec import NonNegative, Positive, quantity
from simnav.world.manoeuvring.hull import Hull, Superstructure, coriolis
from simnav.world.manoeuvring.vessel import ManoeuvringVessel
from simnav.world.vessel import register_vessel

__all__ = ["Ferry"]


@cache
def _hull() -> Hull:
    mass = np.array([[2389.657, 0.0, 0.0], [0.0, 2533.911, 62.386], [0.0, 28.141, 5068.910]])
    # The work of these forces vanishes, so the moment follows from the two forces, also where the matrix is not
    # symmetric, as in the thesis.
    turning = coriolis(mass)
    damping = {
        "surge": {"u": -27.632, "u|u|": -110.064, "uuu": -13.965},
        "sway": {
            "v": -52.947, "v|v|": -116.486, "vvv": -24.313, "v|r|": -1540.383,
            "r": 24.732, "r|v|": 572.141, "r|r|": -115.457,
        },
        "yaw": {
            "v": 3.524, "v|v|": -0.832, "v|r|": 336.827,
            "r": -122.860, "r|v|": -121.957, "r|r|": -874.428,
        },
    }  # fmt: skip
    return Hull(
        mass,
        surge=damping["surge"] | turning["surge"],
        sway=damping["sway"] | turning["sway"],
        yaw=damping["yaw"] | turning["yaw"],
        length=5.0,
        thrust=1000.0,
        propeller_lag=0.5,
        moment=2.0 * 1.8 * 250.0,
        most_steering=1.0,
        steering_lag=1.0,
        superstructure=Superstructure(5.6, 10.0, 5.0, across=0.90, bow=0.45, stern=0.50, cross_force=0.80),
    )


@register_vessel
class Ferry(ManoeuvringVessel):
    """A harbour ferry of 5 m, up to 2.5 m/s."""

    kind: Literal["ferry"] = "ferry"
    speed_time_constant: Positive = quantity("s", 6.0)
    turn_time_constant: Positive = quantity("s", 3.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=0.6)] = quantity("deg_s", 0.06981317007977318)
    heel: NonNegative = 0.3

    @property
    def hull(self) -> Hull:
        """See `ManoeuvringVessel.hull`."""
        return _hull()
