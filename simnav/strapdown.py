"""Strapdown inertial mechanization in north-east-down, and its exact inverse.

`mechanize` integrates IMU samples (means over their intervals) to position, velocity and attitude. `increments` is the
inverse: from a trajectory it computes the samples of ideal instruments. Both use the same equations, so the integration
of these samples gives the trajectory up to rounding.

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
and rates are computed there. The mean angular rate and specific force of `increments` differ from the true means over
an interval by a term of third order in dt.

References: P. G. Savage, *Strapdown inertial navigation integration algorithm design*, J. Guidance, Control and
Dynamics 21(1) and 21(2), 1998. P. D. Groves 2013, chapter 5.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import TypeAlias

import numpy as np

from simnav.compiled import kernel
from simnav.geometry.earth import ROTATION_RATE, SEMI_MAJOR_AXIS, gravity_scalar, radii_scalar
from simnav.geometry.rotation import (
    cross,
    dcm_from_rpy,
    rotate_left,
    rotate_right,
    rotated,
    rotation_coefficients,
    rpy_from_dcm,
)
from simnav.types import Array, ImuSamples, NavigationStates

#: Divisions by constants are products here: the compiler may not turn one into the other by itself.
TWELFTH = 1.0 / 12.0

__all__ = ["increments", "integrate", "mechanize", "mechanize_step", "sample_from_motion"]


@kernel()
def local_rates(latitude: float, height: float, vm0: float, vm1: float, vm2: float, dt: float) -> tuple[float, ...]:
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
    tuple of 9 floats
        w_ie north and down, w_en north, east, down [rad/s], gravity [m/s^2], d(latitude)/d(north) and
        d(longitude)/d(east) [rad/m], height in the middle [m].
    """
    middle = latitude + 0.5 * dt * vm0 * (1.0 / SEMI_MAJOR_AXIS)
    hm = height - 0.5 * dt * vm2
    s, c = sin(middle), cos(middle)
    meridian, prime_vertical = radii_scalar(s)
    per_north = 1.0 / (meridian + hm)
    per_east = 1.0 / (prime_vertical + hm)
    secant = 1.0 / c
    return (
        ROTATION_RATE * c,
        -ROTATION_RATE * s,
        vm1 * per_east,
        -vm0 * per_north,
        -vm1 * per_east * s * secant,
        gravity_scalar(s, hm),
        per_north,
        per_east * secant,
        hm,
    )


#: Components along three axes.
Triple: TypeAlias = tuple[float, float, float]


@kernel()
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
    q0, q1, q2 = cross(memory[0], memory[1], memory[2], a0, a1, a2)
    r0, r1, r2 = a0 + q0 * TWELFTH, a1 + q1 * TWELFTH, a2 + q2 * TWELFTH
    angle2 = r0 * r0 + r1 * r1 + r2 * r2
    sa, b = rotation_coefficients(angle2)
    c = 1.0 / 6.0 - angle2 * (1.0 / 120.0) if angle2 < 1e-3 else (1.0 - sa) / angle2
    x0, x1, x2 = cross(r0, r1, r2, n0, n1, n2)
    y0, y1, y2 = cross(r0, r1, r2, x0, x1, x2)
    s0, s1, s2 = cross(memory[0], memory[1], memory[2], n0, n1, n2)
    t0, t1, t2 = cross(memory[3], memory[4], memory[5], a0, a1, a2)
    d0 = n0 + b * x0 + c * y0 + (s0 + t0) * TWELFTH
    d1 = n1 + b * x1 + c * y1 + (s1 + t1) * TWELFTH
    d2 = n2 + b * x2 + c * y2 + (s2 + t2) * TWELFTH
    memory[0], memory[1], memory[2], memory[3], memory[4], memory[5] = a0, a1, a2, n0, n1, n2
    u0 = dcm[0, 0] * d0 + dcm[0, 1] * d1 + dcm[0, 2] * d2
    u1 = dcm[1, 0] * d0 + dcm[1, 1] * d1 + dcm[1, 2] * d2
    u2 = dcm[2, 0] * d0 + dcm[2, 1] * d1 + dcm[2, 2] * d2
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    # The mean velocity is implicit; each pass gains six digits, so that the second is exact to rounding.
    m0, m1, m2 = v0 + 0.5 * u0, v1 + 0.5 * u1, v2 + 0.5 * (u2 + 9.8 * dt)
    e0, e2, _, _, _, g, per_north, per_east, _ = local_rates(position[0], position[2], m0, m1, m2, dt)
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


@kernel("void(f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[::1])")
def mechanize(
    position: Array, velocity: Array, dcm: Array, memory: Array, angular_rate: Array, specific_force: Array,
    interval: Array,
) -> None:  # fmt: skip
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


@kernel("void(f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1])")
def _integrate(
    position: Array, velocity: Array, dcm: Array, angular_rate: Array, specific_force: Array, interval: Array,
    positions: Array, velocities: Array, dcms: Array,
) -> None:  # fmt: skip
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


@kernel()
def sample_from_motion(
    latitude: float, height: float, v: tuple[float, float, float], w: tuple[float, float, float], c: tuple[float, ...],
    d: tuple[float, ...], memory: Array, dt: float,
) -> tuple[float, ...]:  # fmt: skip
    """The sample of ideal instruments over one interval: the exact inverse of `mechanize_step`.

    Parameters
    ----------
    latitude, height : float
        Latitude [rad] and height [m] at the start of the interval.
    v, w : tuples of 3 floats
        Velocity at the start and at the end, north-east-down [m/s].
    c, d : tuples of 9 floats
        Direction cosine matrix from body axes to north-east-down at the start and at the end, row by row.
    memory : (6,) array
        Angle and velocity increments of the interval before; updated.
    dt : float
        Length of the interval [s].

    Returns
    -------
    tuple of 11 floats
        Mean angular rate [rad/s] and mean specific force [m/s^2], body axes; changes of latitude and longitude [rad]
        and of height [m]; the Earth rate, north and down, at the middle of the interval [rad/s].
    """
    m0, m1, m2 = 0.5 * (v[0] + w[0]), 0.5 * (v[1] + w[1]), 0.5 * (v[2] + w[2])
    e0, e2, k0, k1, k2, g, per_north, per_east, _ = local_rates(latitude, height, m0, m1, m2, dt)
    z0, z1, z2 = (e0 + k0) * dt, k1 * dt, (e2 + k2) * dt
    # Body rotation: exp(phi x) = C' exp(zeta x) D
    sz, bz = rotation_coefficients(z0 * z0 + z1 * z1 + z2 * z2)
    b00, b10, b20 = rotated(z0, z1, z2, sz, bz, d[0], d[3], d[6])
    b01, b11, b21 = rotated(z0, z1, z2, sz, bz, d[1], d[4], d[7])
    b02, b12, b22 = rotated(z0, z1, z2, sz, bz, d[2], d[5], d[8])
    # Twice the sine of the angle times its axis, from the skew part; and twice the cosine plus one from the trace.
    x0 = (c[2] * b01 + c[5] * b11 + c[8] * b21) - (c[1] * b02 + c[4] * b12 + c[7] * b22)
    x1 = (c[0] * b02 + c[3] * b12 + c[6] * b22) - (c[2] * b00 + c[5] * b10 + c[8] * b20)
    x2 = (c[1] * b00 + c[4] * b10 + c[7] * b20) - (c[0] * b01 + c[3] * b11 + c[6] * b21)
    sine2 = 0.25 * (x0 * x0 + x1 * x1 + x2 * x2)
    # asin(s)/s: a sample turns by far less than a quarter turn
    if sine2 < 1e-3:
        ratio = 1.0 + sine2 * (1.0 / 6.0 + sine2 * (3.0 / 40.0 + sine2 * (15.0 / 336.0 + sine2 * (105.0 / 3456.0))))
    else:
        ratio = np.arcsin(min(1.0, sqrt(sine2))) / sqrt(sine2)
    r0, r1, r2 = 0.5 * ratio * x0, 0.5 * ratio * x1, 0.5 * ratio * x2
    # alpha from phi = (I + [alpha'/12 x]) alpha
    h0, h1, h2 = memory[0] * TWELFTH, memory[1] * TWELFTH, memory[2] * TWELFTH
    inverse = 1.0 / (1.0 + h0 * h0 + h1 * h1 + h2 * h2)
    dot = h0 * r0 + h1 * r1 + h2 * r2
    q0, q1, q2 = cross(h0, h1, h2, r0, r1, r2)
    a0 = (r0 - q0 + h0 * dot) * inverse
    a1 = (r1 - q1 + h1 * dot) * inverse
    a2 = (r2 - q2 + h2 * dot) * inverse
    # Velocity change in the axes at the start: u = C dv, from v+ - v = (I - zeta x / 2) u + gravity and Coriolis
    y0, y1, y2 = cross(2.0 * e0 + k0, k1, 2.0 * e2 + k2, m0, m1, m2)
    p0, p1, p2 = w[0] - v[0] + dt * y0, w[1] - v[1] + dt * y1, w[2] - v[2] + dt * y2 - dt * g
    l0, l1, l2 = -0.5 * z0, -0.5 * z1, -0.5 * z2
    inverse = 1.0 / (1.0 + l0 * l0 + l1 * l1 + l2 * l2)
    dot = l0 * p0 + l1 * p1 + l2 * p2
    q0, q1, q2 = cross(l0, l1, l2, p0, p1, p2)
    u0 = (p0 - q0 + l0 * dot) * inverse
    u1 = (p1 - q1 + l1 * dot) * inverse
    u2 = (p2 - q2 + l2 * dot) * inverse
    t0, t1, t2 = cross(memory[3], memory[4], memory[5], a0, a1, a2)
    d0 = c[0] * u0 + c[3] * u1 + c[6] * u2 - t0 * TWELFTH
    d1 = c[1] * u0 + c[4] * u1 + c[7] * u2 - t1 * TWELFTH
    d2 = c[2] * u0 + c[5] * u1 + c[8] * u2 - t2 * TWELFTH
    # nu from (I + b phi x + c (phi x)^2 + alpha'/12 x) nu = d: diagonally dominant, by Cramer's rule
    angle2 = r0 * r0 + r1 * r1 + r2 * r2
    sa, b = rotation_coefficients(angle2)
    k = 1.0 / 6.0 - angle2 * (1.0 / 120.0) if angle2 < 1e-3 else (1.0 - sa) / angle2
    g0, g1, g2 = b * r0 + h0, b * r1 + h1, b * r2 + h2
    m00, m11, m22 = 1.0 + k * (r0 * r0 - angle2), 1.0 + k * (r1 * r1 - angle2), 1.0 + k * (r2 * r2 - angle2)
    m01, m10 = k * r0 * r1 - g2, k * r0 * r1 + g2
    m02, m20 = k * r0 * r2 + g1, k * r0 * r2 - g1
    m12, m21 = k * r1 * r2 - g0, k * r1 * r2 + g0
    x0, x1, x2 = cross(m01, m11, m21, m02, m12, m22)
    inverse = 1.0 / (m00 * x0 + m10 * x1 + m20 * x2)
    n0 = (d0 * x0 + d1 * x1 + d2 * x2) * inverse
    y0, y1, y2 = cross(m02, m12, m22, m00, m10, m20)
    n1 = (d0 * y0 + d1 * y1 + d2 * y2) * inverse
    t0, t1, t2 = cross(m00, m10, m20, m01, m11, m21)
    n2 = (d0 * t0 + d1 * t1 + d2 * t2) * inverse
    memory[0], memory[1], memory[2], memory[3], memory[4], memory[5] = a0, a1, a2, n0, n1, n2
    inverse = 1.0 / dt
    return (
        a0 * inverse, a1 * inverse, a2 * inverse, n0 * inverse, n1 * inverse, n2 * inverse,
        dt * m0 * per_north, dt * m1 * per_east, -dt * m2, e0, e2,
    )  # fmt: skip


@kernel("void(f8[::1], f8[:, ::1], f8[:, :, ::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def _increments(
    time: Array, velocity: Array, dcm: Array, memory: Array, position: Array, angular_rate: Array, specific_force: Array
) -> None:
    """The samples of ideal instruments between k + 1 states; see `increments`.

    Parameters
    ----------
    time : (k + 1,) array
        Times of the states [s].
    velocity, dcm : (k + 1, 3), (k + 1, 3, 3) arrays
        Velocities north-east-down [m/s], and direction cosine matrices from body axes to north-east-down.
    memory : (6,) array
        Angle and velocity increments of the interval before, for coning and sculling; updated.
    position : (k + 1, 3) array
        Geodetic positions. The first one is given; the others are overwritten by the integral of the mechanization.
    angular_rate, specific_force : (k, 3) arrays
        Overwritten: means over the intervals [rad/s], [m/s^2].
    """
    for k in range(time.size - 1):
        dt = time[k + 1] - time[k]
        a, b = dcm[k], dcm[k + 1]
        out = sample_from_motion(
            position[k, 0],
            position[k, 2],
            (velocity[k, 0], velocity[k, 1], velocity[k, 2]),
            (velocity[k + 1, 0], velocity[k + 1, 1], velocity[k + 1, 2]),
            (a[0, 0], a[0, 1], a[0, 2], a[1, 0], a[1, 1], a[1, 2], a[2, 0], a[2, 1], a[2, 2]),
            (b[0, 0], b[0, 1], b[0, 2], b[1, 0], b[1, 1], b[1, 2], b[2, 0], b[2, 1], b[2, 2]),
            memory,
            dt,
        )
        angular_rate[k, 0], angular_rate[k, 1], angular_rate[k, 2] = out[0], out[1], out[2]
        specific_force[k, 0], specific_force[k, 1], specific_force[k, 2] = out[3], out[4], out[5]
        position[k + 1, 0] = position[k, 0] + out[6]
        position[k + 1, 1] = position[k, 1] + out[7]
        position[k + 1, 2] = position[k, 2] + out[8]


def increments(
    time: Array, position: Array, velocity: Array, attitude: Array, *, memory: Array | None = None
) -> tuple[ImuSamples, Array]:
    """The samples of ideal instruments on a trajectory: the exact inverse of `integrate`.

    Parameters
    ----------
    time : (n + 1,) array
        Times of the states, ascending [s].
    position : (3,) array
        Geodetic position at the first time. The other positions follow from the velocity by the mechanization.
    velocity : (n + 1, 3) array
        Velocities of the states, north-east-down [m/s].
    attitude : (n + 1, 3) array
        Roll, pitch, yaw [rad]. The rotation between two times is less than 90 degrees.
    memory : (6,) array, optional
        Angle and velocity increments of the interval before, for a trajectory in several blocks; updated. Default:
        zeros.

    Returns
    -------
    samples : ImuSamples
        n samples, at ``time[1:]``.
    positions : (n + 1, 3) array
        Latitude, longitude [rad] and height [m] at the times.

    Raises
    ------
    ValueError
        If the times do not ascend.
    """
    time = np.ascontiguousarray(time, dtype=np.float64)
    interval = np.diff(time)
    if not np.all(interval > 0.0):
        raise ValueError(f"times must ascend; they do not at index {int(np.argmin(interval > 0.0)) + 1}")
    n = len(interval)
    positions = np.empty((n + 1, 3))
    positions[0] = position
    rate, force = np.empty((n, 3)), np.empty((n, 3))
    _increments(
        time,
        np.ascontiguousarray(velocity, dtype=np.float64),
        dcm_from_rpy(attitude),
        np.zeros(6) if memory is None else memory,
        positions,
        rate,
        force,
    )
    return ImuSamples(time[1:], interval, rate, force), positions
