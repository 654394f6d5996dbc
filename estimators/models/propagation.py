"""Kernels of the inertial model: strapdown propagation, transition matrix, process noise and covariance.

`advance_inertial` carries the state from one measurement to the next at IMU rate and sums it up in blocks of at most
`BLOCK` seconds; `accumulate_error` makes the transition matrix and the process noise of these blocks, so that the
covariance is touched once a measurement (`propagate_covariance`). The equations are those of
`simnav.estimators.models.inertial`.
"""

from __future__ import annotations

from math import cos, exp, sin
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.products import (
    Places,
    add_eight,
    eight_of,
    eight_sums,
    list_elements,
    sparse_product,
)
from simnav.geometry.earth import (
    EQUATORIAL_GRAVITY,
    ROTATION_RATE,
    SEMI_MAJOR_AXIS,
    gravity_scalar,
    move_position,
    radii_scalar,
)
from simnav.geometry.rotation import rotate_left, rotation_coefficients
from simnav.kernel_types import Matrix, Vector
from simnav.strapdown import mechanize_step
from simnav.structures import length as numbers_of
from simnav.structures import structure
from simnav.types import Array

from .covariance_propagation import propagate_covariance
from .inertial_errors import ERROR, TRIAD

__all__ = [
    "BLOCK",
    "BLOCK_NUMBERS",
    "CLOCK",
    "HELD_ATTITUDE",
    "HELD_VELOCITY",
    "IMU_NOISE",
    "INERTIAL_STATE",
    "LARGEST_FORCE",
    "LARGEST_RATE",
    "MOTION_NUMBERS",
    "NO_SAMPLES",
    "TURN_TIME",
    "Motion",
    "SampleInterval",
    "Samples",
    "accumulate_error",
    "advance_inertial",
    "correct_inertial",
    "motion_of",
    "next_interval",
    "propagate_inertial",
    "time_of",
]

#: Longest block over which attitude and specific force count as constant in the transition matrix [s].
BLOCK = 0.2
#: Time over which the turn rate is averaged, and for which a scale-factor error is taken to last in a turn [s].
TURN_TIME = 60.0
#: What a time without IMU data adds, for each axis that does not measure: random walks of velocity [m/s/sqrt(s)] and
#: attitude [rad/sqrt(s)].
HELD_VELOCITY, HELD_ATTITUDE = 0.3, 0.03
#: Samples above these limits are not plausible for a marine vehicle [rad/s], [m/s^2].
LARGEST_RATE, LARGEST_FORCE = 50.0, 500.0
#: Relative growth of gravity from the equator to the poles [-].
GRAVITY_FLATTENING = 0.0053024

#: A block over which the error is propagated at once: its length and the part of it without data [s]; latitude, height,
#: velocity, elements of the mean DCM, mean specific force in north-east-down, averaged body rate, and the noise that is
#: added for each axis of the IMU while it does not measure [rad^2], [m^2/s^2].
ERROR_BLOCK = structure(
    length=float, held=float, latitude=float, height=float, velocity=3, dcm=(3, 3), specific_force=3, rate=3,
    unmeasured=6,
)  # fmt: skip
#: Time of the state, end of the last sample used, and seconds held so far [s]; that sample's mean rate and force; the
#: mean rate of the one before; and the rate at the time of the state, extrapolated from both: a mean is half a sample
#: old, which over the lever arm of a DVL in a seaway would be taken for a misalignment.
CLOCK = structure(time=float, used=float, held=float, mean_rate=3, mean_force=3, rate_before=3, rate=3)
#: A flat inertial state, behind which are the calibration states of the instruments; the blocks are those of `Motion`.
INERTIAL_STATE = structure(position=3, velocity=3, dcm=(3, 3), bias=6, increments=6, turn=3, clock=numbers_of(CLOCK))
#: Numbers of a flat inertial state before the calibration states.
MOTION_NUMBERS = numbers_of(INERTIAL_STATE)
#: Noise of an IMU: densities of the white noises of gyroscopes and accelerometers; decay and noise density of their
#: biases; ``scale^2 TURN_TIME`` and ``misalignment^2 TURN_TIME`` of the gyroscopes; and the nominal interval [s].
IMU_NOISE = structure(
    gyroscope=float, accelerometer=float, gyroscope_decay=float, gyroscope_walk=float, accelerometer_decay=float,
    accelerometer_walk=float, scale=float, misalignment=float, interval=float,
)  # fmt: skip
#: Numbers of a block.
BLOCK_NUMBERS = numbers_of(ERROR_BLOCK)
#: Columns of the matrices of a block: the 15 states, and one of zeros, so that they are a multiple of eight.
WIDTH = 16


class Samples(NamedTuple):
    """The IMU samples of a step.

    Attributes
    ----------
    time, interval : (k,) array
        Ends of the samples, and their lengths [s].
    angular_rate, specific_force : (k, 3) array
        Means over the intervals [rad/s], [m/s^2].
    unmeasured : (k, 6) array
        Noise density of the values that the IMU did not measure, 0 of the others; gyroscopes first [rad^2/s],
        [m^2/s^3] (`simnav.estimators.models.flat_lines`).
    """

    time: Vector
    interval: Vector
    angular_rate: Matrix
    specific_force: Matrix
    unmeasured: Matrix


#: No samples.
NO_SAMPLES = Samples(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 6)))


class Motion(NamedTuple):
    """An inertial state that is propagated, with what it remembers of the samples. All arrays are updated in place.

    Attributes
    ----------
    position, velocity : (3,) array
        Latitude, longitude [rad] and height [m]; velocity north, east, down [m/s].
    dcm : (3, 3) array
        Rotation from body to north-east-down.
    bias : (6,) array
        Biases of gyroscopes [rad/s] and accelerometers [m/s^2], which decay.
    increments : (6,) array
        Angle and velocity increments of the last whole sample.
    turn : (3,) array
        Averaged body rate [rad/s].
    clock : array
        A `CLOCK`.
    """

    position: Vector
    velocity: Vector
    dcm: Matrix
    bias: Vector
    increments: Vector
    turn: Vector
    clock: Vector


@helper
def motion_of(numbers: Array) -> Motion:
    """The named blocks of a flat inertial state; behind them are the calibration states."""
    own = numbers[:MOTION_NUMBERS].view(INERTIAL_STATE)[0]
    return Motion(
        own.position[:], own.velocity[:], own.dcm[:], own.bias[:], own.increments[:], own.turn[:], own.clock[:]
    )


@helper
def time_of(state: Motion) -> float:
    """Time of a state [s]."""
    return float(state.clock.view(CLOCK)[0].time)


@helper
def _usable(w0: float, w1: float, w2: float, f0: float, f1: float, f2: float) -> bool:
    rate = abs(w0) + abs(w1) + abs(w2)
    force = abs(f0) + abs(f1) + abs(f2)
    return rate < LARGEST_RATE and force < LARGEST_FORCE  # false for NaN


@helper
def _dynamics(F: Array, block: Any, gyro_decay: float, accelerometer_decay: float) -> None:
    """Compute the system matrix F of the error dynamics for one block.

    Of each part of the error (r, v, p: position, velocity, attitude) the components are north, east and down.
    """
    r, v, p = ERROR.position, ERROR.velocity, ERROR.attitude
    height = block.height
    s, cl = sin(block.latitude), cos(block.latitude)
    meridian, prime = radii_scalar(s)
    a, b = 1.0 / (meridian + height), 1.0 / (prime + height)
    t = s / cl
    v0, v1, v2 = block.velocity[0], block.velocity[1], block.velocity[2]
    f0, f1, f2 = block.specific_force[0], block.specific_force[1], block.specific_force[2]
    e0, e2 = ROTATION_RATE * cl, -ROTATION_RATE * s
    k0, k1, k2 = v1 * b, -v0 * a, -v1 * b * t
    F[r, r], F[r, r + 2], F[r, v] = -v2 * a, v0 * a, 1.0
    F[r + 1, r], F[r + 1, r + 1], F[r + 1, r + 2], F[r + 1, v + 1] = v1 * t * a, -v2 * b - v0 * t * a, v1 * b, 1.0
    F[r + 2, v + 2] = 1.0
    # -(2 w_ie + w_en) x dv
    x0, x1, x2 = 2.0 * e0 + k0, k1, 2.0 * e2 + k2
    F[v, v], F[v, v + 1], F[v, v + 2] = 0.0, x2, -x1
    F[v + 1, v], F[v + 1, v + 1], F[v + 1, v + 2] = -x2, 0.0, x0
    F[v + 2, v], F[v + 2, v + 1], F[v + 2, v + 2] = x1, -x0, 0.0
    # -dw_en x v, with dw_en = (dv_E b, -dv_N a, -dv_E b t): w x v = (w1 v2 - w2 v1, w2 v0 - w0 v2, w0 v1 - w1 v0)
    F[v, v] += a * v2
    F[v, v + 1] += -b * t * v1
    F[v + 1, v + 1] += b * t * v0 + b * v2
    F[v + 2, v] += -a * v0
    F[v + 2, v + 1] += -b * v1
    # -2 dw_ie x v, with dw_ie = (e2, 0, -e0) a dr_N
    F[v, r] = -2.0 * e0 * a * v1
    F[v + 1, r] = 2.0 * (e0 * v0 + e2 * v2) * a
    F[v + 2, r] = -2.0 * e2 * a * v1 + 2.0 * GRAVITY_FLATTENING * EQUATORIAL_GRAVITY * s * cl * a
    F[v + 2, r + 2] = 2.0 * gravity_scalar(s, height) / SEMI_MAJOR_AXIS
    # -[f x] phi
    F[v, p + 1], F[v, p + 2] = f2, -f1
    F[v + 1, p], F[v + 1, p + 2] = -f2, f0
    F[v + 2, p], F[v + 2, p + 1] = f1, -f0
    # -w_in x phi - dw_ie - dw_en
    w0, w1, w2 = e0 + k0, k1, e2 + k2
    F[p, p + 1], F[p, p + 2] = w2, -w1
    F[p + 1, p], F[p + 1, p + 2] = -w2, w0
    F[p + 2, p], F[p + 2, p + 1] = w1, -w0
    F[p, r], F[p + 2, r] = -e2 * a, e0 * a
    F[p, v + 1], F[p + 1, v], F[p + 2, v + 1] = -b, a, b * t
    dcm = block.dcm
    for i in range(3):
        for j in range(3):
            F[v + i, ERROR.accelerometer_bias + j] = -dcm[i, j]
            F[p + i, ERROR.gyroscope_bias + j] = -dcm[i, j]
        F[ERROR.gyroscope_bias + i, ERROR.gyroscope_bias + i] = -gyro_decay
        F[ERROR.accelerometer_bias + i, ERROR.accelerometer_bias + i] = -accelerometer_decay


@helper
def _list_elements(F: Array, dt: float, value: Array, half: Array, column: Places, count: Places) -> None:
    """List the elements of ``F dt`` and of ``F dt / 2`` that are not zero, row by row."""
    list_elements(F, half, column, count)
    for i in range(np.uint64(ERROR.calibration)):
        for q in range(count[i]):
            value[i, q], half[i, q] = half[i, q] * dt, 0.5 * half[i, q] * dt


@helper
def _advance_rows(value: Array, half: Array, column: Places, count: Places, M: Array, A: Array) -> None:
    """Compute ``M = (I + F dt + F F dt^2 / 2) M`` with the lists of `_list_elements`; A is work space."""
    sparse_product(value, column, count, M, A)
    for i in range(np.uint64(ERROR.calibration)):
        for j in range(np.uint64(0), np.uint64(WIDTH), np.uint64(8)):
            add_eight(M[i], j, eight_sums(half, column, i, count[i], A, j, eight_of(A[i], j)))


@helper
def _add_noise(Q: Array, block: Any, noise: Any) -> None:
    """Add half the noise of a block to Q: white, biases, turns, a time without data."""
    dt, held, dcm, rate = 0.5 * block.length, 0.5 * block.held, block.dcm, block.rate
    white, scale, misalignment = noise.gyroscope, noise.scale, noise.misalignment
    t0, t1, t2 = rate[0] * rate[0], rate[1] * rate[1], rate[2] * rate[2]
    g0 = (white + scale * t0 + misalignment * (t1 + t2)) * dt
    g1 = (white + scale * t1 + misalignment * (t0 + t2)) * dt
    g2 = (white + scale * t2 + misalignment * (t0 + t1)) * dt
    for i in range(3):
        c0, c1, c2 = dcm[i, 0] * g0, dcm[i, 1] * g1, dcm[i, 2] * g2
        for j in range(3):
            turn = c0 * dcm[j, 0] + c1 * dcm[j, 1] + c2 * dcm[j, 2]
            Q[ERROR.attitude + i, ERROR.attitude + j] += turn
        Q[ERROR.velocity + i, ERROR.velocity + i] += noise.accelerometer * dt + HELD_VELOCITY * HELD_VELOCITY * held
        Q[ERROR.attitude + i, ERROR.attitude + i] += HELD_ATTITUDE * HELD_ATTITUDE * held
        Q[ERROR.gyroscope_bias + i, ERROR.gyroscope_bias + i] += noise.gyroscope_walk * dt
        Q[ERROR.accelerometer_bias + i, ERROR.accelerometer_bias + i] += noise.accelerometer_walk * dt
    _add_unmeasured(Q, block)


@helper
def _add_unmeasured(Q: Array, block: Any) -> None:
    """Add half the noise of the axes that did not measure in a block to Q."""
    dcm = block.dcm
    for axis in range(3):
        turn, push = 0.5 * block.unmeasured[axis], 0.5 * block.unmeasured[3 + axis]
        if turn > 0.0 or push > 0.0:
            for i in range(3):
                for j in range(3):
                    both = dcm[i, axis] * dcm[j, axis]
                    Q[ERROR.attitude + i, ERROR.attitude + j] += both * turn
                    Q[ERROR.velocity + i, ERROR.velocity + j] += both * push


@kernel
def accumulate_error(blocks: Matrix, count: int, noise: Vector, transition: Matrix, process_noise: Matrix) -> None:
    """Compute transition matrix and process noise of the error over successive blocks.

    Parameters
    ----------
    blocks : (k, ...) array
        An `ERROR_BLOCK` in each row, from `advance_inertial`.
    count : int
        Number of blocks that are used.
    noise : (9,) array
        An `IMU_NOISE`.
    transition, process_noise : (15, 15) arrays
        Overwritten: the error at the end is ``transition`` times the error at the start, plus noise.
    """
    n = ERROR.calibration
    F, Phi, Q, A = np.zeros((n, n)), np.zeros((n, WIDTH)), np.zeros((n, WIDTH)), np.empty((n, WIDTH))
    value, half = np.empty((n, n)), np.empty((n, n))
    column, elements = np.empty((n, n), np.uint64), np.empty(n, np.uint64)
    imu = noise.view(IMU_NOISE)[0]
    for i in range(n):
        Phi[i, i] = 1.0
    for k in range(count):
        block = blocks[k].view(ERROR_BLOCK)[0]
        _dynamics(F, block, imu.gyroscope_decay, imu.accelerometer_decay)
        _list_elements(F, block.length, value, half, column, elements)
        _advance_rows(value, half, column, elements, Phi, A)
        # Half of the noise is added before the block and half after it: accurate to second order in its length.
        _add_noise(Q, block, imu)
        _advance_rows(value, half, column, elements, Q, A)
        for i in range(n):  # (Phi Q)' to the left of which Phi makes Phi Q Phi'
            for j in range(i):
                Q[i, j], Q[j, i] = Q[j, i], Q[i, j]
        _advance_rows(value, half, column, elements, Q, A)
        for i in range(n):
            for j in range(i):
                Q[j, i] = Q[i, j]
        _add_noise(Q, block, imu)
    for i in range(n):
        for j in range(n):
            transition[i, j] = Phi[i, j]
            process_noise[i, j] = Q[i, j]


class SampleInterval(NamedTuple):
    """An interval that is covered by one sample, or by none.

    Attributes
    ----------
    sample : int
        Index of the sample.
    stop : float
        End of the interval [s].
    whole : float
        Length of the sample if it is used up then, else 0 [s].
    hold : bool
        Whether there is no sample for it.
    """

    sample: int
    stop: float
    whole: float
    hold: bool


@helper
def next_interval(clock: Any, samples: Samples, i: int, t: float, until: float, nominal: float) -> SampleInterval:
    """Find the next interval that is covered by one sample, or by none.

    Parameters
    ----------
    clock : CLOCK
        What it says of samples is updated.
    samples : Samples
        The IMU samples.
    i : int
        Index of the first sample that may not be completely used.
    t, until, nominal : float
        Start of the interval, its latest end, and the nominal sample interval [s].

    Returns
    -------
    SampleInterval
    """
    time, interval, rate, force = samples.time, samples.interval, samples.angular_rate, samples.specific_force
    mean_rate, mean_force, rate_before, extrapolated = clock.mean_rate, clock.mean_force, clock.rate_before, clock.rate
    eps = 1e-7
    n = time.size
    while i < n and (
        time[i] <= t + eps or not _usable(rate[i, 0], rate[i, 1], rate[i, 2], force[i, 0], force[i, 1], force[i, 2])
    ):
        i += 1
    hold, whole, stop = False, 0.0, until
    if i < n and time[i] - interval[i] <= t + 0.5 * nominal:
        stop = min(time[i], until)
        started = time[i] - interval[i]
        if t <= started + eps or clock.used < started - 0.5 * nominal:
            adjacent = clock.used >= started - 0.5 * nominal
            for r in range(3):
                rate_before[r] = mean_rate[r] if adjacent else rate[i, r]
        ahead = (stop - started) / interval[i] - 0.5
        for r in range(3):
            mean_rate[r], mean_force[r] = rate[i, r], force[i, r]
            extrapolated[r] = rate[i, r] + ahead * (rate[i, r] - rate_before[r])
        clock.used = stop
        if stop >= time[i] - eps:
            whole = interval[i]
    elif i < n:
        stop, hold = min(time[i] - interval[i], until), True
    elif t < clock.used + 1.5 * nominal:
        stop = min(clock.used + 2.0 * nominal, until)  # the step ends between samples: the last sample is extrapolated
    else:
        hold = True
    return SampleInterval(i, stop, whole, hold)


@kernel
def advance_inertial(
    state: Motion,
    samples: Samples,
    first: int,
    until: float,
    noise: Vector,
    blocks: Matrix,
) -> tuple[int, int]:
    """Propagate an inertial state to a time, which need not be the time of a sample, in place.

    A sample that spans ``until`` is used in part, and the rest by the next call. If samples are missing or implausible,
    velocity and attitude are held.

    Parameters
    ----------
    state : Motion
        The state; updated.
    samples : Samples
        The IMU samples.
    first : int
        Index of the first sample that is not completely used.
    until : float
        Time to which the state is propagated [s].
    noise : (9,) array
        An `IMU_NOISE`.
    blocks : (m, ...) array
        Overwritten with the blocks for `accumulate_error`; m must be large enough.

    Returns
    -------
    int, int
        Index of the first sample that is not completely used, and number of blocks.
    """
    position, velocity, dcm, turn = state.position, state.velocity, state.dcm, state.turn
    gyroscope_bias, accelerometer_bias = state.bias[TRIAD.gyroscopes], state.bias[TRIAD.accelerometers]
    angle, change = state.increments[TRIAD.gyroscopes], state.increments[TRIAD.accelerometers]
    clock, imu = state.clock.view(CLOCK)[0], noise.view(IMU_NOISE)[0]
    eps = 1e-7
    before = np.empty((3, 3))
    keep = np.empty(6)
    rate, force = clock.mean_rate, clock.mean_force
    t, i, count = clock.time, first, 0
    nominal = imu.interval
    while t < until - eps:
        block = blocks[count].view(ERROR_BLOCK)[0]
        mean = block.dcm
        count += 1
        begin, end = t, min(until, t + BLOCK)
        v0, v1, v2 = velocity[0], velocity[1], velocity[2]
        for r in range(3):
            for c in range(3):
                before[r, c] = dcm[r, c]
                mean[r, c] = 0.0
        held, s0, s1, s2 = 0.0, 0.0, 0.0, 0.0
        for r in range(6):
            block.unmeasured[r] = 0.0
        while t < end - eps:
            covered = next_interval(clock, samples, i, t, end, nominal)
            i, stop, whole = covered.sample, covered.stop, covered.whole
            dt = stop - t
            if covered.hold:
                meridian, prime = radii_scalar(sin(position[0]))
                position[0] += dt * velocity[0] / (meridian + position[2])
                position[1] += dt * velocity[1] / ((prime + position[2]) * cos(position[0]))
                position[2] -= dt * velocity[2]
                for r in range(6):
                    state.increments[r] = 0.0
                held += dt
            else:
                w0, w1, w2 = rate[0] - gyroscope_bias[0], rate[1] - gyroscope_bias[1], rate[2] - gyroscope_bias[2]
                f0, f1, f2 = (
                    force[0] - accelerometer_bias[0], force[1] - accelerometer_bias[1], force[2] - accelerometer_bias[2]
                )  # fmt: skip
                for r in range(6):
                    keep[r] = state.increments[r]
                mechanize_step(position, velocity, dcm, state.increments, (w0, w1, w2), (f0, f1, f2), dt)
                if whole > 0.0:
                    angle[0], angle[1], angle[2] = w0 * whole, w1 * whole, w2 * whole
                    change[0], change[1], change[2] = f0 * whole, f1 * whole, f2 * whole
                else:
                    for r in range(6):
                        state.increments[r] = keep[r]
                s0, s1, s2 = s0 + w0 * dt, s1 + w1 * dt, s2 + w2 * dt
                if i < samples.time.size:
                    for r in range(6):
                        block.unmeasured[r] += dt * samples.unmeasured[i, r]
            for r in range(3):
                for c in range(3):
                    mean[r, c] += dcm[r, c] * dt
            t = stop
        length = end - begin
        # The sum has the attitude at the ends of the samples; their middles are half a sample earlier.
        shift = 0.5 * min(nominal, length)
        for r in range(3):
            for c in range(3):
                mean[r, c] = (mean[r, c] - shift * (dcm[r, c] - before[r, c])) / length
        # Mean specific force from the change of velocity: f = v' + (2 w_ie + w_en) x v - g
        sl, cl = sin(position[0]), cos(position[0])
        meridian, prime = radii_scalar(sl)
        m0, m1, m2 = 0.5 * (v0 + velocity[0]), 0.5 * (v1 + velocity[1]), 0.5 * (v2 + velocity[2])
        east = m1 / (prime + position[2])
        x0, x1 = 2.0 * ROTATION_RATE * cl + east, -m0 / (meridian + position[2])
        x2 = -2.0 * ROTATION_RATE * sl - east * sl / cl
        block.specific_force[0] = (velocity[0] - v0) / length + x1 * m2 - x2 * m1
        block.specific_force[1] = (velocity[1] - v1) / length + x2 * m0 - x0 * m2
        block.specific_force[2] = (velocity[2] - v2) / length + x0 * m1 - x1 * m0 - gravity_scalar(sl, position[2])
        weight = min(1.0, length / TURN_TIME)
        turn[0] += weight * (s0 / length - turn[0])
        turn[1] += weight * (s1 / length - turn[1])
        turn[2] += weight * (s2 / length - turn[2])
        block.length, block.held, block.latitude, block.height = length, held, position[0], position[2]
        block.velocity[0], block.velocity[1], block.velocity[2] = m0, m1, m2
        for r in range(3):
            block.rate[r] = turn[r]
        clock.held += held
        decay_g, decay_a = exp(-imu.gyroscope_decay * length), exp(-imu.accelerometer_decay * length)
        for r in range(3):
            gyroscope_bias[r] *= decay_g
            accelerometer_bias[r] *= decay_a
    clock.time = until
    return i, count


@kernel
def propagate_inertial(
    state: Motion,
    samples: Samples,
    first: int,
    until: float,
    noise: Vector,
    matrices: tuple[Matrix, Matrix, Matrix],
    others: tuple[Vector, Vector, Vector],
    elapsed: float,
) -> int:
    """Do `advance_inertial`, `accumulate_error` and `propagate_covariance` in one kernel.

    Parameters
    ----------
    state, samples, first, until, noise
        As of `advance_inertial`.
    matrices : two (15, 15) arrays and an (n, n) array
        Transition matrix and process noise, overwritten as by `accumulate_error`; covariance, as of
        `propagate_covariance`.
    others : tuple of (n - 15,) arrays
        Values, inverse correlation times and noise densities of the other states, as of `propagate_covariance`.
    elapsed : float
        As of `propagate_covariance`.

    Returns
    -------
    int
        Index of the first sample that is not completely used.
    """
    transition, process_noise, covariance = matrices
    blocks = np.empty((int((until - time_of(state)) / BLOCK) + 2, BLOCK_NUMBERS))
    first, count = advance_inertial(state, samples, first, until, noise, blocks)
    accumulate_error(blocks, count, noise, transition, process_noise)
    calibration, rate, density = others
    propagate_covariance(covariance, transition, process_noise, calibration, rate, density, elapsed)
    return first


@kernel
def correct_inertial(
    position: Vector, velocity: Vector, dcm: Matrix, bias: Vector, calibration: Vector, dx: Vector
) -> None:
    """Add the correction ``dx`` to a state, in place; the attitude is turned by ``exp(r x)`` from the left."""
    move_position(position, dx[ERROR.position], dx[ERROR.position + 1], dx[ERROR.position + 2])
    r0, r1, r2 = dx[ERROR.attitude], dx[ERROR.attitude + 1], dx[ERROR.attitude + 2]
    a, b = rotation_coefficients(r0 * r0 + r1 * r1 + r2 * r2)
    rotate_left(dcm, r0, r1, r2, a, b, dcm)
    for j in range(3):
        velocity[j] += dx[ERROR.velocity + j]
    for j in range(6):
        bias[j] += dx[ERROR.gyroscope_bias + j]
    for j in range(calibration.size):
        calibration[j] += dx[ERROR.calibration + j]
