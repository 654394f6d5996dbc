"""A survey ship of 161 m: the Mariner class, of which USS Compass Island tested the first inertial navigation at sea.

The hydrodynamic derivatives are those of M. S. Chislett and J. Strøm-Tejsen, *Planar motion mechanism tests and
full-scale steering and manoeuvring predictions for a Mariner class vessel*, report Hy-6, Hydro- and Aerodynamics
Laboratory, Lyngby 1965, as in T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*. They are in
the prime system of the speed U and the length L: a force is ``density / 2 L^2 U^2`` times a polynomial in v/U, r L/U
and the rudder angle. Their change with the speed about 15 knots says that the linear forces go with u v and u r, so the
model is used at all speeds. The resistance is that square of the speed whose slope at 15 knots is the derivative of the
surge force. The rudder's force and moment have the same term of third order, so steering is here the angle that it
leaves, at most that of 35 degrees. Left out: the side force of the propeller, and terms of the rudder that are below a
tenth of the others.

Assumed: the time constant of the propeller, and the areas above the water; USS Compass Island was 171.8 m long
(563.7 feet) and made 20 knots (*Dictionary of American Naval Fighting Ships*). The coefficients of the wind are those
of a research vessel (Blendermann 1994, table 2).
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.spec import NonNegative, Positive, quantity
from simnav.world.manoeuvring.hull import Hull, Superstructure
from simnav.world.manoeuvring.vessel import ManoeuvringVessel
from simnav.world.vessel import register_vessel

__all__ = ["SurveyShip"]


@cache
def _hull() -> Hull:
    length, density = 160.93, 1025.0
    unit = 0.5e-5 * density * length**2  # of 1e-5 in the prime system
    angle = np.radians(35.0)
    # Coefficients in 1e-5: mass 798, its centre -0.023 L, moment of inertia 39.2; and the added mass.
    mass = np.array(
        [
            [798.0 + 42.0, 0.0, 0.0],
            [0.0, 798.0 + 748.0, -0.023 * 798.0 + 9.354],
            [0.0, -0.023 * 798.0 - 4.646, 39.2 + 43.8],
        ]
    )
    lengths = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 2.0], [0.0, 2.0, 3.0]])
    surge = {"u|u|": -0.5 * 184.0, "vv": -899.0, "rr": 18.0, "vr": 798.0}
    sway = {"uv": -1160.0, "ur": -499.0, "vvv/U": -8078.0, "vvr/U": 15356.0}
    yaw = {"uv": -264.0, "ur": -166.0, "vvv/U": 1636.0, "vvr/U": -5483.0}

    def full(terms: dict[str, float], arm: int) -> dict[str, float]:
        return {term: value * unit * length ** (arm + term.count("r")) for term, value in terms.items()}

    return Hull(
        mass * unit * length**lengths,
        surge=full(surge, 0),
        sway=full(sway, 0),
        yaw=full(yaw, 1),
        length=length,
        thrust=0.5 * 184.0 * unit * (20.0 * 0.5144) ** 2,
        astern=-0.7,
        propeller_lag=10.0,
        moment_of_speed=139.0 * unit * length,
        moment_of_drift=(489.0 - 139.0) * unit * length,
        lever=-139.0 / 278.0 * length,
        steering_drag=95.0 * unit,
        most_steering=float(angle - 90.0 / 278.0 * angle**3),
        steering_lag=2.5,
        superstructure=Superstructure(450.0, 2000.0, 171.8, across=0.85, bow=0.55, stern=0.65, cross_force=0.60),
    )


@register_vessel
class SurveyShip(ManoeuvringVessel):
    """A survey ship of 161 m, up to 10 m/s."""

    kind: Literal["survey_ship"] = "survey_ship"
    speed_time_constant: Positive = quantity("s", 60.0)
    turn_time_constant: Positive = quantity("s", 12.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=0.1)] = quantity("deg_s", 0.0069813170079773184)
    heel: NonNegative = 0.5

    @property
    def hull(self) -> Hull:
        """See `ManoeuvringVessel.hull`."""
        return _hull()
