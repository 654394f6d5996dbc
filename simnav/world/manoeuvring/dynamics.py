"""The equations of motion in surge, sway and yaw, and the autopilot that steers by them: one step of a hull.

With nu = (u, v, r), the velocities through the water along the bow and to starboard and the yaw rate ::

    M nu' = K phi(nu) + cross-flow drag + propeller + rudder + wind

M is the mass matrix with the added mass. K are hydrodynamic coefficients, and phi the products of velocities that
`TERMS` names: damping, Coriolis and centripetal forces; U is the speed. In a current that is the same everywhere
around the hull these are the equations of the velocity through the water (Fossen 2021, section 10.3). The cross-flow
drag is the strip theory of Fossen 2021, eq. 6.91, integrated over the length by a quadrature. The steps are those of
the classical Runge-Kutta method of fourth order, at most 0.1 s long.

The propeller gives ``T = t_nn n |n| + t_nu |n| u`` at the share n of its highest rate, which follows its command by a
first-order lag. Steering is a moment ``N = (n_0 + n_2 (u^2 + v^2) + n_v v^2) s``, with the sway force N / x of an
actuator at the distance x ahead of the origin and a drag; s is the rudder angle or the share of the largest moment,
and follows its command by a lag, too.

The autopilot turns by the model: it computes which s gives the wanted yaw acceleration. The engine has the propeller
rate that gives the wanted speed on a straight course in calm weather, with a slow control of the speed. So turns and
wind slow the vessel down for a while. What the actuators cannot give, the vessel does not do.

References: T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd edition, Wiley 2021. The wind
forces are those of W. Blendermann, *Parameter identification of wind loads on ships*, J. Wind Engineering and
Industrial Aerodynamics 51, 1994.
"""

from __future__ import annotations

from math import atan2, cos, exp, sin, sqrt
from typing import Any, NamedTuple

from simnav.compiled import helper, kernel
from simnav.kernel_types import Matrix, Vector
from simnav.structures import structure

__all__ = ["GUSTS", "HULL", "SAIL", "TERMS", "HullMotion", "Sailed", "integrate_hull", "propeller_for", "sail", "trial"]

#: Products of velocities that K multiplies. ``fading`` ones are multiplied by exp(-decay U).
TERMS = (
    "u", "u|u|", "uuu", "v", "v|v|", "vvv", "r", "r|r|", "rrr", "v|r|", "r|v|", "uv", "ur", "vr", "rr",
    "fading u", "fading v", "vv", "vvv/U", "vvr/U",
)  # fmt: skip
_N = len(TERMS)
#: Most harmonics of a gusty wind.
GUSTS = 16

#: A hull: inverse of M by rows, K by rows; half the length on which the cross-flow drag acts, its coefficient, and the
#: decay of the fading terms; t_nn, t_nu, highest rate astern and lag of the propeller; n_0, n_2, n_v, 1 / x, drag, most
#: and lag of the steering. Of the wind: air density / 2 times the frontal and the lateral area, length over all, the
#: coefficients of Blendermann; the mean wind, north and east [m/s]; and for each gust the angular frequency, the phase
#: and the amplitude as a share of the mean.
HULL = structure(
    inverse_mass=9, forces=3 * _N, reach=float, cross_flow=float, decay=float,
    thrust=float, thrust_loss=float, astern=float, propeller_lag=float,
    moment=float, moment_of_speed=float, moment_of_drift=float, sway_per_moment=float, steering_drag=float,
    most_steering=float, steering_lag=float,
    frontal=float, lateral=float, length_over_all=float, across=float, bow=float, stern=float, cross_force=float,
    centre=float, wind=2, gusts=3 * GUSTS,
)  # fmt: skip
#: The state of a hull, a part of the state of `simnav.world.motion`: sway velocity [m/s], propeller, steering; wanted
#: yaw rate [rad/s] and speed [m/s] with their changes; and the integral of the control of the speed [m/s^2].
SAIL = structure(
    sway=float, propeller=float, steering=float, yaw_rate=float, yaw_rate_change=float, speed=float, speed_change=float,
    engine=float,
)  # fmt: skip
#: Nodes and weights of the quadrature of Gauss and Legendre with six nodes, on [-1, 1].
_NODE = (0.932469514203152, 0.6612093864662645, 0.2386191860831969)
_WEIGHT = (0.17132449237917036, 0.3607615730481386, 0.46791393457269104)
_LONGEST = 0.1

Three = tuple[float, float, float]


class HullMotion(NamedTuple):
    """The state of a hull, or its rates of change.

    Attributes
    ----------
    surge, sway : float
        Velocity through the water [m/s].
    yaw_rate : float
        [rad/s].
    heading : float
        [rad].
    propeller, steering : float
        Shares of what the actuators can give.
    """

    surge: float
    sway: float
    yaw_rate: float
    heading: float
    propeller: float
    steering: float


class Sailed(NamedTuple):
    """What a step of the autopilot leads to.

    Attributes
    ----------
    surge, surge_change : float
        Velocity through the water [m/s], and its change [m/s^2].
    yaw_rate, yaw_rate_change : float
        [rad/s], and its change [rad/s^2].
    heading : float
        [rad].
    """

    surge: float
    surge_change: float
    yaw_rate: float
    yaw_rate_change: float
    heading: float


@helper(borrows=True)
def _wind_force(h: Any, time: float, psi: float, north: float, east: float) -> Three:
    """Surge and sway force [N] and yaw moment [N m] of the wind on a hull that moves north and east over ground."""
    gust, gusts = 1.0, h.gusts
    for i in range(GUSTS):
        gust += gusts[3 * i + 2] * cos(gusts[3 * i] * time + gusts[3 * i + 1])
    a, b = h.wind[0] * gust - north, h.wind[1] * gust - east
    c, s = cos(psi), sin(psi)
    ahead, aside = c * a + s * b, c * b - s * a
    square = ahead * ahead + aside * aside
    if square < 1e-12:
        return 0.0, 0.0, 0.0
    # The direction from which the air comes, from the bow to starboard. The coefficients are even or odd in it.
    angle = atan2(-aside, -ahead)
    side = 1.0 if angle >= 0.0 else -1.0
    angle = abs(angle)
    along = h.bow if ahead <= 0.0 else h.stern
    ratio = along * h.frontal / (h.lateral * h.across)
    below = 1.0 - 0.5 * h.cross_force * (1.0 - ratio) * sin(2.0 * angle) ** 2
    x = -along * cos(angle) / below * square * h.frontal
    y = h.across * sin(angle) / below * square * h.lateral
    # A wind from starboard pushes to port. Its moment has the lever of the centre of the lateral area, which moves
    # towards the bow for a wind from ahead.
    lever = h.centre - 0.18 * (angle - 1.5707963267948966)
    return x, -side * y, -side * y * lever * h.length_over_all


@helper(borrows=True)
def _hull_force(h: Any, u: float, v: float, r: float) -> Three:
    """Hydrodynamic surge and sway force [N] and yaw moment [N m]."""
    speed = sqrt(u * u + v * v)
    fading, lean = exp(-h.decay * speed), v * v / (speed + 1e-9)
    phi = (
        u, u * abs(u), u * u * u, v, v * abs(v), v * v * v, r, r * abs(r), r * r * r, v * abs(r), r * abs(v), u * v,
        u * r, v * r, r * r, fading * u, fading * v, v * v, lean * v, lean * r,
    )  # fmt: skip
    x = y = n = 0.0
    forces = h.forces
    for i in range(_N):
        x += forces[i] * phi[i]
        y += forces[_N + i] * phi[i]
        n += forces[2 * _N + i] * phi[i]
    if h.cross_flow > 0.0:
        reach = h.reach
        for i in range(3):
            place = reach * _NODE[i]
            fore, aft = v + place * r, v - place * r
            fore, aft = fore * abs(fore), aft * abs(aft)
            y -= h.cross_flow * reach * _WEIGHT[i] * (fore + aft)
            n -= h.cross_flow * reach * _WEIGHT[i] * place * (fore - aft)
    return x, y, n


@helper(borrows=True)
def _thrust(h: Any, n: float, u: float) -> float:
    """Thrust of the propeller [N]."""
    thrust: float = h.thrust * n * abs(n) + h.thrust_loss * abs(n) * u
    return thrust


@helper(borrows=True)
def _change(h: Any, water: tuple[float, float], time: float, command: tuple[float, float], s: HullMotion) -> HullMotion:
    """Rates of change of u, v, r, heading, propeller and steering."""
    u, v, r = s.surge, s.sway, s.yaw_rate
    psi, n, steer = s.heading, s.propeller, s.steering
    c, d = cos(psi), sin(psi)
    x, y, z = _hull_force(h, u, v, r)
    if h.lateral > 0.0 and (h.wind[0] != 0.0 or h.wind[1] != 0.0):
        wx, wy, wz = _wind_force(h, time, psi, water[0] + c * u - d * v, water[1] + d * u + c * v)
        x, y, z = x + wx, y + wy, z + wz
    square = u * u + v * v
    moment = (h.moment + h.moment_of_speed * square + h.moment_of_drift * v * v) * steer
    x += _thrust(h, n, u) - h.steering_drag * square * steer * steer
    y += moment * h.sway_per_moment
    z += moment
    inverse = h.inverse_mass
    return HullMotion(
        inverse[0] * x + inverse[1] * y + inverse[2] * z,
        inverse[3] * x + inverse[4] * y + inverse[5] * z,
        inverse[6] * x + inverse[7] * y + inverse[8] * z,
        r,
        (command[0] - n) / h.propeller_lag,
        (command[1] - steer) / h.steering_lag,
    )


@helper(borrows=True)
def _ahead(s: HullMotion, change: HullMotion, dt: float) -> HullMotion:
    return HullMotion(
        s.surge + dt * change.surge,
        s.sway + dt * change.sway,
        s.yaw_rate + dt * change.yaw_rate,
        s.heading + dt * change.heading,
        s.propeller + dt * change.propeller,
        s.steering + dt * change.steering,
    )


@helper(borrows=True)
def propeller_for(h: Any, thrust: float, u: float) -> float:
    """Propeller rate that gives a thrust [N] at a speed [m/s], within its limits.

    It is a root of t_nn n |n| + t_nu |n| u = T: the larger one ahead, where there is one, and else the one astern.
    """
    half, share = 0.5 * h.thrust_loss * u / h.thrust, thrust / h.thrust
    if half * half + share >= 0.0:
        n = sqrt(half * half + share) - half
    else:
        n = -half - sqrt(half * half - share)
    rate: float = min(max(n, h.astern), 1.0)
    return rate


@helper(borrows=True)
def integrate_hull(
    h: Any, s: HullMotion, command: tuple[float, float], water: tuple[float, float], time: float, dt: float
) -> HullMotion:
    """Integrate the equations over dt seconds under constant commands.

    Parameters
    ----------
    h : record
        A `HULL` (`simnav.world.manoeuvring.hull.Hull.vector`).
    s : HullMotion
        The state at the start.
    command : (float, float)
        Commanded propeller and steering.
    water : (float, float)
        Velocity of the water, north and east [m/s]; the wind is relative to the ground.
    time, dt : float
        Time at the start, for the gusts, and the length of the step [s].
    """
    parts = 1 if dt <= _LONGEST else int(dt / _LONGEST + 0.999999)
    step = dt / parts
    for k in range(parts):
        now, total, at, share = s, s, time + k * step, 0.0
        for stage in range(4):
            change = _change(h, water, at + share * step, command, now)
            weight = step / 6.0 if stage == 0 or stage == 3 else step / 3.0
            share = 1.0 if stage == 2 else 0.5
            now, total = _ahead(s, change, share * step), _ahead(total, change, weight)
        s = total
    return s


@helper(borrows=True)
def sail(
    h: Any,
    x: Any,
    state: tuple[float, float, float],
    constants: tuple[float, float],
    water: tuple[float, float],
    time: float,
    dt: float,
) -> Sailed:
    """Advance a hull by one step of its autopilot.

    Parameters
    ----------
    h : record
        A `HULL` (`simnav.world.manoeuvring.hull.Hull.vector`).
    x : record
        A `SAIL`; all but the wanted yaw rate and speed are updated.
    state : tuple of 3 floats
        Surge velocity through the water [m/s], yaw rate [rad/s], heading [rad].
    constants : (float, float)
        Time constants of speed and yaw rate [s].
    water : (float, float)
        Velocity of the water, north and east [m/s].
    time, dt : float
        Time at the start of the step, and its length [s].

    Returns
    -------
    Sailed
    """
    u, r, psi = state
    slow, quick = constants
    v, inverse = x.sway, h.inverse_mass
    # Engine: proportional and integral control about the thrust of the wanted speed. The integral waits while the
    # engine is at its limit.
    off = x.speed - u
    straight = _hull_force(h, x.speed, 0.0, 0.0)
    n = propeller_for(h, (x.speed_change + off / slow + x.engine) / inverse[0] - straight[0], u)
    if (n < 1.0 or off < 0.0) and (n > h.astern or off > 0.0):
        x.engine += 0.25 * dt * off / (slow * slow)
    # Steering: what the yaw rate would do without it, and what is wanted.
    idle = _change(h, water, time, (0.0, 0.0), HullMotion(u, v, r, psi, x.propeller, 0.0))
    moment = h.moment + h.moment_of_speed * (u * u + v * v) + h.moment_of_drift * v * v
    turning = (inverse[7] * h.sway_per_moment + inverse[8]) * moment
    steer = (x.yaw_rate_change + (x.yaw_rate - r) / quick - idle.yaw_rate) / max(turning, 1e-9 * inverse[8])
    command = (n, min(max(steer, -h.most_steering), h.most_steering))
    s = integrate_hull(h, HullMotion(u, v, r, psi, x.propeller, x.steering), command, water, time, dt)
    x.sway, x.propeller, x.steering = s.sway, s.propeller, s.steering
    return Sailed(s.surge, (s.surge - u) / dt, s.yaw_rate, (s.yaw_rate - r) / dt, s.heading)


@kernel
def trial(hull: Vector, states: Matrix, commands: Matrix, dt: float, water: Vector) -> None:
    """Integrate a hull under given commands, without an autopilot.

    Parameters
    ----------
    hull : (n,) array
        A `HULL`.
    states : (n + 1, 6) array
        Surge and sway velocity [m/s], yaw rate [rad/s], heading [rad], propeller, steering at n + 1 times. The first
        row is given; the others are overwritten.
    commands : (n, 2) array
        Propeller and steering in each interval.
    dt : float
        Length of an interval [s].
    water : (2,) array
        Velocity of the water, north and east [m/s].
    """
    h = hull.view(HULL)[0]
    for k in range(commands.shape[0]):
        s = HullMotion(states[k, 0], states[k, 1], states[k, 2], states[k, 3], states[k, 4], states[k, 5])
        s = integrate_hull(h, s, (commands[k, 0], commands[k, 1]), (water[0], water[1]), k * dt, dt)
        for i in range(6):
            states[k + 1, i] = s[i]
