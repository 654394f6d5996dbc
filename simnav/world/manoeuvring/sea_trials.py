"""Sea trials of a hull: the turning circle and the zigzag, as for a ship before its delivery.

Source: International Maritime Organization, *Standards for ship manoeuvrability*, resolution MSC.137(76), 2002.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.types import Array
from simnav.world.manoeuvring.dynamics import trial
from simnav.world.manoeuvring.hull import Hull

__all__ = ["TurningCircle", "Zigzag", "turning_circle", "zigzag"]


@dataclass(frozen=True, eq=False)
class TurningCircle:
    """A turn with constant propeller rate and steering.

    Attributes
    ----------
    advance, transfer : float
        Distance along and across the first course until the heading has changed by 90 degrees [m].
    tactical_diameter : float
        Distance across the first course at a change of 180 degrees [m].
    speed, turn_rate, drift : float
        In the steady turn: speed [m/s], yaw rate [rad/s], and drift angle [rad], positive where the bow points into
        the turn.
    diameter : float
        Diameter of the steady turn [m].
    track : (n, 3) array
        North and east of the start [m], heading [rad].
    states : (n, 6) array
        States of `simnav.world.manoeuvring.dynamics.trial`.
    """

    advance: float
    transfer: float
    tactical_diameter: float
    speed: float
    turn_rate: float
    drift: float
    diameter: float
    track: Array
    states: Array


@dataclass(frozen=True, eq=False)
class Zigzag:
    """The steering is reversed whenever the heading has changed by the angle.

    Attributes
    ----------
    overshoots : (k,) array
        How far the heading goes beyond the angle after each reversal [rad].
    reversals : (k + 1,) array
        Times at which the steering was reversed, after its first use [s].
    heading : (n,) array
        [rad], at the time step of the trial.
    """

    overshoots: Array
    reversals: Array
    heading: Array


def _start(hull: Hull, speed: float) -> Array:
    return np.array([speed, 0.0, 0.0, 0.0, hull.propeller(speed), 0.0])


def _track(states: Array, dt: float) -> Array:
    u, v, psi = states[:, 0], states[:, 1], states[:, 3]
    velocity = np.stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)], axis=1)
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(0.5 * dt * (velocity[1:] + velocity[:-1]), axis=0)])
    return np.column_stack([place, psi])


def turning_circle(hull: Hull, speed: float, steering: float, *, duration: float, dt: float = 0.02) -> TurningCircle:
    """Turn at a constant propeller rate and steering, from a straight course north.

    Parameters
    ----------
    hull : Hull
        The hull.
    speed : float
        Speed before the turn [m/s].
    steering : float
        Steering: an angle [rad] or a share of the largest moment; positive to starboard.
    duration : float
        Length of the trial [s]; the last tenth is taken for the steady turn.
    dt : float
        Time step [s].

    Raises
    ------
    ValueError
        If the vessel does not turn by 180 degrees within the duration.
    """
    n = round(duration / dt)
    states = np.empty((n + 1, 6))
    states[0] = _start(hull, speed)
    trial(hull.vector, states, np.tile([states[0, 4], steering], (n, 1)), dt, np.zeros(2))
    track = _track(states, dt)
    turned = np.abs(states[:, 3])
    if turned.max() < np.pi:
        raise ValueError(
            f"the vessel turned by {np.degrees(turned.max()):.0f} degrees in {duration:g} s; 180 are wanted"
        )
    quarter, half = (int(np.argmax(turned >= angle)) for angle in (0.5 * np.pi, np.pi))
    u, v, r = states[-max(1, n // 10) :, :3].mean(axis=0)
    total = float(np.hypot(u, v))
    sign = np.sign(steering)
    return TurningCircle(
        float(track[quarter, 0]), float(sign * track[quarter, 1]), float(sign * track[half, 1]), total, float(r),
        float(-sign * np.arctan2(v, u)), float(2.0 * total / abs(r)), track, states,
    )  # fmt: skip


def zigzag(hull: Hull, speed: float, angle: float, steering: float, *, duration: float, dt: float = 0.02) -> Zigzag:
    """Zigzag at a constant propeller rate.

    Parameters
    ----------
    hull, speed, duration, dt
        See `turning_circle`.
    angle : float
        Change of heading at which the steering is reversed [rad].
    steering : float
        Steering to each side, positive.
    """
    n, h = round(duration / dt), hull.vector
    states = np.empty((n + 1, 6))
    states[0] = _start(hull, speed)
    side, extreme = 1.0, 0.0
    reversals: list[float] = []
    overshoots: list[float] = []
    for k in range(n):
        if side * states[k, 3] >= angle:
            if reversals:
                overshoots.append(extreme - angle)
            side, extreme = -side, 0.0
            reversals.append(k * dt)
        if reversals:
            extreme = max(extreme, -side * states[k, 3])
        trial(h, states[k : k + 2], np.array([[states[0, 4], side * steering]]), dt, np.zeros(2))
    return Zigzag(np.array(overshoots), np.array(reversals), states[:, 3])
