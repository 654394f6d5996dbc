"""The motion in a block of samples: the rows that `simnav.world.motion` stores, and what only follows from them.

A block is a record of `simnav.inverse_strapdown.ideal_samples` with more rows. What follows from them is the attitude,
in a loop of vector instructions, and the states between the samples that somebody asked for (taps).
"""

from __future__ import annotations

from math import atan2, cos, sin
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import Array, helper
from simnav.inverse_strapdown import SmallMatrix, matrix_at, put_matrix, samples_structure
from simnav.strapdown import Triple

__all__ = [
    "MOTION",
    "Course",
    "body_rate",
    "cosine_sine",
    "course_at",
    "matrix",
    "orient",
    "put_course",
    "tap_at",
    "wrapped",
]

#: A block of the motion. At each end of an interval: roll and pitch. At its later end: cosine and sine of the heading
#: of the bow; the course (`Course`); the current at the surface, north and east.
MOTION = samples_structure(
    roll=1, pitch=1, cos_bow=1, sin_bow=1, speed=1, yaw_rate=1, heading=1, cos_heading=1, sin_heading=1,
    path=1, cos_path=1, sin_path=1, depth=1, sway=1, flow=2,
)  # fmt: skip


class Course(NamedTuple):
    """The motion without waves and current.

    Attributes
    ----------
    speed, yaw_rate : float
        Surge velocity through the water [m/s], and [rad/s].
    heading, cos_heading, sin_heading : float
        [rad], and its cosine and sine.
    path, cos_path, sin_path : float
        Flight-path angle [rad], and its cosine and sine.
    depth : float
        [m].
    sway : float
        Sway velocity [m/s].
    """

    speed: float
    yaw_rate: float
    heading: float
    cos_heading: float
    sin_heading: float
    path: float
    cos_path: float
    sin_path: float
    depth: float
    sway: float


@helper(borrows=True)
def course_at(block: Any, k: int) -> Course:
    """The course at the end of interval k."""
    return Course(
        speed=block.speed[k],
        yaw_rate=block.yaw_rate[k],
        heading=block.heading[k],
        cos_heading=block.cos_heading[k],
        sin_heading=block.sin_heading[k],
        path=block.path[k],
        cos_path=block.cos_path[k],
        sin_path=block.sin_path[k],
        depth=block.depth[k],
        sway=block.sway[k],
    )


@helper(borrows=True)
def put_course(block: Any, k: int, course: Course) -> None:
    """Store the course at the end of interval k."""
    block.speed[k], block.yaw_rate[k], block.heading[k] = course.speed, course.yaw_rate, course.heading
    block.cos_heading[k], block.sin_heading[k] = course.cos_heading, course.sin_heading
    block.path[k], block.cos_path[k], block.sin_path[k] = course.path, course.cos_path, course.sin_path
    block.depth[k], block.sway[k] = course.depth, course.sway


@helper(borrows=True)
def wrapped(angle: float) -> float:
    """The angle in [-pi, pi)."""
    angle = angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))
    return angle


@helper(borrows=True)
def _small_cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine by their series, exact to rounding up to 0.3 rad."""
    a = angle * angle
    c = 1.0 - a * (1 / 2 - a * (1 / 24 - a * (1 / 720 - a * (1 / 40320 - a * (1 / 3628800 - a * (1 / 479001600))))))
    s = 1.0 - a * (
        1 / 6 - a * (1 / 120 - a * (1 / 5040 - a * (1 / 362880 - a * (1 / 39916800 - a * (1 / 6227020800)))))
    )
    return c, s * angle


@helper(borrows=True)
def cosine_sine(angle: float) -> tuple[float, float]:
    """Cosine and sine. For small angles, as roll and pitch mostly are, by their series."""
    if abs(angle) > 0.3:
        return cos(angle), sin(angle)
    return _small_cosine_sine(angle)


@helper(borrows=True)
def matrix(cr: float, sr: float, ct: float, st: float, ch: float, sh: float) -> SmallMatrix:
    """Direction cosine matrix of the body axes by rows, from cosines and sines of roll, pitch and heading."""
    return SmallMatrix(
        ct * ch, sr * st * ch - cr * sh, cr * st * ch + sr * sh,
        ct * sh, sr * st * sh + cr * ch, cr * st * sh - sr * ch,
        -st, sr * ct, cr * ct,
    )  # fmt: skip


@helper(borrows=True)
def orient(block: Any, n: int) -> None:
    """The direction cosine matrices at the ends of n intervals."""
    roll, pitch, dcm, large = block.roll[1:], block.pitch[1:], block.dcm[:, :, 1:], 0
    m = np.uint64(n)  # as in `simnav.inverse_strapdown`
    for k in range(m):
        cr, sr = _small_cosine_sine(roll[k])
        ct, st = _small_cosine_sine(pitch[k])
        put_matrix(dcm, k, matrix(cr, sr, ct, st, block.cos_bow[k], block.sin_bow[k]))
        large += (abs(roll[k]) > 0.3) | (abs(pitch[k]) > 0.3)
    if large > 0:
        for k in range(m):
            cr, sr = cosine_sine(roll[k])
            ct, st = cosine_sine(pitch[k])
            put_matrix(dcm, k, matrix(cr, sr, ct, st, block.cos_bow[k], block.sin_bow[k]))


@helper(borrows=True)
def body_rate(block: Any, k: int, rate: Array) -> Triple:
    """Mean angular rate of the body relative to north-east-down over interval k, body axes [rad/s]."""
    e0, e2, c = block.earth_north[k], block.earth_down[k], matrix_at(block.dcm, k + 1)
    return (
        rate[0] - c.c00 * e0 - c.c20 * e2,
        rate[1] - c.c01 * e0 - c.c21 * e2,
        rate[2] - c.c02 * e0 - c.c22 * e2,
    )


@helper(borrows=True)
def tap_at(out: Any, a: float, block: Any, k: int, turning: tuple[Triple, Triple], shear: float) -> None:
    """State at the fraction a of sample interval k: velocity and angles are linear, position is their integral.

    ``out`` is a `simnav.true_state.TRUE_STATE`. ``turning`` is the angular rate over the interval before and over this
    one.
    """
    before, now = turning
    dt, velocity, dcm = block.interval[k], block.velocity, block.dcm
    yaw = atan2(dcm[1, 0, k], dcm[0, 0, k])
    new_yaw = atan2(dcm[1, 0, k + 1], dcm[0, 0, k + 1])
    # The fraction of the position change that belongs to a linear velocity
    for i in range(3):
        v, w = velocity[i, k], velocity[i, k + 1]
        mean = 0.5 * (v + w)
        change = -dt * mean
        if i == 0:
            change = dt * mean * block.per_north[k]
        elif i == 1:
            change = dt * mean * block.per_east[k]
        gained = v * a + 0.5 * (w - v) * a * a
        scale = gained / mean if abs(mean) > 1e-9 else a
        out.position[i] = block.position[i, k] + change * (1.0 if a >= 1.0 else scale)
        out.velocity[i] = v + a * (w - v)
        # Angular rate at the instant, extrapolated from the means over this interval and the one before
        out.angular_rate[i] = now[i] + (a - 0.5) * (now[i] - before[i])
    out.attitude[0] = block.roll[k] + a * (block.roll[k + 1] - block.roll[k])
    out.attitude[1] = block.pitch[k] + a * (block.pitch[k + 1] - block.pitch[k])
    out.attitude[2] = wrapped(yaw + a * wrapped(new_yaw - yaw))
    flow = max(0.0, 1.0 - shear * max(0.0, block.depth[k]))
    out.water[0], out.water[1], out.water[2] = flow * block.flow[0, k], flow * block.flow[1, k], 0.0
