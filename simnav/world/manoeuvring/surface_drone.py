"""A surface drone of 2 m: the Otter of Maritime Robotics, a catamaran with two propellers.

Dimensions, masses, added mass, damping, and the bollard pull of the propellers are those of T. I. Fossen, *Handbook of
Marine Craft Hydrodynamics and Motion Control*, 2nd edition, Wiley 2021 (his published model of the Otter, with the
payload of 25 kg): damping from the highest speed of 6 knots and from time constants of one second in sway and yaw, a
quadratic damping of yaw ten times the linear one, and cross-flow drag. Roll and pitch are left out. Assumed: the areas
above the water. The coefficients of the wind are those of a speed boat (Blendermann 1994, table 2).
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.spec import NonNegative, Positive, quantity
from simnav.world.manoeuvring.hull import Hull, Superstructure, coriolis, cross_flow_coefficient
from simnav.world.manoeuvring.vessel import ManoeuvringVessel
from simnav.world.vessel import register_vessel

__all__ = ["SurfaceDrone"]


@cache
def _hull() -> Hull:
    length, pontoon, block, water = 2.0, 0.25, 0.4, 1025.0
    hull, payload = 55.0, 25.0
    mass = hull + payload
    centre = (hull * 0.2 + payload * 0.05) / mass  # of gravity, ahead of the origin [m]
    inertia = hull * ((0.25 * length) ** 2 + centre**2) + payload * 0.05**2  # about the centre
    matrix = np.array(
        [
            [mass + 0.1 * hull, 0.0, 0.0],
            [0.0, mass + 1.5 * hull, mass * centre],
            [0.0, mass * centre, inertia + mass * centre**2 + 1.7 * inertia],
        ]
    )
    top, pull, reach = 6.0 * 0.5144, 24.4 * 9.81, 0.395
    turning = coriolis(matrix)
    draught = mass / water / (2.0 * block * pontoon * length)
    yaw = matrix[2, 2]
    return Hull(
        matrix,
        surge={"u": -pull / top} | turning["surge"],
        sway={"v": -matrix[1, 1]} | turning["sway"],
        yaw={"r": -yaw, "r|r|": -10.0 * yaw} | turning["yaw"],
        length=1.05 * length,  # the 21 strips, each a twentieth of the length, of the published model
        cross_flow=0.5 * water * draught * cross_flow_coefficient(pontoon, draught),
        thrust=pull,
        astern=-float(np.sqrt(13.6 / 24.4)),
        propeller_lag=0.1,
        moment=reach * 0.5 * pull,
        most_steering=1.0,
        steering_lag=0.1,
        superstructure=Superstructure(0.5, 0.8, 2.0, across=0.90, bow=0.55, stern=0.60, cross_force=0.60),
    )


@register_vessel
class SurfaceDrone(ManoeuvringVessel):
    """A surface drone of 2 m, up to 3 m/s."""

    kind: Literal["surface_drone"] = "surface_drone"
    speed_time_constant: Positive = quantity("s", 2.0)
    turn_time_constant: Positive = quantity("s", 1.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=0.6)] = quantity("deg_s", 0.17453292519943295)
    heel: NonNegative = 0.0

    @property
    def hull(self) -> Hull:
        """See `ManoeuvringVessel.hull`."""
        return _hull()
