"""The hull of a vessel that moves in surge, sway and yaw: its coefficients, and what follows from them.

Units are SI and origin and axes those of Fossen 2021: x forward, y to starboard, the moment positive to starboard.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from simnav.structures import filled
from simnav.types import Array
from simnav.world.manoeuvring import dynamics

__all__ = ["Hull", "Superstructure", "coriolis", "cross_flow_coefficient", "spheroid"]

#: Density of air in the formulas of the wind [kg/m^3], at 15 degrees Celsius.
AIR = 1.225
#: Coefficient of the cross-flow drag of a section, against beam / (2 draught): the curve of S. F. Hoerner, *Fluid-
#: Dynamic Drag*, 1965, as digitised in Fossen 2021, figure 6.8; a few of its points.
_HOERNER = np.array(
    [
        [
            0.0109,
            0.1766,
            0.3530,
            0.4519,
            0.4933,
            0.5585,
            0.6464,
            0.8336,
            0.9880,
            1.3081,
            1.6392,
            2.3129,
            3.0088,
            4.0031,
        ],
        [
            1.9661,
            1.9657,
            1.8976,
            1.7872,
            1.2108,
            1.0836,
            0.9986,
            0.8796,
            0.8284,
            0.7599,
            0.6914,
            0.6307,
            0.5868,
            0.5593,
        ],
    ]
)


def cross_flow_coefficient(beam: float, draught: float) -> float:
    """Coefficient of the cross-flow drag of a hull section [-], from Hoerner's curve."""
    return float(np.interp(beam / (2.0 * draught), *_HOERNER))


def coriolis(mass: Array, *, munk: bool = True) -> dict[str, dict[str, float]]:
    """Coriolis and centripetal forces of a mass matrix, as coefficients of a `Hull`.

    Parameters
    ----------
    mass : (3, 3) array
        Mass matrix of surge, sway and yaw [kg, kg m, kg m^2], symmetric or not.
    munk : bool
        Whether the yaw moment is included: it holds the Munk moment (m22 - m11) u v, which turns the hull across the
        flow.

    Notes
    -----
    Fossen 2021, eq. 6.116: the surge force (m22 v + m23 r) r, the sway force -m11 u r, and the moment that makes their
    work vanish.
    """
    m11, m22, m23 = mass[0, 0], mass[1, 1], mass[1, 2]
    forces = {"surge": {"vr": m22, "rr": m23}, "sway": {"ur": -m11}, "yaw": {"uv": m11 - m22, "ur": -m23}}
    return forces if munk else {"surge": forces["surge"], "sway": forces["sway"]}


def spheroid(length: float, diameter: float, density: float) -> tuple[Array, Array]:
    """Mass and added mass of a prolate spheroid that floats in water.

    Parameters
    ----------
    length, diameter : float
        Axes [m].
    density : float
        Of the water and the body [kg/m^3].

    Returns
    -------
    mass, added : (3,) arrays
        In surge and sway [kg], and of the yaw [kg m^2].

    Notes
    -----
    H. Lamb, *Hydrodynamics*, 6th edition, 1932, article 114 and 373; Fossen 2021, section 8.4.2.
    """
    a, b = 0.5 * length, 0.5 * diameter
    body = 4.0 / 3.0 * np.pi * density * a * b * b
    inertia = body * (a * a + b * b) / 5.0
    e2 = 1.0 - (b / a) ** 2
    e = np.sqrt(e2)
    log = np.log((1.0 + e) / (1.0 - e))
    along = 2.0 * (1.0 - e2) / e**3 * (0.5 * log - e)
    across = 1.0 / e2 - (1.0 - e2) / (2.0 * e**3) * log
    turning = e2**2 * (across - along) / ((2.0 - e2) * (2.0 * e2 - (2.0 - e2) * (across - along)))
    added = [body * along / (2.0 - along), body * across / (2.0 - across), turning * inertia]
    return np.array([body, body, inertia]), np.array(added)


@dataclass(frozen=True)
class Superstructure:
    """What the wind acts on, with the coefficients of Blendermann 1994.

    Attributes
    ----------
    frontal, lateral : float
        Projected areas above the water [m^2].
    length : float
        Length over all [m].
    across, bow, stern : float
        Coefficients of the drag for wind from abeam, ahead and astern [-].
    cross_force : float
        Parameter delta of the cross-force [-].
    centre : float
        Distance of the centre of the lateral area ahead of the main section, as a share of the length [-].
    """

    frontal: float
    lateral: float
    length: float
    across: float
    bow: float
    stern: float
    cross_force: float
    centre: float = 0.0

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers of the kernel, by name (`simnav.world.manoeuvring.dynamics.HULL`)."""
        return {
            "frontal": 0.5 * AIR * self.frontal, "lateral": 0.5 * AIR * self.lateral, "length_over_all": self.length,
            "across": self.across, "bow": self.bow, "stern": self.stern, "cross_force": self.cross_force,
            "centre": self.centre,
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Hull:
    """Coefficients of a hull (`simnav.world.manoeuvring.dynamics` has the equations).

    Attributes
    ----------
    mass : (3, 3) tuple of tuples or array
        Mass matrix of surge, sway and yaw, with the added mass [kg, kg m, kg m^2].
    surge, sway, yaw : mapping of str to float
        Force [N] or moment [N m] per unit of each product of velocities (`simnav.world.manoeuvring.dynamics.TERMS`),
        with its sign: ``{"u|u|": -110.0}`` is a resistance.
    length : float
        Length on which the cross-flow drag acts [m].
    cross_flow : float
        Water density / 2 times draught times coefficient of the cross-flow drag [kg/m^2]; 0: it is in the other
        coefficients.
    decay : float
        By which damping at low speed vanishes: exp(-decay U) [s/m].
    thrust, thrust_loss : float
        Thrust at the highest propeller rate at rest [N], and its change with the speed [N s/m].
    astern : float
        Highest propeller rate astern, as a share of that ahead; negative.
    propeller_lag, steering_lag : float
        Time constants of the actuators [s].
    moment, moment_of_speed, moment_of_drift : float
        Yaw moment per unit of steering: a constant one [N m], and those with the squares of the speed and of the sway
        velocity [N s^2/m].
    lever : float
        Place of the steering force ahead of the origin [m]; infinity: it gives a moment and no force.
    steering_drag : float
        Resistance per square of steering and of speed [N s^2/m^2].
    most_steering : float
        Largest steering: an angle [rad], or 1 for a share of the moment.
    superstructure : Superstructure or None
        None: there is no wind force, as under water.
    """

    mass: Array
    surge: Mapping[str, float]
    sway: Mapping[str, float]
    yaw: Mapping[str, float]
    length: float
    thrust: float
    most_steering: float
    cross_flow: float = 0.0
    decay: float = 0.0
    thrust_loss: float = 0.0
    astern: float = -1.0
    propeller_lag: float = 1.0
    steering_lag: float = 1.0
    moment: float = 0.0
    moment_of_speed: float = 0.0
    moment_of_drift: float = 0.0
    lever: float = field(default=np.inf)
    steering_drag: float = 0.0
    superstructure: Superstructure | None = None

    def __post_init__(self) -> None:
        mass = np.asarray(self.mass, dtype=np.float64)
        if mass.shape != (3, 3) or np.any(mass[0, 1:] != 0.0) or np.any(mass[1:, 0] != 0.0):
            raise ValueError("mass is a (3, 3) matrix in which surge is not coupled to sway and yaw")
        if not np.linalg.det(mass) > 0.0:
            raise ValueError(f"mass = {mass.tolist()} should have a positive determinant")
        for name in ("surge", "sway", "yaw"):
            for term in getattr(self, name):
                if term not in dynamics.TERMS:
                    raise ValueError(f"{name}: there is no term {term!r}; terms are {', '.join(dynamics.TERMS)}")
        for name in ("length", "thrust", "most_steering", "propeller_lag", "steering_lag"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} = {getattr(self, name)!r} should be positive")
        if not self.moment + self.moment_of_speed > 0.0:
            raise ValueError("moment or moment_of_speed should be positive: the vessel could not be steered")

    @property
    def vector(self) -> Array:
        """The numbers of the kernels, without wind: a `simnav.world.manoeuvring.dynamics.HULL`."""
        of_terms = np.zeros((3, len(dynamics.TERMS)))
        for row, forces in enumerate((self.surge, self.sway, self.yaw)):
            for term, value in forces.items():
                of_terms[row, dynamics.TERMS.index(term)] += value
        names = set(dynamics.HULL.names or ())
        given = {name: value for name, value in vars(self).items() if name in names}
        above = {} if self.superstructure is None else self.superstructure.numbers
        mass = np.asarray(self.mass, dtype=np.float64)
        return filled(
            dynamics.HULL, inverse_mass=np.linalg.inv(mass).ravel(), forces=of_terms.ravel(),
            reach=0.5 * self.length, sway_per_moment=1.0 / self.lever, **given, **above,
        )  # fmt: skip

    def propeller(self, speed: float) -> float:
        """Propeller rate at a steady speed [m/s] on a straight course in calm weather, as a share of the highest."""
        resistance = sum(
            value * {"u": speed, "u|u|": speed * abs(speed), "uuu": speed**3}.get(term, 0.0)
            + (value * speed * np.exp(-self.decay * abs(speed)) if term == "fading u" else 0.0)
            for term, value in self.surge.items()
        )
        return float(dynamics.propeller_for.function(self.vector.view(dynamics.HULL)[0], -resistance, speed))

    @property
    def top_speed(self) -> float:
        """Speed at the highest propeller rate [m/s]."""
        low, high = 0.0, 50.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.propeller(middle) < 1.0 else (low, middle)
        return low
