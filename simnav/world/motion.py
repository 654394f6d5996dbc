"""The motion kernel: from commands, vessel dynamics, waves and current to a smooth truth and ideal inertial samples.

For each sample it executes the manoeuvre table (guidance), advances speed, yaw rate and flight-path angle through
critically damped lags, advances the wave components by their encounter phase, composes velocity and attitude, and
computes the sample of ideal instruments by the inverse strapdown equations (`simnav.strapdown.sample_from_motion`). So
truth and samples agree up to rounding.
"""

from __future__ import annotations

from math import atan2, cos, exp, inf, sin

import numpy as np

from simnav.compiled import Array, Flags, Integers, kernel
from simnav.declared_process import oscillation
from simnav.geometry.rotation import wrap_scalar
from simnav.strapdown import sample_from_motion
from simnav.world.manoeuvres import ACCELERATE, COLUMNS, DEPTH, HOLD, TURN, WAYPOINTS, ZIGZAG
from simnav.world.manoeuvring.dynamics import HULL, RATE, RATE_CHANGE, SAIL, SPEED, SPEED_CHANGE, SWAY, sail
from simnav.world.sea import ROWS, YAW

__all__ = [
    "DIVE",
    "HAS_HULL",
    "HULL_NUMBERS",
    "HULL_STATE",
    "PARAMETERS",
    "STATE",
    "TAP_COLUMNS",
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
DT, TAU_U, TAU_R, TAU_G, TURN_RATE, HEEL, DIVES, CURRENT_N, CURRENT_E, SHEAR, ATTENUATION = range(11)
#: Natural angular frequency and damping ratio of these oscillators; zero: there are none.
OSCILLATORS = 11
#: Whether there is a hull with three degrees of freedom, and its numbers.
HAS_HULL, HULL_NUMBERS = 19, 20
PARAMETERS = HULL_NUMBERS + HULL
#: Columns of a tap: position 0:3, velocity 3:6, roll, pitch, yaw 6:9, angular rate 9:12, current north, east 12:14.
TAP_COLUMNS = 14
#: Rows of the phases of waves, and columns of an eddy.
PHASES, EDDY_COLUMNS = 3, 6

#: What waves cause at the surface: velocity north, east, down [m/s]; slopes that roll and pitch follow from [rad].
Responses = tuple[float, float, float, float, float, float, float]
#: Velocity north-east-down [m/s], direction cosine matrix of the body axes by rows, roll and pitch [rad].
Composed = tuple[
    tuple[float, float, float],
    tuple[float, float, float, float, float, float, float, float, float],
    float,
    float,
]


@kernel(fastmath={"reassoc", "contract", "nsz", "arcp"})
def _waves(phase: Array, table: Array, north: float, east: float, dt: float) -> Responses:
    """Advance the phases of the wave components by one step, and sum the seven responses.

    ``north`` and ``east`` are the velocity of the vessel through the water [m/s], ``dt`` is the length of the step [s].
    """
    # Two loops: the second only reads the rows that the first writes. So the compiler can vectorise both without a
    # check at run time whether the rows overlap.
    for i in range(phase.shape[1]):
        rate = table[0, i] - table[1, i] * north - table[2, i] * east
        d = rate * dt
        d2 = d * d
        # Encounter phases advance by less than 0.2 rad a sample; the series are exact to rounding there.
        sd = d * (1.0 - d2 / 6.0 * (1.0 - d2 / 20.0 * (1.0 - d2 / 42.0 * (1.0 - d2 / 72.0))))
        cd = 1.0 - d2 / 2.0 * (1.0 - d2 / 12.0 * (1.0 - d2 / 30.0 * (1.0 - d2 / 56.0 * (1.0 - d2 / 90.0))))
        c, s = phase[0, i], phase[1, i]
        phase[0, i] = c * cd - s * sd
        phase[1, i] = s * cd + c * sd
        phase[2, i] = rate
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = 0.0
    for i in range(phase.shape[1]):
        c, s, rate = phase[0, i], phase[1, i], phase[2, i]
        s0 += rate * (table[4, i] * c - table[3, i] * s)
        s1 += rate * (table[6, i] * c - table[5, i] * s)
        s2 += rate * (table[8, i] * c - table[7, i] * s)
        s3 += table[9, i] * c + table[10, i] * s
        s4 += table[11, i] * c + table[12, i] * s
        s5 += table[13, i] * c + table[14, i] * s
        s6 += table[15, i] * c + table[16, i] * s
    return s0, s1, s2, s3, s4, s5, s6


@kernel()
def _lag(x: float, dx: float, command: float, dt: float, tau: float, decay: float) -> tuple[float, float]:
    """Exact step of a critically damped second-order lag under a constant command.

    ``x`` and ``dx`` are the value and its rate, ``tau`` is the time constant [s], ``dt`` the step [s], and ``decay`` is
    exp(-dt/tau). Returned are the value and its rate at the end of the step.
    """
    y = x - command
    b = dx + y / tau
    return command + (y + b * dt) * decay, (dx - b * dt / tau) * decay


@kernel()
def _wrap(angle: float) -> float:
    wrapped: float = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
    return wrapped


@kernel()
def _waypoint(points: Array, j: int, relative: float, x: Array) -> tuple[float, float]:
    """Waypoint j as distances north and east of the start of the run [m]."""
    a, b = points[j, 0], points[j, 1]
    if relative > 0.0:
        c, s = cos(x[SEGMENT_PSI]), sin(x[SEGMENT_PSI])
        return x[SEGMENT_NORTH] + c * a - s * b, x[SEGMENT_EAST] + s * a + c * b
    return a, b


@kernel()
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
            x[SEGMENT_NORTH], x[SEGMENT_EAST] = x[NORTH], x[EAST]
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
                    x[PSI_REFERENCE] = psi + _wrap(atan2(b - east, a - north) - x[TO_TRACK] - psi)
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


@kernel()
def _cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine. For small angles, as roll and pitch mostly are, by their series, exact to rounding."""
    if abs(angle) > 0.3:
        return cos(angle), sin(angle)
    a = angle * angle
    c = 1.0 - a * (1 / 2 - a * (1 / 24 - a * (1 / 720 - a * (1 / 40320 - a * (1 / 3628800 - a * (1 / 479001600))))))
    s = 1.0 - a * (
        1 / 6 - a * (1 / 120 - a * (1 / 5040 - a * (1 / 362880 - a * (1 / 39916800 - a * (1 / 6227020800)))))
    )
    return c, s * angle


@kernel()
def _compose(x: Array, p: Array, waves: Responses) -> Composed:
    """Velocity, attitude, roll and pitch of the state, with the responses to the waves added."""
    w0, w1, w2, w3, w4, w5, w6 = waves
    cp, sp, cg, sg = x[COS_PSI], x[SIN_PSI], x[COS_GAMMA], x[SIN_GAMMA]
    shade, flow = 1.0, 1.0
    # The bow yaws about the course that the vessel keeps.
    ch, sh = cp, sp
    if x[DEPTH_CALM] > 0.0:
        shade = exp(-p[ATTENUATION] * x[DEPTH_CALM])
        flow = max(0.0, 1.0 - p[SHEAR] * x[DEPTH_CALM])
    if p[OSCILLATORS] > 0.0:
        yaw = x[PSI] + shade * x[YAW_ANSWER]
        ch, sh = cos(yaw), sin(yaw)
    v0 = x[U] * cg * cp + flow * x[WATER_NORTH] + shade * w0
    v1 = x[U] * cg * sp + flow * x[WATER_EAST] + shade * w1
    v2 = -x[U] * sg + shade * w2
    roll = shade * (w3 * sp - w4 * cp) - p[HEEL] * x[U] * x[R] * (1.0 / 9.81)
    pitch = x[GAMMA] + shade * (w5 * cp + w6 * sp)
    cr, sr = _cosine_sine(roll)
    ct, st = _cosine_sine(pitch)
    return (
        (v0, v1, v2),
        (
            ct * ch, sr * st * ch - cr * sh, cr * st * ch + sr * sh,
            ct * sh, sr * st * sh + cr * ch, cr * st * sh - sr * ch,
            -st, sr * ct, cr * ct,
        ),
        roll,
        pitch,
    )  # fmt: skip


@kernel()
def _oscillate(x: Array, p: Array, k: int, force: float, dt: float) -> float:
    """Exact step of oscillator k under a force that is linear within the step. Return its new value.

    With the force a + b t the equation y'' + 2 z w y' + w^2 y = w^2 (a + b t) has the solution a + b t - 2 z b / w, to
    which the free oscillation is added.
    """
    at = ANSWERS + 3 * k
    w, z = p[OSCILLATORS + 2 * k], p[OSCILLATORS + 2 * k + 1]
    slope = (force - x[at + 2]) / dt if dt > 0.0 else 0.0
    lag = 2.0 * z * slope / w
    y, rate = x[at] - (x[at + 2] - lag), x[at + 1] - slope
    a, b, c, d = oscillation(dt, w, z)
    x[at], x[at + 1], x[at + 2] = a * y + b * rate + force - lag, c * y + d * rate + slope, force
    value: float = x[at]
    return value


@kernel()
def _answer(x: Array, p: Array, waves: Responses, phase: Array, table: Array, dt: float) -> Responses:
    """The responses of the oscillators to the waves at the vessel, in the form of `_waves`; yaw stays in the state."""
    w0, w1, w2, w3, w4, w5, w6 = waves
    cp, sp = x[COS_PSI], x[SIN_PSI]
    first = second = 0.0
    for i in range(phase.shape[1]):
        first += table[YAW, i] * phase[0, i]
        second += table[YAW + 1, i] * phase[0, i]
    heave = _oscillate(x, p, 0, w2, dt)
    roll = _oscillate(x, p, 1, w3 * sp - w4 * cp, dt)
    pitch = _oscillate(x, p, 2, w5 * cp + w6 * sp, dt)
    _oscillate(x, p, 3, first * (cp * cp - sp * sp) - second * 2.0 * cp * sp, dt)
    return w0, w1, heave, roll * sp, -roll * cp, pitch * cp, pitch * sp


@kernel()
def _water(x: Array, p: Array, eddies: Array, time: float) -> None:
    """Store the velocity of the surface water at the vessel's position in the state."""
    north, east = p[CURRENT_N], p[CURRENT_E]
    for i in range(eddies.shape[0]):
        c = cos(eddies[i, 0] * x[NORTH] + eddies[i, 1] * x[EAST] - eddies[i, 2] * time + eddies[i, 3])
        north += eddies[i, 4] * c
        east += eddies[i, 5] * c
    x[WATER_NORTH], x[WATER_EAST] = north, east


@kernel()
def _sail(x: Array, p: Array, rate_command: float, time: float, decay: tuple[float, float]) -> None:
    """Advance speed, sway, yaw rate and heading of a hull with three degrees of freedom by one sample."""
    dt, h = p[DT], x[HULL_STATE:STATE]
    h[SPEED], h[SPEED_CHANGE] = _lag(h[SPEED], h[SPEED_CHANGE], x[SPEED_COMMAND], dt, p[TAU_U], decay[0])
    h[RATE], h[RATE_CHANGE] = _lag(h[RATE], h[RATE_CHANGE], rate_command, dt, p[TAU_R], decay[1])
    flow = max(0.0, 1.0 - p[SHEAR] * max(0.0, x[DEPTH_CALM]))
    x[U], x[DU], x[R], x[DR], x[PSI] = sail(
        p[HULL_NUMBERS:PARAMETERS], h, (x[U], x[R], x[PSI]), (p[TAU_U], p[TAU_R]),
        (flow * x[WATER_NORTH], flow * x[WATER_EAST]), time, dt,
    )  # fmt: skip


@kernel()
def _drifted(x: Array, composed: Composed) -> Composed:
    """The same with the sway velocity."""
    v, c, roll, pitch = composed
    sway = x[HULL_STATE + SWAY]
    return (v[0] - sway * x[SIN_PSI], v[1] + sway * x[COS_PSI], v[2]), c, roll, pitch


@kernel("void(f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def initialise(x: Array, p: Array, phase: Array, table: Array, eddies: Array) -> None:
    """Complete the state at time 0: velocity and attitude with the waves and the current of that time."""
    _water(x, p, eddies, 0.0)
    x[COS_PSI], x[SIN_PSI], x[COS_GAMMA], x[SIN_GAMMA] = cos(x[PSI]), sin(x[PSI]), cos(x[GAMMA]), sin(x[GAMMA])
    ahead = x[U] * x[COS_GAMMA]
    w = _waves(phase, table, ahead * x[COS_PSI], ahead * x[SIN_PSI], 0.0)
    if p[OSCILLATORS] > 0.0:
        w = _answer(x, p, w, phase, table, 0.0)
    v, c, roll, pitch = _compose(x, p, w)
    x[V], x[V + 1], x[V + 2] = v
    for i in range(9):
        x[C + i] = c[i]
    x[ROLL], x[PITCH] = roll, pitch


@kernel()
def _advance_one(
    x: Array, index: Integers, p: Array, plan: tuple[Array, Array], water: tuple[Array, Array, Array],
    tap_time: Array, taps: Array, imu: tuple[Array, Array],
) -> None:  # fmt: skip
    """Advance one world by as many samples as ``imu`` has room for. The arguments are those of `advance`."""
    rows, points = plan
    phase, table, eddies = water
    rate, force = imu
    dt = p[DT]
    decay_u, decay_r, decay_g = exp(-dt / p[TAU_U]), exp(-dt / p[TAU_R]), exp(-dt / p[TAU_G])
    memory = x[MEMORY : MEMORY + 6]
    tap = 0
    for k in range(rate.shape[0]):
        t0, t1 = index[0] * dt, (index[0] + 1) * dt
        index[0] += 1
        # Guidance and vessel dynamics
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
        # Waves, with the encounter frequency of the speed through the water
        x[COS_PSI], x[SIN_PSI] = cos(x[PSI]), sin(x[PSI])
        ahead = x[U] * x[COS_GAMMA]
        through_north, through_east = ahead * x[COS_PSI], ahead * x[SIN_PSI]
        if p[HAS_HULL] > 0.0:
            through_north -= x[HULL_STATE + SWAY] * x[SIN_PSI]
            through_east += x[HULL_STATE + SWAY] * x[COS_PSI]
        waves = _waves(phase, table, through_north, through_east, dt)
        if p[OSCILLATORS] > 0.0:
            waves = _answer(x, p, waves, phase, table, dt)
        _water(x, p, eddies, t1)
        composed = _compose(x, p, waves)
        if p[HAS_HULL] > 0.0:
            composed = _drifted(x, composed)
        v, c, roll, pitch = composed
        # Ideal instruments
        u = (x[V], x[V + 1], x[V + 2])
        b = (x[C], x[C + 1], x[C + 2], x[C + 3], x[C + 4], x[C + 5], x[C + 6], x[C + 7], x[C + 8])
        out = sample_from_motion(x[LATITUDE], x[HEIGHT], u, v, b, c, memory, dt)
        rate[k, 0], rate[k, 1], rate[k, 2] = out[0], out[1], out[2]
        force[k, 0], force[k, 1], force[k, 2] = out[3], out[4], out[5]
        # Taps between the old state, still in x, and the new one
        while tap < tap_time.size and (tap_time[tap] <= t1 or k == rate.shape[0] - 1):
            _tap(taps[tap], min((tap_time[tap] - t0) / dt, 1.0), x, p, composed, out)
            tap += 1
        for i in range(3):
            x[BODY_RATE + i] = out[i] - c[i] * out[9] - c[6 + i] * out[10]
        x[LATITUDE] += out[6]
        x[LONGITUDE] += out[7]
        x[HEIGHT] += out[8]
        x[NORTH] += 0.5 * dt * (u[0] + v[0])
        x[EAST] += 0.5 * dt * (u[1] + v[1])
        x[V], x[V + 1], x[V + 2] = v
        for i in range(9):
            x[C + i] = c[i]
        x[ROLL], x[PITCH] = roll, pitch


@kernel(
    "void(b1[::1], Tuple((f8[:, ::1], i8[:, ::1])), f8[:, ::1], i8[:, ::1], UniTuple(f8[:, ::1], 2), "
    "UniTuple(f8[:, ::1], 3), Tuple((f8[:, ::1], i8[::1], i8[::1], f8[:, :, ::1])), "
    "Tuple((i8[::1], f8[:, :, ::1], f8[:, :, ::1])))"
)
def advance(
    active: Flags, state: tuple[Array, Integers], p: Array, sizes: Integers, plan: tuple[Array, Array],
    water: tuple[Array, Array, Array], wanted: tuple[Array, Integers, Integers, Array],
    imu: tuple[Integers, Array, Array],
) -> None:  # fmt: skip
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
    p : (w, 161) array
        Constants of the vessel, the water and the step, at the indices that this module names.
    sizes : (w, 4) int array
        Number of manoeuvres, points, waves and eddies of each world.
    plan : two (w, ...) arrays
        Rows and points of the manoeuvre tables (`simnav.world.manoeuvres.table`), each flattened. A row of the array
        may be longer than its content, like the rows of ``water``.
    water : three (w, ...) arrays
        Phases (updated) and table of the wave components (`simnav.world.sea.components`); the variable part of the
        current (`simnav.world.current.eddies`).
    wanted : (w, ...), (w,) int, (w,) int and (w, ..., 14) arrays
        Ascending times at which the state is required [s]; index of the first of these times within the block, and
        index after the last one; the states at these times, overwritten.
    imu : (w,) int, (w, ..., 3) and (w, ..., 3) arrays
        Number of samples by which each world is advanced; ideal mean angular rate [rad/s] and specific force [m/s^2],
        overwritten.
    """
    x, index = state
    rows, points = plan
    phase, table, eddies = water
    tap_time, first, last, taps = wanted
    samples, rate, force = imu
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
            tap_time[w, first[w] : last[w]], taps[w, :m], (rate[w, :n], force[w, :n]),
        )  # fmt: skip


@kernel()
def _tap(out: Array, a: float, x: Array, p: Array, composed: Composed, sample: tuple[float, ...]) -> None:
    """State at the fraction a of a sample interval: velocity and angles are linear, position is their integral."""
    v, c, roll, pitch = composed
    yaw = atan2(x[C + 3], x[C])
    new_yaw = atan2(c[3], c[0])
    # The fraction of the position change that belongs to a linear velocity
    for i in range(3):
        mean = 0.5 * (x[V + i] + v[i])
        gained = x[V + i] * a + 0.5 * (v[i] - x[V + i]) * a * a
        scale = gained / mean if abs(mean) > 1e-9 else a
        out[i] = x[LATITUDE + i] + sample[6 + i] * (1.0 if a >= 1.0 else scale)
        out[3 + i] = x[V + i] + a * (v[i] - x[V + i])
    out[6] = x[ROLL] + a * (roll - x[ROLL])
    out[7] = x[PITCH] + a * (pitch - x[PITCH])
    out[8] = _wrap(yaw + a * _wrap(new_yaw - yaw))
    # Angular rate at the instant, extrapolated from the means over this interval and the one before
    for i in range(3):
        now = sample[i] - c[i] * sample[9] - c[6 + i] * sample[10]
        out[9 + i] = now + (a - 0.5) * (now - x[BODY_RATE + i])
    flow = max(0.0, 1.0 - p[SHEAR] * max(0.0, x[DEPTH_CALM]))
    out[12] = flow * x[WATER_NORTH]
    out[13] = flow * x[WATER_EAST]


@kernel("void(b1[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1])")
def command(active: Flags, x: Array, wrong: Array, heading: Array, speed: Array) -> None:
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
