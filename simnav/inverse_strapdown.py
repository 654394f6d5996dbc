"""The exact inverse of the strapdown mechanization: from a trajectory to the samples of ideal instruments.

The equations and their symbols are those of `simnav.strapdown`. There are two forms with the same numbers, bit for bit:
`sample_from_motion` computes one sample, and `ideal_samples` a block of up to `BLOCK` samples. Both consist of the same
parts, which are short kernels. Only three things depend on the sample before: the latitude, and the angle and velocity
increments, by the corrections for coning and sculling. All else is computed for each sample by itself. So the block
form has the parts in loops of their own, over the rows of a record, and the compiler uses vector instructions. Each
sample keeps the order of its operations. The loops over increments depend on the sample before, and are short.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.geometry.earth import ECCENTRICITY_SQUARED, radii_scalar
from simnav.geometry.rotation import (
    cross,
    dcm_from_rpy,
    rotated,
    rotation_coefficients,
    small_rotation_coefficients,
)
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.strapdown import TWELFTH, Triple, local_rates, middle_latitude, per_north_scalar, rates_in_the_middle
from simnav.structures import filled, structure
from simnav.types import Array, ImuSamples

__all__ = [
    "BLOCK",
    "SAMPLES",
    "IdealSample",
    "SmallMatrix",
    "ideal_samples",
    "increments",
    "matrix_at",
    "put_matrix",
    "put_three",
    "sample_from_motion",
    "samples_structure",
    "small_matrix",
    "three_at",
]


class SmallMatrix(NamedTuple):
    """A (3, 3) matrix by its elements, which the compiler keeps in registers; ``c01`` is in row 0 and column 1."""

    c00: float
    c01: float
    c02: float
    c10: float
    c11: float
    c12: float
    c20: float
    c21: float
    c22: float


@helper(borrows=True)
def small_matrix(c: Array) -> SmallMatrix:
    """The elements of a (3, 3) array."""
    return SmallMatrix(c[0, 0], c[0, 1], c[0, 2], c[1, 0], c[1, 1], c[1, 2], c[2, 0], c[2, 1], c[2, 2])


#: Most samples of a block. Its record is small enough for the fastest memory of a processor.
BLOCK = 64
#: Length of a row: it has one value for each sample, or for each end of a sample interval.
_ROW = BLOCK + 8


def samples_structure(**rows: int) -> np.dtype[Any]:
    """The structure of a block of samples.

    It holds, at each end of an interval: velocity, direction cosine matrix and position; the length of the interval.
    In the middle of the interval: sine and cosine of the latitude, height, radius in the prime vertical,
    d(latitude)/d(north) and d(longitude)/d(east), Earth rate, transport rate and gravity; the distance to the north.
    Of a rotation x: the square of its angle, a = sin|x|/|x|, b = (1 - cos|x|)/|x|^2 and c = (1 - a)/|x|^2. Zeta; twice
    the sine of the angle of the body rotation times its axis, and phi; C' u of the velocity change u; alpha, at the end
    of its interval; cofactors of the matrix of nu, and the inverse of its determinant.

    Parameters
    ----------
    **rows : int
        Further rows by name: their number.
    """
    one, three, nine = _ROW, (3, _ROW), (3, 3, _ROW)
    more = {name: (number, _ROW) if number > 1 else one for name, number in rows.items()}
    # What is computed later comes first: a loop then writes below what it reads. Where it writes above, and reads the
    # end of an interval, the compiler fears that a value is read that was just written, and uses short vectors.
    return structure(
        inverse=one, cofactors=nine, alpha=three, phi=three, change=three, twice_sine=three, c=one, b=one, a=one,
        square=one, zeta=three, per_east=one, gravity=one, transport=three, earth_down=one, earth_north=one,
        north=one, per_north=one, radius=one, height=one, cosine=one, sine=one, position=three, dcm=nine, **more,
        velocity=three, interval=one,
    )  # fmt: skip


#: A block of samples.
SAMPLES = samples_structure()


@helper(borrows=True)
def _small_ratio(square: float) -> float:
    """asin(s) / s for s^2 = ``square`` below 1e-3, exact to rounding."""
    ratio: float = 1.0 + square * (
        1.0 / 6.0 + square * (3.0 / 40.0 + square * (15.0 / 336.0 + square * (105.0 / 3456.0)))
    )
    return ratio


@helper(borrows=True)
def _ratio(square: float) -> float:
    """asin(s) / s for s^2 = ``square``. A sample turns by far less than a quarter turn."""
    if square < 1e-3:
        return _small_ratio(square)
    ratio: float = np.arcsin(min(1.0, sqrt(square))) / sqrt(square)
    return ratio


@helper(borrows=True)
def _twice_sine(c: SmallMatrix, d: SmallMatrix, z: Triple, sz: float, bz: float) -> Triple:
    """Twice the sine of the angle times the axis of the body rotation exp(phi x) = C' exp(zeta x) D."""
    b00, b10, b20 = rotated(z[0], z[1], z[2], sz, bz, d.c00, d.c10, d.c20)
    b01, b11, b21 = rotated(z[0], z[1], z[2], sz, bz, d.c01, d.c11, d.c21)
    b02, b12, b22 = rotated(z[0], z[1], z[2], sz, bz, d.c02, d.c12, d.c22)
    # From the skew part
    return (
        (c.c02 * b01 + c.c12 * b11 + c.c22 * b21) - (c.c01 * b02 + c.c11 * b12 + c.c21 * b22),
        (c.c00 * b02 + c.c10 * b12 + c.c20 * b22) - (c.c02 * b00 + c.c12 * b10 + c.c22 * b20),
        (c.c01 * b00 + c.c11 * b10 + c.c21 * b20) - (c.c00 * b01 + c.c10 * b11 + c.c20 * b21),
    )


@helper(borrows=True)
def _square(x: Triple) -> float:
    square: float = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    return square


@helper(borrows=True)
def _solved(h: Triple, r: Triple) -> Triple:
    """The solution a of ``r = (I + [h x]) a``."""
    inverse = 1.0 / (1.0 + h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
    dot = h[0] * r[0] + h[1] * r[1] + h[2] * r[2]
    q0, q1, q2 = cross(h[0], h[1], h[2], r[0], r[1], r[2])
    return (r[0] - q0 + h[0] * dot) * inverse, (r[1] - q1 + h[1] * dot) * inverse, (r[2] - q2 + h[2] * dot) * inverse


@helper(borrows=True)
def _velocity_change(
    c: SmallMatrix, v: Triple, w: Triple, z: Triple, earth: tuple[float, float], k: Triple, g: float, dt: float
) -> Triple:
    """C' u for the velocity change u, from v+ - v = (I - zeta x / 2) u + gravity and Coriolis."""
    m0, m1, m2 = 0.5 * (v[0] + w[0]), 0.5 * (v[1] + w[1]), 0.5 * (v[2] + w[2])
    y0, y1, y2 = cross(2.0 * earth[0] + k[0], k[1], 2.0 * earth[1] + k[2], m0, m1, m2)
    u = _solved(
        (-0.5 * z[0], -0.5 * z[1], -0.5 * z[2]),
        (w[0] - v[0] + dt * y0, w[1] - v[1] + dt * y1, w[2] - v[2] + dt * y2 - dt * g),
    )
    return (
        c.c00 * u[0] + c.c10 * u[1] + c.c20 * u[2],
        c.c01 * u[0] + c.c11 * u[1] + c.c21 * u[2],
        c.c02 * u[0] + c.c12 * u[1] + c.c22 * u[2],
    )


@helper(borrows=True)
def _cofactors(r: Triple, h: Triple, angle2: float, b: float, k: float) -> tuple[SmallMatrix, float]:
    """Cofactors and inverse of the determinant of I + b phi x + c (phi x)^2 + alpha' / 12 x, which is diagonally
    dominant; k is c.
    """
    g0, g1, g2 = b * r[0] + h[0], b * r[1] + h[1], b * r[2] + h[2]
    m00, m11, m22 = (
        1.0 + k * (r[0] * r[0] - angle2),
        1.0 + k * (r[1] * r[1] - angle2),
        1.0 + k * (r[2] * r[2] - angle2),
    )
    m01, m10 = k * r[0] * r[1] - g2, k * r[0] * r[1] + g2
    m02, m20 = k * r[0] * r[2] + g1, k * r[0] * r[2] - g1
    m12, m21 = k * r[1] * r[2] - g0, k * r[1] * r[2] + g0
    x0, x1, x2 = cross(m01, m11, m21, m02, m12, m22)
    inverse = 1.0 / (m00 * x0 + m10 * x1 + m20 * x2)
    y0, y1, y2 = cross(m02, m12, m22, m00, m10, m20)
    t0, t1, t2 = cross(m00, m10, m20, m01, m11, m21)
    return SmallMatrix(x0, x1, x2, y0, y1, y2, t0, t1, t2), inverse


@helper(borrows=True)
def _nu(change: Triple, nu: Triple, a: Triple, m: SmallMatrix, inverse: float) -> Triple:
    """The velocity increment, by Cramer's rule; ``nu`` is that of the interval before, ``a`` the angle increment."""
    t0, t1, t2 = cross(nu[0], nu[1], nu[2], a[0], a[1], a[2])
    d0, d1, d2 = change[0] - t0 * TWELFTH, change[1] - t1 * TWELFTH, change[2] - t2 * TWELFTH
    return (
        (d0 * m.c00 + d1 * m.c01 + d2 * m.c02) * inverse,
        (d0 * m.c10 + d1 * m.c11 + d2 * m.c12) * inverse,
        (d0 * m.c20 + d1 * m.c21 + d2 * m.c22) * inverse,
    )


class IdealSample(NamedTuple):
    """The sample of ideal instruments over an interval.

    Attributes
    ----------
    angular_rate, specific_force : three floats
        Means [rad/s], [m/s^2], body axes.
    displacement : three floats
        Changes of latitude and longitude [rad] and of height [m].
    earth_rate : two floats
        Earth rate in the middle of the interval, north and down [rad/s].
    """

    angular_rate: Triple
    specific_force: Triple
    displacement: Triple
    earth_rate: tuple[float, float]


@helper(borrows=True)
def sample_from_motion(
    latitude: float, height: float, v: Triple, w: Triple, c: SmallMatrix, d: SmallMatrix, memory: Array, dt: float
) -> IdealSample:
    """The sample of ideal instruments over one interval: the exact inverse of `simnav.strapdown.mechanize_step`.

    Parameters
    ----------
    latitude, height : float
        Latitude [rad] and height [m] at the start of the interval.
    v, w : tuples of 3 floats
        Velocity at the start and at the end, north-east-down [m/s].
    c, d : SmallMatrix
        Direction cosine matrix from body axes to north-east-down at the start and at the end.
    memory : (6,) array
        Angle and velocity increments of the interval before; updated.
    dt : float
        Length of the interval [s].

    Returns
    -------
    IdealSample
    """
    m0, m1, m2 = 0.5 * (v[0] + w[0]), 0.5 * (v[1] + w[1]), 0.5 * (v[2] + w[2])
    local = local_rates(latitude, height, m0, m1, m2, dt)
    e0, e2 = local.earth_north, local.earth_down
    k0, k1, k2 = local.transport_north, local.transport_east, local.transport_down
    z = (e0 + k0) * dt, k1 * dt, (e2 + k2) * dt
    sz, bz = rotation_coefficients(_square(z))
    x0, x1, x2 = _twice_sine(c, d, z, sz, bz)
    ratio = _ratio(0.25 * _square((x0, x1, x2)))
    r = 0.5 * ratio * x0, 0.5 * ratio * x1, 0.5 * ratio * x2
    # alpha from phi = (I + [alpha'/12 x]) alpha
    last_angle, last_velocity = memory[:3], memory[3:]
    h = last_angle[0] * TWELFTH, last_angle[1] * TWELFTH, last_angle[2] * TWELFTH
    a = _solved(h, r)
    change = _velocity_change(c, v, w, z, (e0, e2), (k0, k1, k2), local.gravity, dt)
    angle2 = _square(r)
    sa, b = rotation_coefficients(angle2)
    k = 1.0 / 6.0 - angle2 * (1.0 / 120.0) if angle2 < 1e-3 else (1.0 - sa) / angle2
    m, inverse = _cofactors(r, h, angle2, b, k)
    n = _nu(change, (last_velocity[0], last_velocity[1], last_velocity[2]), a, m, inverse)
    last_angle[0], last_angle[1], last_angle[2] = a
    last_velocity[0], last_velocity[1], last_velocity[2] = n
    inverse = 1.0 / dt
    return IdealSample(
        angular_rate=(a[0] * inverse, a[1] * inverse, a[2] * inverse),
        specific_force=(n[0] * inverse, n[1] * inverse, n[2] * inverse),
        displacement=(dt * m0 * local.per_north, dt * m1 * local.per_east, -dt * m2),
        earth_rate=(e0, e2),
    )


@helper(borrows=True)
def three_at(rows: Array, k: int) -> Triple:
    """A vector of sample k."""
    return rows[0, k], rows[1, k], rows[2, k]


@helper(borrows=True)
def put_three(rows: Array, k: int, x: Triple) -> None:
    """Store a vector of sample k."""
    rows[0, k], rows[1, k], rows[2, k] = x


@helper(borrows=True)
def matrix_at(rows: Array, k: int) -> SmallMatrix:
    """A matrix of sample k."""
    return SmallMatrix(
        rows[0, 0, k], rows[0, 1, k], rows[0, 2, k], rows[1, 0, k], rows[1, 1, k], rows[1, 2, k], rows[2, 0, k],
        rows[2, 1, k], rows[2, 2, k],
    )  # fmt: skip


@helper(borrows=True)
def put_matrix(rows: Array, k: int, m: SmallMatrix) -> None:
    """Store a matrix of sample k."""
    rows[0, 0, k], rows[0, 1, k], rows[0, 2, k] = m.c00, m.c01, m.c02
    rows[1, 0, k], rows[1, 1, k], rows[1, 2, k] = m.c10, m.c11, m.c12
    rows[2, 0, k], rows[2, 1, k], rows[2, 2, k] = m.c20, m.c21, m.c22


@helper(borrows=True)
def _coefficients(block: Any, n: int) -> None:
    """The coefficients a, b and c of n rotations, by the squares of their angles."""
    square, a, b, c = block.square, block.a, block.b, block.c
    large, m = 0, np.uint64(n)
    for k in range(m):
        angle2 = square[k]
        a[k], b[k] = small_rotation_coefficients(angle2)
        c[k] = 1.0 / 6.0 - angle2 * (1.0 / 120.0)
        large += not angle2 < 1e-3
    if large > 0:
        for k in range(m):
            angle2 = square[k]
            if not angle2 < 1e-3:
                a[k], b[k] = rotation_coefficients(angle2)
                c[k] = (1.0 - a[k]) / angle2


@helper(borrows=True)
def _locate(block: Any, n: int) -> None:
    """Latitudes and heights at the ends of n intervals, and what follows from those in their middle.

    The latitude in the middle decides the step to the next latitude, by a sine, a root and two divisions. To wait for
    each of these takes longer than all else. So the steps are guessed, computed at the latitudes that follow from
    the guess, and the guess is right if the computed steps give the same latitudes, bit for bit. Otherwise the
    computed steps are the next guess. Each guess is right for one more interval at least, and the first one is right
    for nearly all blocks: an error of the latitude of 1e-12 rad changes no bit of a step.
    """
    m, interval, velocity, position = np.uint64(n), block.interval, block.velocity, block.position
    after, end = velocity[:, 1:], position[:, 1:]
    sine, middle_height, per_north, to_north = block.sine, block.height, block.per_north, block.north
    latitude, height, north = position[0, 0], position[2, 0], 0.0
    s = sin(latitude)
    meridian, _ = radii_scalar(s)
    x = 1.0 - ECCENTRICITY_SQUARED * s * s
    slope = 3.0 * ECCENTRICITY_SQUARED * s * cos(latitude) / x * meridian / (meridian + height)
    for k in range(m):
        dt = interval[k]
        m0, m2 = 0.5 * (velocity[0, k] + after[0, k]), 0.5 * (velocity[2, k] + after[2, k])
        middle_height[k] = height - 0.5 * dt * m2
        height += -dt * m2
        end[2, k] = height
        to_north[k] = dt * m0
        per_north[k] = north + 0.5 * dt * m0
        north += dt * m0
    for k in range(m):
        per_north[k] = 1.0 / (meridian + slope * per_north[k] + middle_height[k])
    for _ in range(n + 1):
        latitude = position[0, 0]
        for k in range(m):
            middle = middle_latitude(latitude, 0.5 * (velocity[0, k] + after[0, k]), interval[k])
            sine[k], block.cosine[k] = sin(middle), cos(middle)
            latitude += to_north[k] * per_north[k]
            end[0, k] = latitude
        wrong = 0
        for k in range(m):
            per_north[k], block.radius[k] = per_north_scalar(sine[k], middle_height[k])
            wrong += position[0, k] + to_north[k] * per_north[k] != end[0, k]
        if wrong == 0:
            break


@helper(borrows=True)
def ideal_samples(block: Any, n: int, memory: Array, rate: Array, force: Array) -> None:
    """The samples of ideal instruments over n intervals: `sample_from_motion` for a block.

    Parameters
    ----------
    block : record
        A `samples_structure`. Given are the n intervals, velocities and direction cosine matrices at their n + 1 ends,
        and the position at the start. The positions at the other ends and all other rows are overwritten.
    n : int
        Number of intervals, at most `BLOCK`.
    memory : (6,) array
        Angle and velocity increments of the interval before; updated.
    rate, force : (n, 3) arrays
        Overwritten: mean angular rates [rad/s] and mean specific forces [m/s^2], body axes.
    """
    interval, velocity, dcm, position = block.interval, block.velocity, block.dcm, block.position
    transport, zeta, phi, alpha = block.transport, block.zeta, block.phi, block.alpha
    # A view begins at the end of the first interval, and indices are unsigned: the compiler then knows that none counts
    # from the end of a row, and uses vector instructions.
    m, after, turned, end, new = np.uint64(n), velocity[:, 1:], dcm[:, :, 1:], position[:, 1:], alpha[:, 1:]
    _locate(block, n)
    for k in range(m):
        dt = interval[k]
        m0, m1 = 0.5 * (velocity[0, k] + after[0, k]), 0.5 * (velocity[1, k] + after[1, k])
        rates = rates_in_the_middle(
            block.sine[k], block.cosine[k], block.height[k], block.radius[k], block.per_north[k], m0, m1
        )
        e0, e2 = rates.earth_north, rates.earth_down
        k0, k1, k2 = rates.transport_north, rates.transport_east, rates.transport_down
        z = (e0 + k0) * dt, k1 * dt, (e2 + k2) * dt
        block.earth_north[k], block.earth_down[k] = e0, e2
        block.gravity[k], block.per_east[k] = rates.gravity, rates.per_east
        put_three(transport, k, (k0, k1, k2))
        put_three(zeta, k, z)
        block.square[k] = _square(z)
    _coefficients(block, n)
    large = 0
    for k in range(m):
        c, z = matrix_at(dcm, k), three_at(zeta, k)
        x = _twice_sine(c, matrix_at(turned, k), z, block.a[k], block.b[k])
        put_three(block.twice_sine, k, x)
        earth = block.earth_north[k], block.earth_down[k]
        v, w = three_at(velocity, k), three_at(after, k)
        change = _velocity_change(c, v, w, z, earth, three_at(transport, k), block.gravity[k], interval[k])
        put_three(block.change, k, change)
        square = 0.25 * _square(x)
        ratio = _small_ratio(square)
        put_three(phi, k, (0.5 * ratio * x[0], 0.5 * ratio * x[1], 0.5 * ratio * x[2]))
        large += not square < 1e-3
    if large > 0:
        for k in range(m):
            x = three_at(block.twice_sine, k)
            ratio = _ratio(0.25 * _square(x))
            put_three(phi, k, (0.5 * ratio * x[0], 0.5 * ratio * x[1], 0.5 * ratio * x[2]))
    last_angle, last_velocity = memory[:3], memory[3:]
    a = last_angle[0], last_angle[1], last_angle[2]
    put_three(alpha, 0, a)
    for k in range(m):
        a = _solved((a[0] * TWELFTH, a[1] * TWELFTH, a[2] * TWELFTH), three_at(phi, k))
        put_three(new, k, a)
        east = 0.5 * (velocity[1, k] + after[1, k])
        end[1, k] = position[1, k] + interval[k] * east * block.per_east[k]
    last_angle[0], last_angle[1], last_angle[2] = a
    for k in range(m):
        block.square[k] = _square(three_at(phi, k))
    _coefficients(block, n)
    for k in range(m):
        h = alpha[0, k] * TWELFTH, alpha[1, k] * TWELFTH, alpha[2, k] * TWELFTH
        cofactors, inverse = _cofactors(three_at(phi, k), h, block.square[k], block.b[k], block.c[k])
        put_matrix(block.cofactors, k, cofactors)
        block.inverse[k] = inverse
    nu = last_velocity[0], last_velocity[1], last_velocity[2]
    for k in range(m):
        a = three_at(new, k)
        nu = _nu(three_at(block.change, k), nu, a, matrix_at(block.cofactors, k), block.inverse[k])
        inverse = 1.0 / interval[k]
        rate[k, 0], rate[k, 1], rate[k, 2] = a[0] * inverse, a[1] * inverse, a[2] * inverse
        force[k, 0], force[k, 1], force[k, 2] = nu[0] * inverse, nu[1] * inverse, nu[2] * inverse
    last_velocity[0], last_velocity[1], last_velocity[2] = nu


@kernel
def _increments(
    time: Vector,
    velocity: Matrix,
    dcm: Stack,
    memory: Vector,
    position: Matrix,
    angular_rate: Matrix,
    specific_force: Matrix,
    work: Vector,
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
    work : (w,) array
        Room for `SAMPLES`; overwritten.
    """
    block = work.view(SAMPLES)[0]
    for start in range(0, time.size - 1, BLOCK):
        n = min(BLOCK, time.size - 1 - start)
        for k in range(n + 1):
            for i in range(3):
                block.velocity[i, k] = velocity[start + k, i]
                for j in range(3):
                    block.dcm[i, j, k] = dcm[start + k, i, j]
        for i in range(3):
            block.position[i, 0] = position[start, i]
        for k in range(n):
            block.interval[k] = time[start + k + 1] - time[start + k]
        ideal_samples(block, n, memory, angular_rate[start : start + n], specific_force[start : start + n])
        for k in range(1, n + 1):
            position[start + k] = three_at(block.position, k)


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
        filled(SAMPLES),
    )
    return ImuSamples(time[1:], interval, rate, force), positions
