"""Strapdown inertial mechanization in north-east-down.

`mechanize` integrates IMU samples (means over their intervals) to position, velocity and attitude. The inverse is in
`simnav.inverse_strapdown`: from a trajectory it computes the samples of ideal instruments. Both use the same equations,
so the integration of these samples gives the trajectory up to rounding.

The symbols are: alpha, nu the angle and velocity increments of an interval (mean angular rate and mean specific force
times dt), alpha', nu' those of the interval before; C the direction cosine matrix from body axes to north-east-down; v
the velocity, p the geodetic position; dt the length of the interval; w_ie the Earth rate and w_en the transport rate in
north-east-down; g gravity; T(p) the matrix from velocity to the rate of latitude, longitude and height; x after a
vector its skew-symmetric matrix; + the value at the end of the interval.

- rotation vector of the body, with the two-sample coning correction (Savage 1998, part 1, eqs. 39-40)
  ``phi = alpha + alpha' x alpha / 12``
- velocity change in the axes at the start of the interval, with rotation and sculling (Savage 1998, part 2, eqs. 22-30)
  ``dv = nu + b phi x nu + c phi x (phi x nu) + (alpha' x nu + nu' x alpha) / 12``
  where b = (1 - cos|phi|)/|phi|^2 and c = (1 - sin|phi|/|phi|)/|phi|^2
- ``v+ = v + (I - zeta x / 2) C dv + (g - (2 w_ie + w_en) x vm) dt`` with zeta = (w_ie + w_en) dt (Groves eq. 5.53)
- ``p+ = p + T(pm) vm dt``, trapezoidal in velocity (Groves eq. 5.56)
- ``C+ = exp(-zeta x) C exp(phi x)``

where vm is the mean of the velocities at both ends, pm the position at the middle of the interval, and gravity, radii
and rates are computed there. The mean angular rate and specific force of the inverse differ from the true means over
an interval by a term of third order in dt.

References: P. G. Savage, *Strapdown inertial navigation integration algorithm design*, J. Guidance, Control and
Dynamics 21(1) and 21(2), 1998. P. D. Groves 2013, chapter 5.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple, TypeAlias

import numpy as np

from simnav.compiled import helper, kernel
from simnav.geometry.earth import ROTATION_RATE, SEMI_MAJOR_AXIS, gravity_scalar, radii_scalar
from simnav.geometry.rotation import (
    cross,
    dcm_from_rpy,
    rotate_left,
    rotate_right,
    rotation_coefficients,
    rpy_from_dcm,
)
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.types import Array, ImuSamples, NavigationStates

#: Divisions by constants are products here: the compiler may not turn one into the other by itself.
TWELFTH = 1.0 / 12.0

__all__ = [
    "TWELFTH",
    "LocalRates",
    "MiddleRates",
    "Triple",
    "integrate",
    "local_rates",
    "mechanize",
    "mechanize_step",
    "middle_latitude",
    "per_north_scalar",
    "rates_in_the_middle",
]


@helper
def middle_latitude(latitude: float, vm0: float, dt: float) -> float:
    """Latitude in the middle of an interval [rad], as of `local_rates`."""
    return latitude + 0.5 * dt * vm0 * (1.0 / SEMI_MAJOR_AXIS)


@helper
def per_north_scalar(s: float, hm: float) -> tuple[float, float]:
    """d(latitude)/d(north) [rad/m] and prime-vertical radius [m] at a sine of latitude and a height."""
    meridian, prime_vertical = radii_scalar(s)
    return 1.0 / (meridian + hm), prime_vertical


class MiddleRates(NamedTuple):
    """The rates in the middle of an interval that follow from its latitude, height and velocity.

    Attributes
    ----------
    earth_north, earth_down : float
        Earth rate w_ie [rad/s].
    transport_north, transport_east, transport_down : float
        Transport rate w_en [rad/s].
    gravity : float
        Gravity [m/s^2].
    per_east : float
        d(longitude)/d(east) [rad/m].
    """

    earth_north: float
    earth_down: float
    transport_north: float
    transport_east: float
    transport_down: float
    gravity: float
    per_east: float


class LocalRates(NamedTuple):
    """The rates, gravity and radii in the middle of an interval.

    Attributes
    ----------
    earth_north, earth_down, transport_north, transport_east, transport_down, gravity, per_east : float
        As of `MiddleRates`.
    per_north : float
        d(latitude)/d(north) [rad/m].
    """

    earth_north: float
    earth_down: float
    transport_north: float
    transport_east: float
    transport_down: float
    gravity: float
    per_north: float
    per_east: float


@helper
def rates_in_the_middle(
    s: float, c: float, hm: float, prime_vertical: float, per_north: float, vm0: float, vm1: float
) -> MiddleRates:
    """Of `local_rates` the Earth rate, transport rate, gravity and d(longitude)/d(east).

    The arguments are sine and cosine of the latitude in the middle, height there, what `per_north_scalar` returns, and
    the mean velocity, north and east.
    """
    per_east = 1.0 / (prime_vertical + hm)
    secant = 1.0 / c
    return MiddleRates(
        ROTATION_RATE * c,
        -ROTATION_RATE * s,
        vm1 * per_east,
        -vm0 * per_north,
        -vm1 * per_east * s * secant,
        gravity_scalar(s, hm),
        per_east * secant,
    )


@helper
def local_rates(latitude: float, height: float, vm0: float, vm1: float, vm2: float, dt: float) -> LocalRates:
    """Earth rate, transport rate, gravity and radii at the middle of an interval.

    Parameters
    ----------
    latitude, height : float
        Latitude [rad] and height [m] at the start of the interval.
    vm0, vm1, vm2 : float
        Mean velocity over the interval, north, east, down [m/s].
    dt : float
        Length of the interval [s].

    Returns
    -------
    LocalRates
    """
    middle, hm = middle_latitude(latitude, vm0, dt), height - 0.5 * dt * vm2
    s, c = sin(middle), cos(middle)
    per_north, prime_vertical = per_north_scalar(s, hm)
    rates = rates_in_the_middle(s, c, hm, prime_vertical, per_north, vm0, vm1)
    return LocalRates(
        rates.earth_north,
        rates.earth_down,
        rates.transport_north,
        rates.transport_east,
        rates.transport_down,
        rates.gravity,
        per_north,
        rates.per_east,
    )


#: Components along three axes.
Triple: TypeAlias = tuple[float, float, float]


@helper
def mechanize_step(
    position: Array, velocity: Array, dcm: Array, memory: Array, rate: Triple, force: Triple, dt: float
) -> None:
    """Integrate one interval of the mechanization (equations in the module), in place.

    Parameters
    ----------
    position, velocity : (3,) arrays
        Geodetic [rad, rad, m] and north-east-down [m/s]; updated.
    dcm : (3, 3) array
        Direction cosine matrix from body axes to north-east-down; updated.
    memory : (6,) array
        Angle and velocity increments of the interval before, zeros at the start of a run; updated.
    rate, force : three floats
        Mean angular rate [rad/s], mean specific force [m/s^2].
    dt : float
        Length of the interval [s].
    """
    w0, w1, w2 = rate
    f0, f1, f2 = force
    a0, a1, a2 = w0 * dt, w1 * dt, w2 * dt
    n0, n1, n2 = f0 * dt, f1 * dt, f2 * dt
    angle, change = memory[:3], memory[3:]
    q0, q1, q2 = cross(angle[0], angle[1], angle[2], a0, a1, a2)
    r0, r1, r2 = a0 + q0 * TWELFTH, a1 + q1 * TWELFTH, a2 + q2 * TWELFTH
    angle2 = r0 * r0 + r1 * r1 + r2 * r2
    sa, b = rotation_coefficients(angle2)
    c = 1.0 / 6.0 - angle2 * (1.0 / 120.0) if angle2 < 1e-3 else (1.0 - sa) / angle2
    x0, x1, x2 = cross(r0, r1, r2, n0, n1, n2)
    y0, y1, y2 = cross(r0, r1, r2, x0, x1, x2)
    s0, s1, s2 = cross(angle[0], angle[1], angle[2], n0, n1, n2)
    t0, t1, t2 = cross(change[0], change[1], change[2], a0, a1, a2)
    d0 = n0 + b * x0 + c * y0 + (s0 + t0) * TWELFTH
    d1 = n1 + b * x1 + c * y1 + (s1 + t1) * TWELFTH
    d2 = n2 + b * x2 + c * y2 + (s2 + t2) * TWELFTH
    angle[0], angle[1], angle[2], change[0], change[1], change[2] = a0, a1, a2, n0, n1, n2
    u0 = dcm[0, 0] * d0 + dcm[0, 1] * d1 + dcm[0, 2] * d2
    u1 = dcm[1, 0] * d0 + dcm[1, 1] * d1 + dcm[1, 2] * d2
    u2 = dcm[2, 0] * d0 + dcm[2, 1] * d1 + dcm[2, 2] * d2
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    # The mean velocity is implicit; each pass gains six digits, so that the second is exact to rounding.
    m0, m1, m2 = v0 + 0.5 * u0, v1 + 0.5 * u1, v2 + 0.5 * (u2 + 9.8 * dt)
    local = local_rates(position[0], position[2], m0, m1, m2, dt)
    e0, e2, g = local.earth_north, local.earth_down, local.gravity
    per_north, per_east = local.per_north, local.per_east
    tangent = -e2 / e0
    east_rate = per_east * e0 * (1.0 / ROTATION_RATE)
    z0, z1, z2 = 0.0, 0.0, 0.0
    for _ in range(3):
        k0, k1 = m1 * east_rate, -m0 * per_north
        k2 = -k0 * tangent
        z0, z1, z2 = (e0 + k0) * dt, k1 * dt, (e2 + k2) * dt
        x0, x1, x2 = cross(z0, z1, z2, u0, u1, u2)
        y0, y1, y2 = cross(2.0 * e0 + k0, k1, 2.0 * e2 + k2, m0, m1, m2)
        velocity[0] = v0 + u0 - 0.5 * x0 - dt * y0
        velocity[1] = v1 + u1 - 0.5 * x1 - dt * y1
        velocity[2] = v2 + u2 - 0.5 * x2 - dt * y2 + dt * g
        m0, m1, m2 = 0.5 * (v0 + velocity[0]), 0.5 * (v1 + velocity[1]), 0.5 * (v2 + velocity[2])
    position[0] += dt * m0 * per_north
    position[1] += dt * m1 * per_east
    position[2] -= dt * m2
    rotate_right(dcm, r0, r1, r2, sa, b)
    sz, bz = rotation_coefficients(z0 * z0 + z1 * z1 + z2 * z2)
    rotate_left(dcm, z0, z1, z2, -sz, bz, dcm)  # the other way round: exp(-zeta x)


@kernel
def mechanize(
    position: Vector,
    velocity: Vector,
    dcm: Matrix,
    memory: Vector,
    angular_rate: Matrix,
    specific_force: Matrix,
    interval: Vector,
) -> None:
    """Integrate n IMU samples, in place.

    Parameters
    ----------
    position, velocity : (3,) arrays
        Geodetic [rad, rad, m] and north-east-down [m/s]; updated.
    dcm : (3, 3) array
        Direction cosine matrix from body axes to north-east-down; updated.
    memory : (6,) array
        Angle and velocity increments of the sample before, zeros at the start of a run; updated.
    angular_rate, specific_force : (n, 3) arrays
        Means over the intervals [rad/s], [m/s^2].
    interval : (n,) array
        Length of the interval that each sample covers [s].
    """
    for k in range(interval.size):
        mechanize_step(
            position, velocity, dcm, memory,
            (angular_rate[k, 0], angular_rate[k, 1], angular_rate[k, 2]),
            (specific_force[k, 0], specific_force[k, 1], specific_force[k, 2]),
            interval[k],
        )  # fmt: skip


@kernel
def _integrate(
    position: Vector,
    velocity: Vector,
    dcm: Matrix,
    angular_rate: Matrix,
    specific_force: Matrix,
    interval: Vector,
    positions: Matrix,
    velocities: Matrix,
    dcms: Stack,
) -> None:
    """Integrate k samples and store the state after each of them.

    Parameters
    ----------
    position, velocity, dcm : (3,), (3,), (3, 3) arrays
        State at the start; overwritten by the state at the end.
    angular_rate, specific_force : (k, 3) arrays
        Means over the sample intervals [rad/s], [m/s^2].
    interval : (k,) array
        Lengths of the sample intervals [s].
    positions, velocities, dcms : (k, 3), (k, 3), (k, 3, 3) arrays
        Overwritten by the states at the ends of the intervals.
    """
    memory = np.zeros(6)
    for k in range(interval.size):
        mechanize_step(
            position, velocity, dcm, memory,
            (angular_rate[k, 0], angular_rate[k, 1], angular_rate[k, 2]),
            (specific_force[k, 0], specific_force[k, 1], specific_force[k, 2]),
            interval[k],
        )  # fmt: skip
        positions[k] = position
        velocities[k] = velocity
        dcms[k] = dcm


def integrate(position: Array, velocity: Array, attitude: Array, samples: ImuSamples) -> NavigationStates:
    """Free inertial navigation through n IMU samples.

    Parameters
    ----------
    position, velocity, attitude : (3,) arrays
        The state at the start of the first interval; roll, pitch, yaw.
    samples : ImuSamples
        The n samples, in order of time.

    Returns
    -------
    NavigationStates
        The states at the n sample times.
    """
    n = len(samples)
    positions, velocities, dcms = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3))
    _integrate(
        np.array(position, dtype=np.float64),
        np.array(velocity, dtype=np.float64),
        dcm_from_rpy(attitude),
        np.ascontiguousarray(samples.angular_rate),
        np.ascontiguousarray(samples.specific_force),
        np.ascontiguousarray(samples.interval),
        positions,
        velocities,
        dcms,
    )
    return NavigationStates(samples.time, positions, velocities, rpy_from_dcm(dcms))
