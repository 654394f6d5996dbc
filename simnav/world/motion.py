"""The motion kernel: from commands, vessel dynamics, waves and current to a smooth truth and ideal inertial samples.

For each sample it executes the manoeuvre table (guidance), advances speed, yaw rate and flight-path angle through
critically damped lags, advances the wave components by their encounter phase, composes velocity and attitude, and
computes the sample of ideal instruments by the inverse strapdown equations (`simnav.inverse_strapdown`). So truth and
samples agree up to rounding. This is done for blocks of 64 samples, one part after the other: a part is then a short
loop, whose iterations the processor overlaps, or a loop of vector instructions.
"""

from __future__ import annotations

from math import atan2, cos, exp, inf, sin
from typing import NamedTuple

import numpy as np

from simnav.compiled import Array, Integers, helper, kernel
from simnav.geometry.rotation import wrap_scalar
from simnav.inverse_strapdown import AXES, BLOCK, BLOCK_COLUMNS, INTERVAL, POSITION, VELOCITY, ideal_samples
from simnav.kernel_types import FlagVector, IntegerMatrix, IntegerVector, Matrix, Stack, Vector
from simnav.strapdown import Triple
from simnav.world.manoeuvres import ACCELERATE, COLUMNS, DEPTH, HOLD, TURN, WAYPOINTS, ZIGZAG
from simnav.world.manoeuvring.dynamics import HULL, RATE, RATE_CHANGE, SAIL, SPEED, SPEED_CHANGE, SWAY, sail
from simnav.world.motion_block import (
    ANGLES,
    BLOCK_ROWS,
    BOW,
    FLOW,
    Course,
    body_rate,
    cosine_sine,
    course_at,
    matrix,
    orient,
    put_course,
    tap_at,
    wrapped,
)
from simnav.world.sea import ROWS
from simnav.world.seaway import Responses, Transitions, answers, transitions, wave_responses

__all__ = [
    "DIVE",
    "HAS_HULL",
    "HULL_NUMBERS",
    "HULL_STATE",
    "PARAMETERS",
    "STATE",
    "TAP_COLUMNS",
    "RequestedStates",
    "advance",
    "command",
    "initialise",
]

# Indices in the state vector.
U, DU, R, DR, PSI, GAMMA, DGAMMA, DEPTH_CALM, NORTH, EAST = range(10)
LATITUDE, LONGITUDE, HEIGHT = 10, 11, 12
V = 13
C = 16
MEMORY = 25
SPEED_COMMAND, SPEED_TARGET, SPEED_SLEW, PSI_REFERENCE, RATE_LIMIT, DEPTH_REFERENCE, GAMMA_LIMIT = range(31, 38)
SEGMENT_TIME, SEGMENT_PSI, SEGMENT_SIGN, SEGMENT_NORTH, SEGMENT_EAST = range(38, 43)
BODY_RATE = 43
ERROR_NORTH, ERROR_EAST = 46, 47
ROLL, PITCH = 48, 49
COS_PSI, SIN_PSI, COS_GAMMA, SIN_GAMMA = range(50, 54)
WATER_NORTH, WATER_EAST = 54, 55
# In closed loop: error of the heading by which the vessel is steered, and the heading correction back to the track.
# In a turn for a given time, where the rate is commanded and not the heading: the parts of both already turned.
ERROR_HEADING, TO_TRACK, TURNED = 56, 57, 58
#: Heave velocity, roll, pitch and yaw that follow from the waves as oscillators, each with value, rate and what drives
#: it (`simnav.world.sea.steady`); without them all are zero.
ANSWERS = 59
YAW_ANSWER = ANSWERS + 9
#: State of a hull with three degrees of freedom.
HULL_STATE = 71
STATE = HULL_STATE + SAIL
#: Where the state holds the depth that is steered for, and the largest path angle.
DIVE = np.array([DEPTH_REFERENCE, GAMMA_LIMIT])
# ... in the integer state: sample, segment, waypoint, whether the segment has begun
# ... and in the parameters.
DT, TAU_U, TAU_R, TAU_G, TURN_RATE, HEEL, DIVES, CURRENT_N, CURRENT_E, SHEAR, ATTENUATION, LONGEST = range(12)
#: Natural angular frequency and damping ratio of these oscillators; zero: there are none.
OSCILLATORS = 12
#: Whether there is a hull with three degrees of freedom, and its numbers.
HAS_HULL, HULL_NUMBERS = 20, 21
PARAMETERS = HULL_NUMBERS + HULL
#: Columns of a tap: position 0:3, velocity 3:6, roll, pitch, yaw 6:9, angular rate 9:12, current north, east 12:14.
TAP_COLUMNS = 14
#: Rows of the phases of waves, and columns of an eddy.
PHASES, EDDY_COLUMNS = 3, 6


class Composed(NamedTuple):
    """The motion with waves and current.

    Attributes
    ----------
    velocity : three floats
        North, east, down [m/s].
    roll, pitch : float
        [rad].
    cos_bow, sin_bow : float
        Cosine and sine of the heading of the bow.
    """

    velocity: Triple
    roll: float
    pitch: float
    cos_bow: float
    sin_bow: float


@helper(borrows=True)
def _lag(x: float, dx: float, command: float, dt: float, tau: float, decay: float) -> tuple[float, float]:
    """Exact step of a critically damped second-order lag under a constant command.

    ``x`` and ``dx`` are the value and its rate, ``tau`` is the time constant [s], ``dt`` the step [s], and ``decay`` is
    exp(-dt/tau). Returned are the value and its rate at the end of the step.
    """
    y = x - command
    b = dx + y / tau
    return command + (y + b * dt) * decay, (dx - b * dt / tau) * decay


@helper(borrows=True)
def _waypoint(points: Array, j: int, relative: float, x: Array) -> tuple[float, float]:
    """Waypoint j as distances north and east of the start of the run [m]."""
    a, b = points[j, 0], points[j, 1]
    if relative > 0.0:
        c, s = cos(x[SEGMENT_PSI]), sin(x[SEGMENT_PSI])
        return x[SEGMENT_NORTH] + c * a - s * b, x[SEGMENT_EAST] + s * a + c * b
    return a, b


@helper(borrows=True)
def _guide(x: Array, index: Integers, p: Array, rows: Array, points: Array, time: float) -> float:
    """Execute the manoeuvre table: store the references in the state, and return the commanded yaw rate [rad/s]."""
    psi = x[PSI] + x[ERROR_HEADING] - x[TO_TRACK]
    # The heading at which the vessel would stop turning if the commanded rate became zero now.
    rest = psi + 2.0 * p[TAU_R] * x[R] + p[TAU_R] ** 2 * x[DR]
    direct = inf  # a rate that is commanded directly, without the heading loop
    for _ in range(rows.shape[0] + 1):
        i = index[1]
        if i >= rows.shape[0]:
            break
        kind = int(rows[i, 0])
        if index[3] == 0:
            index[3] = 1
            x[SEGMENT_TIME] = time
            x[SEGMENT_PSI] = x[PSI_REFERENCE]
            x[RATE_LIMIT] = p[TURN_RATE]
            if kind == ACCELERATE:
                x[SPEED_TARGET], x[SPEED_SLEW] = rows[i, 2], rows[i, 3]
            elif kind == TURN:
                x[SEGMENT_SIGN] = 1.0 if rows[i, 2] > 0.0 else -1.0
                if abs(rows[i, 2]) < inf:
                    x[PSI_REFERENCE] += rows[i, 2]
            elif kind == ZIGZAG:
                x[SEGMENT_SIGN] = 1.0
            elif kind == WAYPOINTS:
                index[2] = int(rows[i, 2])
                x[SEGMENT_NORTH], x[SEGMENT_EAST] = x[NORTH], x[EAST]
            elif kind == DEPTH:
                x[DEPTH_REFERENCE], x[GAMMA_LIMIT] = rows[i, 2], rows[i, 3]
        done = time - x[SEGMENT_TIME] >= rows[i, 1] - 1e-9
        if kind == HOLD:
            pass
        elif kind == ACCELERATE:
            reached = abs(x[U] - rows[i, 2]) < 0.01 * max(1.0, rows[i, 2]) and abs(x[DU]) < 1e-3
            done = done or (rows[i, 1] == inf and reached)
        elif kind == TURN:
            rate = rows[i, 3]
            if rows[i, 4] > 0.0:
                rate = x[U] / rows[i, 4]
            if rate <= 0.0:
                rate = p[TURN_RATE]
            x[RATE_LIMIT] = rate
            if abs(rows[i, 2]) < inf:
                done = done or (abs(x[PSI_REFERENCE] - psi) < 0.005 and abs(x[R]) < 5e-4)
            elif done:
                x[PSI_REFERENCE] = rest
            else:
                extra = (x[TO_TRACK] - x[ERROR_HEADING] - x[TURNED]) / (2.0 * p[TAU_R])
                extra = min(max(extra, -p[TURN_RATE]), p[TURN_RATE])
                x[TURNED] += extra * p[DT]
                direct = x[SEGMENT_SIGN] * rate + extra
        elif kind == ZIGZAG:
            rate = rows[i, 3] if rows[i, 3] > 0.0 else p[TURN_RATE]
            if x[SEGMENT_SIGN] * (psi - x[SEGMENT_PSI]) >= rows[i, 2]:
                x[SEGMENT_SIGN] = -x[SEGMENT_SIGN]
            if not done:
                extra = (x[TO_TRACK] - x[ERROR_HEADING] - x[TURNED]) / (2.0 * p[TAU_R])
                extra = min(max(extra, -p[TURN_RATE]), p[TURN_RATE])
                x[TURNED] += extra * p[DT]
                direct = x[SEGMENT_SIGN] * rate + extra
        elif kind == WAYPOINTS:
            # The vessel is steered by its estimated position.
            north, east = x[NORTH] + x[ERROR_NORTH], x[EAST] + x[ERROR_EAST]
            while index[2] < int(rows[i, 3]):
                j = index[2]
                a, b = _waypoint(points, j, rows[i, 5], x)
                from_a, from_b = x[SEGMENT_NORTH], x[SEGMENT_EAST]
                if j > int(rows[i, 2]):
                    from_a, from_b = _waypoint(points, j - 1, rows[i, 5], x)
                # Reached within the radius, or when it is abeam: otherwise the vessel might circle a point for ever.
                passed = (north - a) * (a - from_a) + (east - b) * (b - from_b) > 0.0
                if (a - north) ** 2 + (b - east) ** 2 > rows[i, 4] ** 2 and not passed:
                    # The vessel steers for the waypoint itself: there is no correction back to a track.
                    x[PSI_REFERENCE] = psi + wrapped(atan2(b - east, a - north) - x[TO_TRACK] - psi)
                    break
                index[2] += 1
            done = index[2] >= int(rows[i, 3])
        elif kind == DEPTH:
            done = done or (abs(x[DEPTH_CALM] - rows[i, 2]) < 0.5 and abs(x[GAMMA]) < 0.02)
        if not done:
            break
        index[1] += 1
        index[3] = 0
        direct = inf
    if direct < inf:
        return direct
    x[TURNED] = x[TO_TRACK] - x[ERROR_HEADING]
    # Control of the heading at rest makes the loop a simple exponential: its derivative is the commanded rate itself.
    wanted = (x[PSI_REFERENCE] - rest) / (2.0 * p[TAU_R])
    rate_command: float = min(max(wanted, -x[RATE_LIMIT]), x[RATE_LIMIT])
    return rate_command


@helper(borrows=True)
def _compose(course: Course, water: tuple[float, float], yaw_answer: float, p: Array, waves: Responses) -> Composed:
    """Velocity, roll, pitch, and cosine and sine of the heading of the bow, with current and waves added."""
    u, cp, sp, cg = course.speed, course.cos_heading, course.sin_heading, course.cos_path
    depth, sway = course.depth, course.sway
    shade, flow = 1.0, 1.0
    # The bow yaws about the course that the vessel keeps.
    ch, sh = cp, sp
    if depth > 0.0:
        shade = exp(-p[ATTENUATION] * depth)
        flow = max(0.0, 1.0 - p[SHEAR] * depth)
    if p[OSCILLATORS] > 0.0:
        yaw = course.heading + shade * yaw_answer
        ch, sh = cos(yaw), sin(yaw)
    v0 = u * cg * cp + flow * water[0] + shade * waves.north
    v1 = u * cg * sp + flow * water[1] + shade * waves.east
    v2 = -u * course.sin_path + shade * waves.down
    roll = shade * (waves.roll_north * sp - waves.roll_east * cp) - p[HEEL] * u * course.yaw_rate * (1.0 / 9.81)
    pitch = course.path + shade * (waves.pitch_north * cp + waves.pitch_east * sp)
    if p[HAS_HULL] > 0.0:
        v0, v1 = v0 - sway * sp, v1 + sway * cp
    return Composed((v0, v1, v2), roll, pitch, ch, sh)


@helper(borrows=True)
def _course(x: Array) -> Course:
    """The course of a state."""
    return Course(
        speed=x[U],
        yaw_rate=x[R],
        heading=x[PSI],
        cos_heading=x[COS_PSI],
        sin_heading=x[SIN_PSI],
        path=x[GAMMA],
        cos_path=x[COS_GAMMA],
        sin_path=x[SIN_GAMMA],
        depth=x[DEPTH_CALM],
        sway=x[HULL_STATE + SWAY],
    )


@helper(borrows=True)
def _through_water(p: Array, course: Course) -> tuple[float, float]:
    """Velocity through the water, north and east [m/s], without the waves."""
    ahead = course.speed * course.cos_path
    north, east = ahead * course.cos_heading, ahead * course.sin_heading
    if p[HAS_HULL] > 0.0:
        north -= course.sway * course.sin_heading
        east += course.sway * course.cos_heading
    return north, east


@helper(borrows=True)
def _water(x: Array, p: Array, eddies: Array, time: float) -> None:
    """Store the velocity of the surface water at the vessel's position in the state."""
    north, east = p[CURRENT_N], p[CURRENT_E]
    for i in range(eddies.shape[0]):
        c = cos(eddies[i, 0] * x[NORTH] + eddies[i, 1] * x[EAST] - eddies[i, 2] * time + eddies[i, 3])
        north += eddies[i, 4] * c
        east += eddies[i, 5] * c
    x[WATER_NORTH], x[WATER_EAST] = north, east


@helper(borrows=True)
def _sail(x: Array, p: Array, rate_command: float, time: float, decay: tuple[float, float]) -> None:
    """Advance speed, sway, yaw rate and heading of a hull with three degrees of freedom by one sample."""
    dt, h = p[DT], x[HULL_STATE:STATE]
    h[SPEED], h[SPEED_CHANGE] = _lag(h[SPEED], h[SPEED_CHANGE], x[SPEED_COMMAND], dt, p[TAU_U], decay[0])
    h[RATE], h[RATE_CHANGE] = _lag(h[RATE], h[RATE_CHANGE], rate_command, dt, p[TAU_R], decay[1])
    flow = max(0.0, 1.0 - p[SHEAR] * max(0.0, x[DEPTH_CALM]))
    water = flow * x[WATER_NORTH], flow * x[WATER_EAST]
    at = sail(p[HULL_NUMBERS:PARAMETERS], h, (x[U], x[R], x[PSI]), (p[TAU_U], p[TAU_R]), water, time, dt)
    x[U], x[DU], x[R], x[DR], x[PSI] = at.surge, at.surge_change, at.yaw_rate, at.yaw_rate_change, at.heading


@kernel
def initialise(x: Vector, p: Vector, phase: Matrix, table: Matrix, eddies: Matrix) -> None:
    """Complete the state at time 0: velocity and attitude with the waves and the current of that time."""
    _water(x, p, eddies, 0.0)
    x[COS_PSI], x[SIN_PSI], x[COS_GAMMA], x[SIN_GAMMA] = cos(x[PSI]), sin(x[PSI]), cos(x[GAMMA]), sin(x[GAMMA])
    course = _course(x)
    north, east = _through_water(p, course)
    w = wave_responses(phase, table, north, east, 0.0, 0.0)
    if p[OSCILLATORS] > 0.0:
        own = p[OSCILLATORS:HAS_HULL]
        w = answers(
            x[ANSWERS:HULL_STATE],
            own,
            w,
            course.cos_heading,
            course.sin_heading,
            phase,
            table,
            0.0,
            transitions(own, 0.0),
        )
    now = _compose(course, (x[WATER_NORTH], x[WATER_EAST]), x[YAW_ANSWER], p, w)
    x[V], x[V + 1], x[V + 2] = now.velocity
    cr, sr = cosine_sine(now.roll)
    ct, st = cosine_sine(now.pitch)
    c = matrix(cr, sr, ct, st, now.cos_bow, now.sin_bow)
    x[C], x[C + 1], x[C + 2] = c.c00, c.c01, c.c02
    x[C + 3], x[C + 4], x[C + 5] = c.c10, c.c11, c.c12
    x[C + 6], x[C + 7], x[C + 8] = c.c20, c.c21, c.c22
    x[ROLL], x[PITCH] = now.roll, now.pitch


@helper(borrows=True)
def _steer(x: Array, index: Integers, p: Array, plan: tuple[Array, Array], block: Array, first: int, last: int) -> None:
    """Guidance and the dynamics of the vessel in intervals of a block: store the course at their ends.

    ``first`` and ``last`` are the number of the first interval, and that after the last one. The other arguments are
    those of `advance`.
    """
    rows, points = plan
    dt = p[DT]
    decay_u, decay_r, decay_g = exp(-dt / p[TAU_U]), exp(-dt / p[TAU_R]), exp(-dt / p[TAU_G])
    psi = x[PSI]
    for k in range(first, last):
        t0 = index[0] * dt
        index[0] += 1
        rate_command = _guide(x, index, p, rows, points, t0)
        step = x[SPEED_SLEW] * dt
        x[SPEED_COMMAND] = min(max(x[SPEED_TARGET], x[SPEED_COMMAND] - step), x[SPEED_COMMAND] + step)
        if p[HAS_HULL] > 0.0:
            _sail(x, p, rate_command, t0, (decay_u, decay_r))
        else:
            x[U], x[DU] = _lag(x[U], x[DU], x[SPEED_COMMAND], dt, p[TAU_U], decay_u)
            r, dr = x[R], x[DR]
            x[R], x[DR] = _lag(r, dr, rate_command, dt, p[TAU_R], decay_r)
            # Hermite's rule: of fourth order, and as smooth as the rate
            x[PSI] += 0.5 * dt * (r + x[R]) + dt * dt / 12.0 * (dr - x[DR])
        if p[DIVES] > 0.0:
            climb = (x[DEPTH_CALM] - x[DEPTH_REFERENCE]) / (max(x[U], 0.3) * 5.0 * p[TAU_G])
            climb = min(max(climb, -x[GAMMA_LIMIT]), x[GAMMA_LIMIT])
            sink = -x[U] * x[SIN_GAMMA]
            x[GAMMA], x[DGAMMA] = _lag(x[GAMMA], x[DGAMMA], climb, dt, p[TAU_G], decay_g)
            x[COS_GAMMA], x[SIN_GAMMA] = cos(x[GAMMA]), sin(x[GAMMA])
            x[DEPTH_CALM] += 0.5 * dt * (sink - x[U] * x[SIN_GAMMA])
        if x[PSI] != psi:
            psi = x[PSI]
            x[COS_PSI], x[SIN_PSI] = cos(psi), sin(psi)
        put_course(block, k, _course(x))


@helper(borrows=True)
def _drift(
    x: Array,
    time: int,
    p: Array,
    water: tuple[Array, Array, Array],
    by: Transitions,
    block: Array,
    first: int,
    last: int,
) -> None:
    """Add waves and current to the course in intervals of a block: velocity, roll and pitch at their ends.

    ``time`` is the number of the sample at the start of the block, ``by`` moves the oscillators by a step. The other
    arguments are those of `_steer` and `advance`.
    """
    phase, table, eddies = water
    dt = p[DT]
    swell, own = x[ANSWERS:HULL_STATE], p[OSCILLATORS:HAS_HULL]
    for k in range(first, last):
        course = course_at(block, k)
        # The encounter frequency is that of the speed through the water.
        north, east = _through_water(p, course)
        waves = wave_responses(phase, table, north, east, dt, p[LONGEST])
        if p[OSCILLATORS] > 0.0:
            waves = answers(swell, own, waves, course.cos_heading, course.sin_heading, phase, table, dt, by)
        _water(x, p, eddies, (time + k + 1) * dt)
        now = _compose(course, (x[WATER_NORTH], x[WATER_EAST]), x[YAW_ANSWER], p, waves)
        v = now.velocity
        block[VELOCITY, k + 1], block[VELOCITY + 1, k + 1], block[VELOCITY + 2, k + 1] = v
        block[ANGLES, k + 1], block[ANGLES + 1, k + 1] = now.roll, now.pitch
        block[BOW, k], block[BOW + 1, k] = now.cos_bow, now.sin_bow
        block[FLOW, k], block[FLOW + 1, k] = x[WATER_NORTH], x[WATER_EAST]
        x[NORTH] += 0.5 * dt * (block[VELOCITY, k] + v[0])
        x[EAST] += 0.5 * dt * (block[VELOCITY + 1, k] + v[1])


@helper(borrows=True)
def _advance_one(
    x: Array,
    index: Integers,
    p: Array,
    plan: tuple[Array, Array],
    water: tuple[Array, Array, Array],
    tap_time: Array,
    taps: Array,
    imu: tuple[Array, Array],
    block: Array,
) -> None:
    """Advance one world by as many samples as ``imu`` has room for. The arguments are those of `advance`."""
    rate, force = imu
    dt, tap = p[DT], 0
    memory = x[MEMORY : MEMORY + 6]
    by = transitions(p[OSCILLATORS:HAS_HULL], dt)
    # Guidance is ahead of the waves, unless waypoints or eddies make it depend on the position.
    ahead = water[2].shape[0] == 0
    for i in range(plan[0].shape[0]):
        ahead = ahead and plan[0][i, 0] != WAYPOINTS
    for k in range(BLOCK):
        block[INTERVAL, k] = dt
    for start in range(0, rate.shape[0], BLOCK):
        n = min(BLOCK, rate.shape[0] - start)
        first = index[0]
        for i in range(3):
            block[VELOCITY + i, 0], block[POSITION + i, 0] = x[V + i], x[LATITUDE + i]
        for i in range(9):
            block[AXES + i, 0] = x[C + i]
        block[ANGLES, 0], block[ANGLES + 1, 0] = x[ROLL], x[PITCH]
        for k in range(0, n, n if ahead else 1):
            upto = n if ahead else k + 1
            _steer(x, index, p, plan, block, k, upto)
            _drift(x, first, p, water, by, block, k, upto)
        orient(block, n)
        ideal_samples(block, n, memory, rate[start : start + n], force[start : start + n])
        # Taps between the states at both ends of an interval
        k, last = 0, rate.shape[0] - 1
        while tap < tap_time.size:
            while k < n and not (tap_time[tap] <= (first + k + 1) * dt or start + k == last):
                k += 1
            if k == n:
                break
            before = x[BODY_RATE], x[BODY_RATE + 1], x[BODY_RATE + 2]
            if k > 0:
                before = body_rate(block, k - 1, rate[start + k - 1])
            turning = before, body_rate(block, k, rate[start + k])
            tap_at(taps[tap], min((tap_time[tap] - (first + k) * dt) / dt, 1.0), block, k, turning, p[SHEAR])
            tap += 1
        x[BODY_RATE], x[BODY_RATE + 1], x[BODY_RATE + 2] = body_rate(block, n - 1, rate[start + n - 1])
        for i in range(3):
            x[V + i], x[LATITUDE + i] = block[VELOCITY + i, n], block[POSITION + i, n]
        for i in range(9):
            x[C + i] = block[AXES + i, n]
        x[ROLL], x[PITCH] = block[ANGLES, n], block[ANGLES + 1, n]


class RequestedStates(NamedTuple):
    """The times at which the states of w worlds are required.

    Attributes
    ----------
    time : (w, k) array
        The times, ascending [s].
    first, last : (w,) int array
        Index of the first of these times within the block, and index after the last one.
    states : (w, m, 14) array
        Overwritten with the states at these times.
    """

    time: Matrix
    first: IntegerVector
    last: IntegerVector
    states: Stack


@kernel
def advance(
    active: FlagVector,
    state: tuple[Matrix, IntegerMatrix],
    p: Matrix,
    sizes: IntegerMatrix,
    plan: tuple[Matrix, Matrix],
    water: tuple[Matrix, Matrix, Matrix],
    requested: RequestedStates,
    imu: tuple[IntegerVector, Stack, Stack],
) -> None:
    """Advance w worlds, each by its own number of samples.

    There is one kernel for one world and for many. The compiler may reorder the sum over waves, so a second copy of it
    could differ in the last bit.

    Parameters
    ----------
    active : (w,) bool array
        True for each world that is advanced.
    state : (w, 79) and (w, 4) int arrays
        The state vector, and the integer state: sample, segment, waypoint, and 1 if the segment has begun. Both are
        updated.
    p : (w, 162) array
        Constants of the vessel, the water and the step, at the indices that this module names.
    sizes : (w, 4) int array
        Number of manoeuvres, points, waves and eddies of each world.
    plan : two (w, ...) arrays
        Rows and points of the manoeuvre tables (`simnav.world.manoeuvres.table`), each flattened. A row of the array
        may be longer than its content, like the rows of ``water``.
    water : three (w, ...) arrays
        Phases (updated) and table of the wave components (`simnav.world.sea.components`); the variable part of the
        current (`simnav.world.current.eddies`).
    requested : RequestedStates
        The times at which the state is required, and the states there.
    imu : (w,) int, (w, ..., 3) and (w, ..., 3) arrays
        Number of samples by which each world is advanced; ideal mean angular rate [rad/s] and specific force [m/s^2],
        overwritten.
    """
    x, index = state
    rows, points = plan
    phase, table, eddies = water
    first, last = requested.first, requested.last
    samples, rate, force = imu
    block = np.empty((BLOCK_ROWS, BLOCK_COLUMNS))
    for w in range(active.size):
        if not active[w]:
            continue
        r, q, c, e = sizes[w, 0], sizes[w, 1], sizes[w, 2], sizes[w, 3]
        n, m = samples[w], last[w] - first[w]
        _advance_one(
            x[w], index[w], p[w],
            (rows[w, : COLUMNS * r].reshape((r, COLUMNS)), points[w, : 2 * q].reshape((q, 2))),
            (
                phase[w, : PHASES * c].reshape((PHASES, c)), table[w, : ROWS * c].reshape((ROWS, c)),
                eddies[w, : EDDY_COLUMNS * e].reshape((e, EDDY_COLUMNS)),
            ),
            requested.time[w, first[w] : last[w]], requested.states[w, :m], (rate[w, :n], force[w, :n]), block,
        )  # fmt: skip


@kernel
def command(active: FlagVector, x: Matrix, wrong: Vector, heading: Vector, speed: Vector) -> None:
    """Command heading and speed of w worlds without manoeuvres.

    Parameters
    ----------
    active : (w,) bool array
        True for each world that gets a command.
    x : (w, 79) array
        State vectors; updated.
    wrong : (w,) array
        Error of the estimated heading by which the vessel is steered [rad]; NaN: as before.
    heading, speed : (w,) array
        Commanded heading, in terms of the estimated one [rad], and commanded speed through the water [m/s].
    """
    for w in range(active.size):
        if active[w]:
            if wrong[w] == wrong[w]:
                x[w, ERROR_HEADING] = wrong[w]
            estimated = x[w, PSI] + x[w, ERROR_HEADING]
            x[w, PSI_REFERENCE] = estimated + wrap_scalar(heading[w] - estimated)
            x[w, SPEED_TARGET] = max(speed[w], 0.0)
