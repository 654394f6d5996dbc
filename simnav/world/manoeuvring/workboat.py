"""A workboat of 8 m: Viknes 830.

The model is that of Ø. A. G. Loe, *Collision avoidance for unmanned surface vehicles*, master's thesis, NTNU Trondheim
2008: mass and moment of inertia, damping of first to third order, and the limits of thrust and rudder force, which
acts 4 m behind the origin. The same figures are used for the Telemetron boat of later work, such as I. B. Hagen and
others, *MPC-based collision avoidance strategy for existing marine vessel guidance systems*, ICRA 2018. Added mass is
not distinguished there. Assumed: the time constants of engine and rudder, and the areas above the water, of a boat
3.5 m high whose cabin takes half of the length. The coefficients of the wind are those of a speed boat (Blendermann
1994, table 2).
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

__all__ = ["Workboat"]


@cache
def _hull() -> Hull:
    mass = np.diag([3980.0, 3980.0, 19703.0])
    damping = {
        "surge": {"u": -50.0, "u|u|": -135.0},
        "sway": {"v": -200.0, "v|v|": -2000.0},
        "yaw": {"r": -1281.0, "rrr": -3224.0},
    }
    turning = coriolis(mass)
    return Hull(
        mass,
        surge=damping["surge"] | turning["surge"],
        sway=damping["sway"] | turning["sway"],
        yaw=damping["yaw"] | turning["yaw"],
        length=8.45,
        thrust=13100.0,
        astern=-float(np.sqrt(0.5)),  # half the thrust
        propeller_lag=1.0,
        moment=4.0 * 645.0,
        lever=-4.0,
        most_steering=1.0,
        steering_lag=0.5,
        superstructure=Superstructure(9.5, 13.3, 8.45, across=0.90, bow=0.55, stern=0.60, cross_force=0.60),
    )


@register_vessel
class Workboat(ManoeuvringVessel):
    """A workboat of 8 m, up to 9.6 m/s."""

    kind: Literal["workboat"] = "workboat"
    speed_time_constant: Positive = quantity("s", 5.0)
    turn_time_constant: Positive = quantity("s", 2.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=0.6)] = quantity("deg_s", 0.10471975511965977)
    heel: NonNegative = 0.0

    @property
    def hull(self) -> Hull:
        """See `ManoeuvringVessel.hull`."""
        return _hull()
