"""The motion kernel: from commands, vessel dynamics, waves and current to a smooth truth and ideal inertial samples.

For each sample it executes the manoeuvre table (guidance), advances speed, yaw rate and flight-path angle through
critically damped lags, advances the wave components by their encounter phase, composes velocity and attitude, and
computes the sample of ideal instruments by the inverse strapdown equations (`simnav.inverse_strapdown`). So truth and
samples agree up to rounding. This is done for blocks of 64 samples, one part after the other: a part is then a short
loop, whose iterations the processor overlaps, or a loop of vector instructions.
"""

from __future__ import annotations

from math import atan2, cos, exp, inf, sin
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import Array, helper, kernel
from simnav.geometry.rotation import wrap_scalar
from simnav.inverse_strapdown import BLOCK, ideal_samples, put_three
from simnav.kernel_types import FlagVector, IntegerMatrix, IntegerVector, Matrix, Stack, Vector
from simnav.strapdown import Triple
from simnav.structures import length, structure
from simnav.true_state import TRUE_STATE
from simnav.world.current import EDDY, EDDY_NUMBERS
from simnav.world.manoeuvres import ACCELERATE, DEPTH, HOLD, MANOEUVRE, ROW, TURN, WAYPOINTS, ZIGZAG
from simnav.world.manoeuvring.dynamics import HULL, SAIL, sail
from simnav.world.motion_block import (
    MOTION,
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
from simnav.world.sea import PHASES, ROWS
from simnav.world.seaway import OSCILLATIONS, OSCILLATORS, Responses, Transitions, answers, transitions, wave_responses

__all__ = [
    "PARAMETERS",
    "PROGRESS",
    "SIZES",
    "STATE",
    "RequestedStates",
    "advance",
    "command",
    "initialise",
]

#: The state of a vessel. Speed through the water along the bow [m/s], yaw rate [rad/s], heading and path angle [rad],
#: with their changes; depth without the waves, distances north and east of the start [m]. Position, velocity, elements
#: of the DCM, and what the ideal samples remember (`simnav.inverse_strapdown`). What the guidance steers for: the
#: commanded speed, which approaches the target by at most so much a second; targets and limits. Of the present
#: manoeuvre: time, heading and place at its start, and the side to which it turns. Body rate of the last sample. In
#: closed loop: errors of the position and heading by which the vessel is steered, and the heading correction back to
#: the track; in a turn for a given time, where the rate is commanded and not the heading: the part of both already
#: turned. Roll and pitch; cosines and sines of heading and path angle; velocity of the surface water [m/s].
#: What follows from the waves as oscillators (`simnav.world.seaway.OSCILLATIONS`, `simnav.world.sea.steady`); without
#: them all are zero. The state of a hull (`simnav.world.manoeuvring.dynamics.SAIL`).
STATE = structure(
    speed=float, speed_change=float, yaw_rate=float, yaw_rate_change=float, heading=float, path_angle=float,
    path_rate=float, depth=float, north=float, east=float, position=3, velocity=3, dcm=(3, 3), increments=6,
    commanded_speed=float, target_speed=float, largest_speed_change=float, target_heading=float, largest_yaw_rate=float,
    target_depth=float, largest_path_angle=float,
    segment_time=float, segment_heading=float, segment_sign=float, segment_north=float, segment_east=float,
    body_rate=3, north_error=float, east_error=float, roll=float, pitch=float,
    cos_heading=float, sin_heading=float, cos_path=float, sin_path=float, water_north=float, water_east=float,
    heading_error=float, to_track=float, turned=float, oscillations=length(OSCILLATIONS), hull=length(SAIL),
)  # fmt: skip
#: The integer state of a vessel: sample, manoeuvre, waypoint, and 1 if the manoeuvre has begun.
PROGRESS = structure(sample=int, segment=int, waypoint=int, begun=int)
#: Constants of a vessel and its water. Step and time constants [s]; largest yaw rate [rad/s]; heel in a turn; 1 if it
#: dives; mean current [m/s]; decrease of current and waves with depth [1/m]; largest advance of the phase of a wave at
#: once [rad]; the oscillators (`simnav.world.seaway.OSCILLATORS`), zero if there are none; 1 if there is a hull with
#: three degrees of freedom, and its numbers (`simnav.world.manoeuvring.dynamics.HULL`).
PARAMETERS = structure(
    step=float, speed_time=float, turn_time=float, climb_time=float, turn_rate=float, heel=float, dives=int,
    current_north=float, current_east=float, shear=float, attenuation=float, longest_phase=float,
    oscillators=length(OSCILLATORS), has_hull=int, hull=length(HULL),
)  # fmt: skip
#: What a world consists of: numbers of manoeuvres, points, waves and eddies.
SIZES = structure(manoeuvres=int, points=int, waves=int, eddies=int)
#: Length of the array that holds a block of the motion.
_WORK = length(MOTION)


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
def _waypoint(points: Array, j: int, relative: int, x: Any) -> tuple[float, float]:
    """Waypoint j as distances north and east of the start of the run [m]."""
    a, b = points[j, 0], points[j, 1]
    if relative:
        c, s = cos(x.segment_heading), sin(x.segment_heading)
        return x.segment_north + c * a - s * b, x.segment_east + s * a + c * b
    return a, b


@helper(borrows=True)
def _guide(x: Any, index: Any, p: Any, rows: Array, points: Array, time: float) -> float:
    """Execute the manoeuvre table: store the references in the state, and return the commanded yaw rate [rad/s]."""
    psi = x.heading + x.heading_error - x.to_track
    # The heading at which the vessel would stop turning if the commanded rate became zero now.
    rest = psi + 2.0 * p.turn_time * x.yaw_rate + p.turn_time**2 * x.yaw_rate_change
    direct = inf  # a rate that is commanded directly, without the heading loop
    for _ in range(rows.shape[0] + 1):
        i = index.segment
        if i >= rows.shape[0]:
            break
        own = rows[i].view(MANOEUVRE)[0]
        kind = own.kind
        if index.begun == 0:
            index.begun = 1
            x.segment_time = time
            x.segment_heading = x.target_heading
            x.largest_yaw_rate = p.turn_rate
            if kind == ACCELERATE:
                x.target_speed, x.largest_speed_change = own.speed, own.acceleration
            elif kind == TURN:
                x.segment_sign = 1.0 if own.angle > 0.0 else -1.0
                if abs(own.angle) < inf:
                    x.target_heading += own.angle
            elif kind == ZIGZAG:
                x.segment_sign = 1.0
            elif kind == WAYPOINTS:
                index.waypoint = own.first_point
                x.segment_north, x.segment_east = x.north, x.east
            elif kind == DEPTH:
                x.target_depth, x.largest_path_angle = own.depth, own.angle
        done = time - x.segment_time >= own.duration - 1e-9
        if kind == HOLD:
            pass
        elif kind == ACCELERATE:
            reached = abs(x.speed - own.speed) < 0.01 * max(1.0, own.speed) and abs(x.speed_change) < 1e-3
            done = done or (own.duration == inf and reached)
        elif kind == TURN:
            rate = own.rate
            if own.radius > 0.0:
                rate = x.speed / own.radius
            if rate <= 0.0:
                rate = p.turn_rate
            x.largest_yaw_rate = rate
            if abs(own.angle) < inf:
                done = done or (abs(x.target_heading - psi) < 0.005 and abs(x.yaw_rate) < 5e-4)
            elif done:
                x.target_heading = rest
            else:
                extra = (x.to_track - x.heading_error - x.turned) / (2.0 * p.turn_time)
                extra = min(max(extra, -p.turn_rate), p.turn_rate)
                x.turned += extra * p.step
                direct = x.segment_sign * rate + extra
        elif kind == ZIGZAG:
            rate = own.rate if own.rate > 0.0 else p.turn_rate
            if x.segment_sign * (psi - x.segment_heading) >= own.angle:
                x.segment_sign = -x.segment_sign
            if not done:
                extra = (x.to_track - x.heading_error - x.turned) / (2.0 * p.turn_time)
                extra = min(max(extra, -p.turn_rate), p.turn_rate)
                x.turned += extra * p.step
                direct = x.segment_sign * rate + extra
        elif kind == WAYPOINTS:
            # The vessel is steered by its estimated position.
            north, east = x.north + x.north_error, x.east + x.east_error
            while index.waypoint < own.end_point:
                j = index.waypoint
                a, b = _waypoint(points, j, own.relative, x)
                from_a, from_b = x.segment_north, x.segment_east
                if j > own.first_point:
                    from_a, from_b = _waypoint(points, j - 1, own.relative, x)
                # Reached within the radius, or when it is abeam: otherwise the vessel might circle a point for ever.
                passed = (north - a) * (a - from_a) + (east - b) * (b - from_b) > 0.0
                if (a - north) ** 2 + (b - east) ** 2 > own.radius**2 and not passed:
                    # The vessel steers for the waypoint itself: there is no correction back to a track.
                    x.target_heading = psi + wrapped(atan2(b - east, a - north) - x.to_track - psi)
                    break
                index.waypoint += 1
            done = index.waypoint >= own.end_point
        elif kind == DEPTH:
            done = done or (abs(x.depth - own.depth) < 0.5 and abs(x.path_angle) < 0.02)
        if not done:
            break
        index.segment += 1
        index.begun = 0
        direct = inf
    if direct < inf:
        return direct
    x.turned = x.to_track - x.heading_error
    # Control of the heading at rest makes the loop a simple exponential: its derivative is the commanded rate itself.
    wanted = (x.target_heading - rest) / (2.0 * p.turn_time)
    rate_command: float = min(max(wanted, -x.largest_yaw_rate), x.largest_yaw_rate)
    return rate_command


@helper(borrows=True)
def _compose(course: Course, water: tuple[float, float], yaw_answer: float, p: Any, waves: Responses) -> Composed:
    """Velocity, roll, pitch, and cosine and sine of the heading of the bow, with current and waves added."""
    u, cp, sp, cg = course.speed, course.cos_heading, course.sin_heading, course.cos_path
    depth, sway = course.depth, course.sway
    shade, flow = 1.0, 1.0
    # The bow yaws about the course that the vessel keeps.
    ch, sh = cp, sp
    if depth > 0.0:
        shade = exp(-p.attenuation * depth)
        flow = max(0.0, 1.0 - p.shear * depth)
    if p.oscillators.view(OSCILLATORS)[0].heave[0] > 0.0:
        yaw = course.heading + shade * yaw_answer
        ch, sh = cos(yaw), sin(yaw)
    v0 = u * cg * cp + flow * water[0] + shade * waves.north
    v1 = u * cg * sp + flow * water[1] + shade * waves.east
    v2 = -u * course.sin_path + shade * waves.down
    roll = shade * (waves.roll_north * sp - waves.roll_east * cp) - p.heel * u * course.yaw_rate * (1.0 / 9.81)
    pitch = course.path + shade * (waves.pitch_north * cp + waves.pitch_east * sp)
    if p.has_hull:
        v0, v1 = v0 - sway * sp, v1 + sway * cp
    return Composed((v0, v1, v2), roll, pitch, ch, sh)


@helper(borrows=True)
def _course(x: Any) -> Course:
    """The course of a state."""
    return Course(
        speed=x.speed,
        yaw_rate=x.yaw_rate,
        heading=x.heading,
        cos_heading=x.cos_heading,
        sin_heading=x.sin_heading,
        path=x.path_angle,
        cos_path=x.cos_path,
        sin_path=x.sin_path,
        depth=x.depth,
        sway=x.hull.view(SAIL)[0].sway,
    )


@helper(borrows=True)
def _through_water(p: Any, course: Course) -> tuple[float, float]:
    """Velocity through the water, north and east [m/s], without the waves."""
    ahead = course.speed * course.cos_path
    north, east = ahead * course.cos_heading, ahead * course.sin_heading
    if p.has_hull:
        north -= course.sway * course.sin_heading
        east += course.sway * course.cos_heading
    return north, east


@helper(borrows=True)
def _water(x: Any, p: Any, eddies: Array, time: float) -> None:
    """Store the velocity of the surface water at the vessel's position in the state."""
    north, east = p.current_north, p.current_east
    for i in range(eddies.shape[0]):
        eddy = eddies[i].view(EDDY)[0]
        c = cos(eddy.wave_north * x.north + eddy.wave_east * x.east - eddy.frequency * time + eddy.phase)
        north += eddy.north * c
        east += eddy.east * c
    x.water_north, x.water_east = north, east


@helper(borrows=True)
def _sail(x: Any, p: Any, rate_command: float, time: float, decay: tuple[float, float]) -> None:
    """Advance speed, sway, yaw rate and heading of a hull with three degrees of freedom by one sample."""
    dt, h = p.step, x.hull.view(SAIL)[0]
    h.speed, h.speed_change = _lag(h.speed, h.speed_change, x.commanded_speed, dt, p.speed_time, decay[0])
    h.yaw_rate, h.yaw_rate_change = _lag(h.yaw_rate, h.yaw_rate_change, rate_command, dt, p.turn_time, decay[1])
    flow = max(0.0, 1.0 - p.shear * max(0.0, x.depth))
    water = flow * x.water_north, flow * x.water_east
    at = sail(p.hull.view(HULL)[0], h, (x.speed, x.yaw_rate, x.heading), (p.speed_time, p.turn_time), water, time, dt)
    x.speed, x.speed_change, x.heading = at.surge, at.surge_change, at.heading
    x.yaw_rate, x.yaw_rate_change = at.yaw_rate, at.yaw_rate_change


@kernel
def initialise(state: Vector, parameters: Vector, phase: Matrix, table: Matrix, eddies: Matrix) -> None:
    """Complete the state at time 0: velocity and attitude with the waves and the current of that time.

    ``state`` is a `STATE`, ``parameters`` are `PARAMETERS`. The other arguments are those of `advance`, of one world.
    """
    x, p = state.view(STATE)[0], parameters.view(PARAMETERS)[0]
    _water(x, p, eddies, 0.0)
    x.cos_heading, x.sin_heading = cos(x.heading), sin(x.heading)
    x.cos_path, x.sin_path = cos(x.path_angle), sin(x.path_angle)
    course = _course(x)
    north, east = _through_water(p, course)
    w = wave_responses(phase, table, north, east, 0.0, 0.0)
    swell, own = x.oscillations.view(OSCILLATIONS)[0], p.oscillators.view(OSCILLATORS)[0]
    if own.heave[0] > 0.0:
        by = transitions(own, 0.0)
        w = answers(swell, own, w, course.cos_heading, course.sin_heading, phase, table, 0.0, by)
    now = _compose(course, (x.water_north, x.water_east), swell.yaw[0], p, w)
    x.velocity[0], x.velocity[1], x.velocity[2] = now.velocity
    cr, sr = cosine_sine(now.roll)
    ct, st = cosine_sine(now.pitch)
    c = matrix(cr, sr, ct, st, now.cos_bow, now.sin_bow)
    dcm = x.dcm
    dcm[0, 0], dcm[0, 1], dcm[0, 2] = c.c00, c.c01, c.c02
    dcm[1, 0], dcm[1, 1], dcm[1, 2] = c.c10, c.c11, c.c12
    dcm[2, 0], dcm[2, 1], dcm[2, 2] = c.c20, c.c21, c.c22
    x.roll, x.pitch = now.roll, now.pitch


@helper(borrows=True)
def _steer(x: Any, index: Any, p: Any, plan: tuple[Array, Array], block: Any, first: int, last: int) -> None:
    """Guidance and the dynamics of the vessel in intervals of a block: store the course at their ends.

    ``first`` and ``last`` are the number of the first interval, and that after the last one. The other arguments are
    those of `advance`.
    """
    rows, points = plan
    dt = p.step
    decay_u, decay_r, decay_g = exp(-dt / p.speed_time), exp(-dt / p.turn_time), exp(-dt / p.climb_time)
    psi = x.heading
    for k in range(first, last):
        t0 = index.sample * dt
        index.sample += 1
        rate_command = _guide(x, index, p, rows, points, t0)
        step = x.largest_speed_change * dt
        x.commanded_speed = min(max(x.target_speed, x.commanded_speed - step), x.commanded_speed + step)
        if p.has_hull:
            _sail(x, p, rate_command, t0, (decay_u, decay_r))
        else:
            x.speed, x.speed_change = _lag(x.speed, x.speed_change, x.commanded_speed, dt, p.speed_time, decay_u)
            r, dr = x.yaw_rate, x.yaw_rate_change
            x.yaw_rate, x.yaw_rate_change = _lag(r, dr, rate_command, dt, p.turn_time, decay_r)
            # Hermite's rule: of fourth order, and as smooth as the rate
            x.heading += 0.5 * dt * (r + x.yaw_rate) + dt * dt / 12.0 * (dr - x.yaw_rate_change)
        if p.dives:
            climb = (x.depth - x.target_depth) / (max(x.speed, 0.3) * 5.0 * p.climb_time)
            climb = min(max(climb, -x.largest_path_angle), x.largest_path_angle)
            sink = -x.speed * x.sin_path
            x.path_angle, x.path_rate = _lag(x.path_angle, x.path_rate, climb, dt, p.climb_time, decay_g)
            x.cos_path, x.sin_path = cos(x.path_angle), sin(x.path_angle)
            x.depth += 0.5 * dt * (sink - x.speed * x.sin_path)
        if x.heading != psi:
            psi = x.heading
            x.cos_heading, x.sin_heading = cos(psi), sin(psi)
        put_course(block, k, _course(x))


@helper(borrows=True)
def _drift(
    x: Any,
    time: int,
    p: Any,
    water: tuple[Array, Array, Array],
    by: Transitions,
    block: Any,
    first: int,
    last: int,
) -> None:
    """Add waves and current to the course in intervals of a block: velocity, roll and pitch at their ends.

    ``time`` is the number of the sample at the start of the block, ``by`` moves the oscillators by a step. The other
    arguments are those of `_steer` and `advance`.
    """
    phase, table, eddies = water
    dt = p.step
    swell, own = x.oscillations.view(OSCILLATIONS)[0], p.oscillators.view(OSCILLATORS)[0]
    for k in range(first, last):
        course = course_at(block, k)
        # The encounter frequency is that of the speed through the water.
        north, east = _through_water(p, course)
        waves = wave_responses(phase, table, north, east, dt, p.longest_phase)
        if own.heave[0] > 0.0:
            waves = answers(swell, own, waves, course.cos_heading, course.sin_heading, phase, table, dt, by)
        _water(x, p, eddies, (time + k + 1) * dt)
        now = _compose(course, (x.water_north, x.water_east), swell.yaw[0], p, waves)
        v = now.velocity
        put_three(block.velocity, k + 1, v)
        block.roll[k + 1], block.pitch[k + 1] = now.roll, now.pitch
        block.cos_bow[k], block.sin_bow[k] = now.cos_bow, now.sin_bow
        block.flow[0, k], block.flow[1, k] = x.water_north, x.water_east
        x.north += 0.5 * dt * (block.velocity[0, k] + v[0])
        x.east += 0.5 * dt * (block.velocity[1, k] + v[1])


@helper(borrows=True)
def _advance_one(
    x: Any,
    index: Any,
    p: Any,
    plan: tuple[Array, Array],
    water: tuple[Array, Array, Array],
    tap_time: Array,
    taps: Array,
    imu: tuple[Array, Array],
    work: Array,
) -> None:
    """Advance one world by as many samples as ``imu`` has room for.

    ``work`` (n,) is room for a `MOTION`. The other arguments are those of `advance`.
    """
    rate, force = imu
    block = work.view(MOTION)[0]
    dt, tap = p.step, 0
    position, velocity, dcm, turning = x.position, x.velocity, x.dcm, x.body_rate
    by = transitions(p.oscillators.view(OSCILLATORS)[0], dt)
    # Guidance is ahead of the waves, unless waypoints or eddies make it depend on the position.
    ahead = water[2].shape[0] == 0
    for i in range(plan[0].shape[0]):
        ahead = ahead and plan[0][i].view(MANOEUVRE)[0].kind != WAYPOINTS
    for k in range(BLOCK):
        block.interval[k] = dt
    for start in range(0, rate.shape[0], BLOCK):
        n = min(BLOCK, rate.shape[0] - start)
        first = index.sample
        for i in range(3):
            block.velocity[i, 0], block.position[i, 0] = velocity[i], position[i]
            for j in range(3):
                block.dcm[i, j, 0] = dcm[i, j]
        block.roll[0], block.pitch[0] = x.roll, x.pitch
        for k in range(0, n, n if ahead else 1):
            upto = n if ahead else k + 1
            _steer(x, index, p, plan, block, k, upto)
            _drift(x, first, p, water, by, block, k, upto)
        orient(block, n)
        ideal_samples(block, n, x.increments, rate[start : start + n], force[start : start + n])
        # Taps between the states at both ends of an interval
        k, last = 0, rate.shape[0] - 1
        while tap < tap_time.size:
            while k < n and not (tap_time[tap] <= (first + k + 1) * dt or start + k == last):
                k += 1
            if k == n:
                break
            before = turning[0], turning[1], turning[2]
            if k > 0:
                before = body_rate(block, k - 1, rate[start + k - 1])
            rates = before, body_rate(block, k, rate[start + k])
            share = min((tap_time[tap] - (first + k) * dt) / dt, 1.0)
            tap_at(taps[tap].view(TRUE_STATE)[0], share, block, k, rates, p.shear)
            tap += 1
        turning[0], turning[1], turning[2] = body_rate(block, n - 1, rate[start + n - 1])
        for i in range(3):
            velocity[i], position[i] = block.velocity[i, n], block.position[i, n]
            for j in range(3):
                dcm[i, j] = block.dcm[i, j, n]
        x.roll, x.pitch = block.roll[n], block.pitch[n]


class RequestedStates(NamedTuple):
    """The times at which the states of w worlds are required.

    Attributes
    ----------
    time : (w, k) array
        The times, ascending [s].
    first, last : (w,) int array
        Index of the first of these times within the block, and index after the last one.
    states : (w, m, 15) array
        Overwritten with the states at these times, each a `simnav.true_state.TRUE_STATE`.
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
    state : (w, n) and (w, 4) int arrays
        A `STATE` and a `PROGRESS` of each world; both are updated.
    p : (w, m) array
        The `PARAMETERS` of each world.
    sizes : (w, 4) int array
        The `SIZES` of each world.
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
    work = np.empty(_WORK)
    for w in range(active.size):
        if not active[w]:
            continue
        size = sizes[w].view(SIZES)[0]
        r, q, c, e = size.manoeuvres, size.points, size.waves, size.eddies
        n, m = samples[w], last[w] - first[w]
        _advance_one(
            x[w].view(STATE)[0], index[w].view(PROGRESS)[0], p[w].view(PARAMETERS)[0],
            (rows[w, : ROW * r].reshape((r, ROW)), points[w, : 2 * q].reshape((q, 2))),
            (
                phase[w, : PHASES * c].reshape((PHASES, c)), table[w, : ROWS * c].reshape((ROWS, c)),
                eddies[w, : EDDY_NUMBERS * e].reshape((e, EDDY_NUMBERS)),
            ),
            requested.time[w, first[w] : last[w]], requested.states[w, :m], (rate[w, :n], force[w, :n]), work,
        )  # fmt: skip


@kernel
def command(active: FlagVector, x: Matrix, wrong: Vector, heading: Vector, speed: Vector) -> None:
    """Command heading and speed of w worlds without manoeuvres.

    Parameters
    ----------
    active : (w,) bool array
        True for each world that gets a command.
    x : (w, n) array
        A `STATE` of each world; updated.
    wrong : (w,) array
        Error of the estimated heading by which the vessel is steered [rad]; NaN: as before.
    heading, speed : (w,) array
        Commanded heading, in terms of the estimated one [rad], and commanded speed through the water [m/s].
    """
    for w in range(active.size):
        if active[w]:
            vessel = x[w].view(STATE)[0]
            if wrong[w] == wrong[w]:
                vessel.heading_error = wrong[w]
            estimated = vessel.heading + vessel.heading_error
            vessel.target_heading = estimated + wrap_scalar(heading[w] - estimated)
            vessel.target_speed = max(speed[w], 0.0)
