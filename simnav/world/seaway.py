"""The motion of a vessel in waves, one sample after the other: phases of the components, and what they cause.

See `simnav.world.sea` for the model and for the arrays of components. `simnav.world.motion` calls these kernels.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

from simnav.compiled import Array, helper
from simnav.declared_process import Oscillation, oscillation
from simnav.structures import structure
from simnav.world.sea import Components, Phases

__all__ = ["OSCILLATIONS", "OSCILLATORS", "Responses", "Transitions", "answers", "transitions", "wave_responses"]

#: Natural angular frequency [rad/s] and damping ratio of each oscillator; zeros if there are none.
OSCILLATORS = structure(heave=2, roll=2, pitch=2, yaw=2)
#: Value, rate and force of each: heave velocity [m/s], angles [rad].
OSCILLATIONS = structure(heave=3, roll=3, pitch=3, yaw=3)


@helper(borrows=True)
def components_of(table: Array) -> Components:
    """The rows of a table by name."""
    return Components(
        table[0], table[1], table[2], table[3], table[4], table[5], table[6], table[7], table[8], table[9], table[10],
        table[11], table[12], table[13], table[14], table[15], table[16], table[17], table[18],
    )  # fmt: skip


@helper(borrows=True)
def phases_of(phase: Array) -> Phases:
    """The rows of the (3, n) phases by name."""
    return Phases(phase[0], phase[1], phase[2])


class Responses(NamedTuple):
    """What waves cause at the surface.

    Attributes
    ----------
    north, east, down : float
        Velocity [m/s].
    roll_north, roll_east, pitch_north, pitch_east : float
        Slopes that roll and pitch follow from, by the direction of the bow [rad].
    """

    north: float
    east: float
    down: float
    roll_north: float
    roll_east: float
    pitch_north: float
    pitch_east: float


class Transitions(NamedTuple):
    """The transition matrices of the oscillators of a vessel."""

    heave: Oscillation
    roll: Oscillation
    pitch: Oscillation
    yaw: Oscillation


_UNCHANGED = Oscillation(1.0, 0.0, 0.0, 1.0)
_STILL = Transitions(_UNCHANGED, _UNCHANGED, _UNCHANGED, _UNCHANGED)


@helper(borrows=True)
def _parts(table: Array, north: float, east: float, dt: float, longest: float) -> int:
    """Number of parts of a step in which no phase advances by more than ``longest``. The last component is fastest."""
    last = table.shape[1] - 1
    if longest == 0.0 or last < 0:
        return 1
    w = components_of(table)
    number = sqrt(w.wave_north[last] * w.wave_north[last] + w.wave_east[last] * w.wave_east[last])
    fastest = w.frequency[last] + number * sqrt(north * north + east * east)
    return 1 + int(fastest * dt / longest)


@helper(borrows=True, fastmath={"reassoc", "contract", "nsz", "arcp"})
def wave_responses(phase: Array, table: Array, north: float, east: float, dt: float, longest: float) -> Responses:
    """Advance the phases of the wave components by one step, and sum the seven responses.

    ``north`` and ``east`` are the velocity of the vessel through the water [m/s], ``dt`` is the length of the step [s].
    A phase advances by at most ``longest`` at a time [rad]; 0: by the whole step.
    """
    parts = _parts(table, north, east, dt, longest)
    part, w, at = dt / parts, components_of(table), phases_of(phase)
    # Two loops over the components: the second only reads the rows that the first writes. So the compiler can vectorise
    # both without a check at run time whether the rows overlap.
    for _ in range(parts):
        for i in range(phase.shape[1]):
            rate = w.frequency[i] - w.wave_north[i] * north - w.wave_east[i] * east
            d = rate * part
            d2 = d * d
            # The series are exact to rounding up to 0.4 rad.
            sd = d * (1.0 - d2 / 6.0 * (1.0 - d2 / 20.0 * (1.0 - d2 / 42.0 * (1.0 - d2 / 72.0))))
            cd = 1.0 - d2 / 2.0 * (1.0 - d2 / 12.0 * (1.0 - d2 / 30.0 * (1.0 - d2 / 56.0 * (1.0 - d2 / 90.0))))
            c, s = at.cosine[i], at.sine[i]
            at.cosine[i] = c * cd - s * sd
            at.sine[i] = s * cd + c * sd
            at.rate[i] = rate
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = 0.0
    for i in range(phase.shape[1]):
        c, s, rate = at.cosine[i], at.sine[i], at.rate[i]
        s0 += rate * (w.north_sin[i] * c - w.north_cos[i] * s)
        s1 += rate * (w.east_sin[i] * c - w.east_cos[i] * s)
        s2 += rate * (w.down_sin[i] * c - w.down_cos[i] * s)
        s3 += w.roll_north_cos[i] * c + w.roll_north_sin[i] * s
        s4 += w.roll_east_cos[i] * c + w.roll_east_sin[i] * s
        s5 += w.pitch_north_cos[i] * c + w.pitch_north_sin[i] * s
        s6 += w.pitch_east_cos[i] * c + w.pitch_east_sin[i] * s
    return Responses(s0, s1, s2, s3, s4, s5, s6)


@helper(borrows=True)
def transitions(p: Any, dt: float) -> Transitions:
    """Transition matrices of the oscillators over a step.

    Parameters
    ----------
    p : record
        The `OSCILLATORS`.
    dt : float
        Length of the step [s].
    """
    if p.heave[0] == 0.0:
        return _STILL
    return Transitions(
        heave=oscillation(dt, p.heave[0], p.heave[1]),
        roll=oscillation(dt, p.roll[0], p.roll[1]),
        pitch=oscillation(dt, p.pitch[0], p.pitch[1]),
        yaw=oscillation(dt, p.yaw[0], p.yaw[1]),
    )


@helper(borrows=True)
def _oscillate(x: Array, p: Array, force: float, dt: float, transition: Oscillation) -> float:
    """Exact step of an oscillator under a force that is linear within the step. Return its new value.

    With the force a + b t the equation y'' + 2 z w y' + w^2 y = w^2 (a + b t) has the solution a + b t - 2 z b / w, to
    which the free oscillation is added. x are the (3,) states, and p w and z.
    """
    slope = (force - x[2]) / dt if dt > 0.0 else 0.0
    lag = 2.0 * p[1] * slope / p[0]
    y, rate = x[0] - (x[2] - lag), x[1] - slope
    moved = transition.value_by_value * y + transition.value_by_rate * rate + force - lag
    changed = transition.rate_by_value * y + transition.rate_by_rate * rate + slope
    x[0], x[1], x[2] = moved, changed, force
    value: float = x[0]
    return value


@helper(borrows=True)
def answers(
    x: Any, p: Any, waves: Responses, cp: float, sp: float, phase: Array, table: Array, dt: float, by: Transitions
) -> Responses:
    """The responses of the oscillators to the waves at the vessel.

    Parameters
    ----------
    x : record
        The `OSCILLATIONS`; updated.
    p : record
        The `OSCILLATORS`.
    waves : Responses
        Those of `wave_responses`, which drive heave, roll and pitch.
    cp, sp : float
        Cosine and sine of the heading.
    phase, table : (3, n) and (19, n) arrays
        The waves at this time (`simnav.world.sea.components`).
    dt : float
        Length of the step [s].
    by : Transitions
        Of that step.

    Returns
    -------
    Responses
        In the form of ``waves``.
    """
    first = second = 0.0
    waves_of, cosine = components_of(table), phases_of(phase).cosine
    for i in range(phase.shape[1]):
        first += waves_of.yaw_first[i] * cosine[i]
        second += waves_of.yaw_second[i] * cosine[i]
    heave = _oscillate(x.heave, p.heave, waves.down, dt, by.heave)
    roll = _oscillate(x.roll, p.roll, waves.roll_north * sp - waves.roll_east * cp, dt, by.roll)
    pitch = _oscillate(x.pitch, p.pitch, waves.pitch_north * cp + waves.pitch_east * sp, dt, by.pitch)
    _oscillate(x.yaw, p.yaw, first * (cp * cp - sp * sp) - second * 2.0 * cp * sp, dt, by.yaw)
    return Responses(waves.north, waves.east, heave, roll * sp, -roll * cp, pitch * cp, pitch * sp)
