"""Kernels of the ship model: each of its equations once, for one state or for many.

The state is a position (latitude, longitude, height) and a vector x of n numbers: those of the ship (`ShipStates`),
then biases and scale factors. North and east are zero, or metres from the position where many states share it.
Equations and sources are those of `simnav.estimators.models.ship`.

An instrument is an `Aid`, whose code is one of `POSITION` to `BODY_VELOCITY`, with figures of its noise (`SHIP_NOISE`).
"""

from __future__ import annotations

from math import atan2, ceil, cos, exp, sin
from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.geometry.earth import horizontal_offset, move_position
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.structures import structure
from simnav.types import Array

from .filtering import NOWHERE, Aid
from .inertial_errors import ERROR

__all__ = [
    "BODY_VELOCITY",
    "HEADING",
    "LOG",
    "POSITION",
    "SHIP",
    "SHIP_NOISE",
    "VELOCITY",
    "ShipStates",
    "advance_ship",
    "correct_ship",
    "correct_ships",
    "describe_ship",
    "differ_ships",
    "move_ships",
    "observe_ship",
    "read_ships",
    "sail_ships",
]


class ShipStates(NamedTuple):
    """Where the states of the ship are in x, and their errors in rows and columns of matrices.

    Attributes
    ----------
    north, east : int
        Position [m].
    speed : int
        Ahead through the water [m/s].
    heading, turn_rate : int
        [rad], [rad/s].
    current_north, current_east : int
        Current [m/s].
    """

    north: int = 0
    east: int = 1
    speed: int = 2
    heading: int = 3
    turn_rate: int = 4
    current_north: int = 5
    current_east: int = 6


SHIP = ShipStates()
POSITION, HEADING, LOG, VELOCITY, BODY_VELOCITY = range(5)
#: The noise of an instrument: variances of its two components and of the sideways velocity; squared scale factor and
#: squared yaw misalignment that count as noise.
SHIP_NOISE = structure(first=float, second=float, sway=float, scale=float, misalignment=float)
#: Longest step of the integration [s].
STEP = 1.0


@helper
def steps_of(elapsed: float, turn_time: float) -> tuple[int, float, float]:
    """Number of integration steps of an interval, their length, and the integral of the decaying turn rate over one."""
    steps = max(1, ceil(elapsed / STEP - 1e-9))
    dt = elapsed / steps
    return steps, dt, turn_time * (1.0 - exp(-dt / turn_time))


@helper
def decay_of(rate: Array, dt: float, decay: Array) -> None:
    """Fill in by what the states shrink in a step. (Loops, here and below: they compile faster than expressions.)"""
    for i in range(rate.size):
        decay[i] = exp(-rate[i] * dt)


@helper
def set_identity(M: Array) -> None:
    """``M = 1``."""
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            M[i, j] = 0.0
        M[i, i] = 1.0


class ShipStep(NamedTuple):
    """A step of a ship.

    Attributes
    ----------
    north, east : float
        Distance over ground [m].
    speed : float
        Through the water [m/s].
    cosine, sine : float
        Of the mean heading.
    """

    north: float
    east: float
    speed: float
    cosine: float
    sine: float


@helper
def sail(x: Array, decay: Array, turning: float, dt: float) -> ShipStep:
    """Move x on by a step."""
    u, turn = x[SHIP.speed], turning * x[SHIP.turn_rate]
    middle = x[SHIP.heading] + 0.5 * turn
    c, s = cos(middle), sin(middle)
    north, east = dt * (u * c + x[SHIP.current_north]), dt * (u * s + x[SHIP.current_east])
    for i in range(SHIP.speed, x.size):
        x[i] *= decay[i]
    x[SHIP.heading] += turn
    return ShipStep(north, east, u, c, s)


@helper
def carry_rows(M: Array, decay: Array, turning: float, dt: float, u: float, c: float, s: float) -> None:
    """``M = F M`` in place, F the transition matrix of `sail`'s step."""
    n = M.shape[1]
    for j in range(n):
        turned = turning * M[SHIP.turn_rate, j]
        aside = u * (M[SHIP.heading, j] + 0.5 * turned)
        M[SHIP.north, j] += dt * (c * M[SHIP.speed, j] - s * aside + M[SHIP.current_north, j])
        M[SHIP.east, j] += dt * (s * M[SHIP.speed, j] + c * aside + M[SHIP.current_east, j])
        M[SHIP.heading, j] += turned
    for i in range(SHIP.speed, M.shape[0]):
        if decay[i] != 1.0:
            for j in range(n):
                M[i, j] *= decay[i]


@helper
def sail_step(
    position: Array, x: Array, transition: Array, decay: Array, turning: float, dt: float
) -> tuple[float, float, float]:
    """Move a state on by a step, and a transition matrix with it; return what `carry_rows` takes."""
    step = sail(x, decay, turning, dt)
    move_position(position, step.north, step.east, 0.0)
    carry_rows(transition, decay, turning, dt, step.speed, step.cosine, step.sine)
    return step.speed, step.cosine, step.sine


@kernel
def advance_ship(
    position: Vector,
    x: Vector,
    covariance: Matrix,
    transition: Matrix,
    rate: Vector,
    density: Vector,
    turn_time: float,
    elapsed: float,
) -> None:
    """Propagate a state and its covariance, in place.

    Half of a step's noise is added before it and half after it, which is accurate to second order in its length.

    Parameters
    ----------
    position : (3,) array
        Latitude, longitude [rad] and height [m].
    x : (n,) array
        The state (see the module).
    covariance : (n, n) array
        Covariance of the errors of position and states.
    transition : (n, n) array
        Overwritten with the transition matrix of the step.
    rate, density : (n,) arrays
        Inverse correlation times [1/s] and noise densities.
    turn_time : float
        Correlation time of the turn rate [s].
    elapsed : float
        Length of the step [s].
    """
    n = x.size
    steps, dt, turning = steps_of(elapsed, turn_time)
    decay = np.empty(n)
    decay_of(rate, dt, decay)
    set_identity(transition)
    for _ in range(steps):
        u, c, s = sail_step(position, x, transition, decay, turning, dt)
        for i in range(n):
            covariance[i, i] += 0.5 * dt * density[i]
        for half in range(2):
            if half == 1:  # (F P)' to the left of which F makes F P F'
                for i in range(n):
                    for j in range(i):
                        covariance[i, j], covariance[j, i] = covariance[j, i], covariance[i, j]
            carry_rows(covariance, decay, turning, dt, u, c, s)
        for i in range(n):
            for j in range(i):
                covariance[j, i] = covariance[i, j]
            covariance[i, i] += 0.5 * dt * density[i]


@kernel
def move_ships(states: Matrix, rate: Vector, turn_time: float, elapsed: float) -> None:
    """Advance (k, n) states by the same motion; their positions are metres."""
    steps, dt, turning = steps_of(elapsed, turn_time)
    decay = np.empty(rate.size)
    decay_of(rate, dt, decay)
    for k in range(states.shape[0]):
        for _ in range(steps):
            step = sail(states[k], decay, turning, dt)
            states[k, SHIP.north] += step.north
            states[k, SHIP.east] += step.east


@kernel
def sail_ships(position: Matrix, x: Matrix, elapsed: Vector, rate: Vector, turn_time: float, transition: Stack) -> None:
    """Advance K states, each by a time of its own, in place.

    Parameters
    ----------
    position, x : (K, 3), (K, n) arrays
        The states (see the module); updated.
    elapsed : (K,) array
        Times [s].
    rate : (n,) array
        Inverse correlation times [1/s].
    turn_time : float
        Correlation time of the turn rate [s].
    transition : (K, n, n) array
        Overwritten with the transition matrices.
    """
    decay = np.empty(rate.size)
    for k in range(x.shape[0]):
        set_identity(transition[k])
        steps, dt, turning = steps_of(elapsed[k], turn_time)
        decay_of(rate, dt, decay)
        for _ in range(steps):
            sail_step(position[k], x[k], transition[k], decay, turning, dt)


@kernel
def differ_ships(position: Matrix, x: Matrix, other: Matrix, other_x: Matrix, difference: Matrix) -> None:
    """Fill in (K, n) by how much K states differ from K others, in metres with the radii of the others."""
    for k in range(x.shape[0]):
        north, east = horizontal_offset(other[k], position[k, 0], position[k, 1])
        difference[k, SHIP.north], difference[k, SHIP.east] = north, east
        for i in range(SHIP.speed, x.shape[1]):
            difference[k, i] = x[k, i] - other_x[k, i]


@helper
def reading(aid: Aid, x: Array, jacobian: Array) -> tuple[float, float]:
    """What an instrument should read, up to two components; a position in metres from that of the state.

    The derivative is written into a matrix of zeros (or of the same instrument's last one).
    """
    kind, at, scale = aid.code, aid.bias_at, aid.scale_at
    psi, r, lx, ly = x[SHIP.heading], x[SHIP.turn_rate], aid.lever_arm[0], aid.lever_arm[1]
    ahead, across, c, s = x[SHIP.speed] - r * ly, r * lx, cos(psi), sin(psi)
    north, east = x[SHIP.current_north], x[SHIP.current_east]
    a, b = 0.0, 0.0
    if kind == HEADING:
        a, jacobian[0, SHIP.heading] = psi, 1.0
    elif kind == LOG:
        a, factor = ahead, 1.0
        if scale >= 0:
            factor += x[scale]
            a, jacobian[0, scale] = a * factor, ahead
        jacobian[0, SHIP.speed], jacobian[0, SHIP.turn_rate] = factor, -factor * ly
    elif kind == POSITION:
        a, b = x[SHIP.north] + c * lx - s * ly, x[SHIP.east] + s * lx + c * ly
        jacobian[0, SHIP.north], jacobian[1, SHIP.east] = 1.0, 1.0
        jacobian[0, SHIP.heading], jacobian[1, SHIP.heading] = -s * lx - c * ly, c * lx - s * ly
    elif kind == VELOCITY:
        a, b = c * ahead - s * across + north, s * ahead + c * across + east
        jacobian[0, SHIP.speed], jacobian[1, SHIP.speed] = c, s
        jacobian[0, SHIP.turn_rate], jacobian[1, SHIP.turn_rate] = -c * ly - s * lx, -s * ly + c * lx
        jacobian[0, SHIP.heading], jacobian[1, SHIP.heading] = -s * ahead - c * across, c * ahead - s * across
        jacobian[0, SHIP.current_north], jacobian[1, SHIP.current_east] = 1.0, 1.0
    else:
        a, b = ahead + c * north + s * east, across - s * north + c * east
        jacobian[0, SHIP.speed] = 1.0
        jacobian[0, SHIP.turn_rate], jacobian[1, SHIP.turn_rate] = -ly, lx
        jacobian[0, SHIP.heading], jacobian[1, SHIP.heading] = c * east - s * north, -c * north - s * east
        jacobian[0, SHIP.current_north], jacobian[0, SHIP.current_east] = c, s
        jacobian[1, SHIP.current_north], jacobian[1, SHIP.current_east] = -s, c
    if at >= 0:
        a, jacobian[0, at] = a + x[at], 1.0
        if kind == POSITION:
            b, jacobian[1, at + 1] = b + x[at + 1], 1.0
    return a, b


@helper
def linearise_ship(
    aid: Aid, position: Array, x: Array, first: float, second: float, jacobian: Array
) -> tuple[float, float]:
    """Measured minus predicted: metres, radians or metres per second; the second is 0 of a single component.

    The derivative of the prediction is written as by `reading`.
    """
    a, b = reading(aid, x, jacobian)
    if aid.code == HEADING:
        return atan2(sin(first - a), cos(first - a)), 0.0
    if aid.code == LOG:
        return first - a, 0.0
    if aid.code == POSITION:
        first, second = horizontal_offset(position, first, second)
    return first - a, second - b


@kernel
def observe_ship(
    aid: Aid,
    figures: Vector,
    position: Vector,
    x: Vector,
    first: float,
    second: float,
    residual: Vector,
    jacobian: Matrix,
    noise: Matrix,
) -> None:
    """Linearise one measurement.

    Parameters
    ----------
    aid : Aid
        The instrument.
    figures : (5,) array
        The `SHIP_NOISE` of the instrument.
    position : (3,) array
        Latitude, longitude [rad] and height [m].
    x : (n,) array
        The state (see the module).
    first, second : float
        The value measured; the second is not looked at where there is one component.
    residual : (m,) array
        Of one or two components; overwritten with measured minus predicted.
    jacobian : (m, n) array
        Zeros on entry; filled.
    noise : (m, m) array
        Overwritten.
    """
    white = figures.view(SHIP_NOISE)[0]
    a, b = linearise_ship(aid, position, x, first, second, jacobian)
    residual[0] = a
    noise[0, 0] = white.first
    if residual.size == 1:
        return
    residual[1] = b
    noise[0, 1], noise[1, 0], noise[1, 1] = 0.0, 0.0, white.second
    if aid.code == VELOCITY:
        c, s = cos(x[SHIP.heading]), sin(x[SHIP.heading])
        noise[0, 0] += s * s * white.sway
        noise[0, 1] -= s * c * white.sway
        noise[1, 0] -= s * c * white.sway
        noise[1, 1] += c * c * white.sway
    elif aid.code == BODY_VELOCITY:
        v, w = reading(aid, x, jacobian)
        noise[0, 0] += white.scale * v * v + white.misalignment * w * w
        noise[1, 1] += white.scale * w * w + white.misalignment * v * v + white.sway


@kernel
def read_ships(aid: Aid, states: Matrix, readings: Matrix) -> None:
    """Fill in (k, m) what an instrument should read at (k, n) states; a position in metres."""
    derivative = np.zeros((2, states.shape[1]))
    for k in range(states.shape[0]):
        a, b = reading(aid, states[k], derivative)
        readings[k, 0] = a
        if readings.shape[1] > 1:
            readings[k, 1] = b


@kernel
def correct_ship(position: Vector, x: Vector, dx: Vector) -> None:
    """Add the correction ``dx`` (n,) to a state, in place."""
    move_position(position, dx[SHIP.north], dx[SHIP.east], 0.0)
    for i in range(SHIP.speed, x.size):
        x[i] += dx[i]


@kernel
def correct_ships(position: Matrix, x: Matrix, steps: Matrix) -> None:
    """Add (K, n) corrections to K states, in place."""
    for k in range(steps.shape[0]):
        correct_ship(position[k], x[k], steps[k])


@kernel
def describe_ship(x: Vector, covariance: Matrix, sway: float, velocity: Vector, out: Matrix) -> None:
    """Ground velocity of a state, and the covariance of what it says of position, velocity and heading.

    Parameters
    ----------
    x : (n,) array
        The state (see the module).
    covariance : (n, n) array
        Covariance of the errors of position and states.
    sway : float
        Sigma of the sideways velocity [m/s].
    velocity : (3,) array
        North and east are overwritten.
    out : (9, 9) array
        Rows and columns of horizontal position, horizontal velocity and heading are overwritten (`InertialErrors`).
    """
    n = x.size
    aid = Aid(VELOCITY, np.zeros(3), NOWHERE, NOWHERE)
    G = np.zeros((2, n))
    velocity[0], velocity[1] = reading(aid, x, G)
    rows = np.zeros((5, n))  # of G P, G being of position, velocity, heading
    for j in range(n):
        rows[0, j], rows[1, j] = covariance[SHIP.north, j], covariance[SHIP.east, j]
        rows[4, j] = covariance[SHIP.heading, j]
        for k in range(n):
            rows[2, j] += G[0, k] * covariance[k, j]
            rows[3, j] += G[1, k] * covariance[k, j]
    north, east, heading = ERROR.position, ERROR.position + 1, ERROR.attitude + 2
    northward, eastward = ERROR.velocity, ERROR.velocity + 1
    at = (north, east, northward, eastward, heading)
    for i in range(5):
        x0, x1 = 0.0, 0.0
        for k in range(n):
            x0 += rows[i, k] * G[0, k]
            x1 += rows[i, k] * G[1, k]
        out[at[i], north], out[at[i], east] = rows[i, SHIP.north], rows[i, SHIP.east]
        out[at[i], northward], out[at[i], eastward], out[at[i], heading] = x0, x1, rows[i, SHIP.heading]
    c, s = cos(x[SHIP.heading]), sin(x[SHIP.heading])
    out[northward, northward] += s * s * sway * sway
    out[northward, eastward] -= s * c * sway * sway
    out[eastward, northward] -= s * c * sway * sway
    out[eastward, eastward] += c * c * sway * sway
