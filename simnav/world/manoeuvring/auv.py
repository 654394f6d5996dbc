"""An AUV of 1.6 m: Remus 100, a torpedo with a rudder and one propeller.

The model is that of T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd edition, Wiley 2021,
section 8.4.2, in the horizontal plane: a spheroid with Lamb's added mass, drag and propeller of B. Allen, W. S. Vorus
and T. Prestero, *Propulsion system performance enhancements on REMUS AUVs*, OCEANS 2000, cross-flow drag, and damping
at low speed from time constants. As there, the Munk moment is left out. In depth the vehicle moves by the kinematics of
`simnav.world.vessel.KinematicVessel`.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from simnav.spec import NonNegative, Positive, quantity
from simnav.world.manoeuvring.hull import Hull, coriolis, cross_flow_coefficient, spheroid
from simnav.world.manoeuvring.vessel import ManoeuvringVessel
from simnav.world.vessel import register_vessel

__all__ = ["Auv"]


@cache
def _hull() -> Hull:
    length, diameter, water = 1.6, 0.19, 1026.0
    body, added = spheroid(length, diameter, water)
    matrix = np.diag(body + added)
    turning = coriolis(np.diag(body), munk=False)
    drag = 0.5 * water * 0.42 * np.pi * (0.5 * diameter) ** 2
    rudder = 0.5 * water * 2.0 * 0.00665 * 0.5  # area of both fins, and their lift per rad
    # Propeller of 5.5 inches: thrust coefficients at rest and at the advance ratio 0.6632, wake and deduction.
    screw, fastest, rest, moving, ratio, wake, deduction = 0.14, 1525.0 / 60.0, 0.4566, 0.1798, 0.6632, 0.944, 0.1
    scale = (1.0 - deduction) * water * screw**4
    return Hull(
        matrix,
        surge={"u|u|": -drag, "fading u": -matrix[0, 0] / 20.0} | turning["surge"],
        sway={"fading v": -matrix[1, 1] / 20.0} | turning["sway"],
        yaw={"r": -matrix[2, 2]},
        length=1.05 * length,  # the 21 strips, each a twentieth of the length, of the published model
        cross_flow=0.5 * water * diameter * cross_flow_coefficient(diameter, diameter),
        decay=3.0,
        thrust=scale * rest * fastest**2,
        thrust_loss=scale * (moving - rest) / ratio * wake / screw * fastest,
        propeller_lag=1.0,
        moment_of_speed=0.5 * length * rudder,
        lever=-0.5 * length,
        steering_drag=rudder,
        most_steering=float(np.radians(15.0)),
        steering_lag=0.1,
    )


@register_vessel
class Auv(ManoeuvringVessel):
    """An AUV of 1.6 m, up to 2.5 m/s."""

    dives: ClassVar[bool] = True

    kind: Literal["auv"] = "auv"
    speed_time_constant: Positive = quantity("s", 10.0)
    turn_time_constant: Positive = quantity("s", 2.0)
    climb_time_constant: Positive = quantity("s", 3.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=0.6)] = quantity("deg_s", 0.08726646259971647)
    heel: NonNegative = 0.0

    @property
    def hull(self) -> Hull:
        """See `ManoeuvringVessel.hull`."""
        return _hull()
