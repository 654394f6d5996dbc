"""The motion in a block of samples: the rows that `simnav.world.motion` stores, and what only follows from them.

A block is an array of `simnav.inverse_strapdown.ideal_samples` with more rows. What follows from them is the attitude,
in a loop of vector instructions, and the states between the samples that somebody asked for (taps).
"""

from __future__ import annotations

from math import atan2, cos, sin
from typing import NamedTuple

import numpy as np

from simnav.compiled import Array, helper
from simnav.inverse_strapdown import (
    AXES,
    EARTH,
    INTERVAL,
    PER_EAST,
    PER_NORTH,
    POSITION,
    SAMPLE_ROWS,
    VELOCITY,
    SmallMatrix,
)
from simnav.strapdown import Triple

__all__ = [
    "ANGLES",
    "BLOCK_ROWS",
    "BOW",
    "FLOW",
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

# At each end of an interval: roll, pitch. At its later end: cosine and sine of the heading of the bow; the course
# (`Course`), whose last two rows are depth and sway velocity; current at the surface, north, east.
ANGLES, BOW, COURSE, DEPTHS, FLOW = (SAMPLE_ROWS + k for k in (0, 2, 4, 12, 14))
BLOCK_ROWS = SAMPLE_ROWS + 16


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
def course_at(block: Array, k: int) -> Course:
    """The course at the end of interval k."""
    return Course(
        speed=block[COURSE, k],
        yaw_rate=block[COURSE + 1, k],
        heading=block[COURSE + 2, k],
        cos_heading=block[COURSE + 3, k],
        sin_heading=block[COURSE + 4, k],
        path=block[COURSE + 5, k],
        cos_path=block[COURSE + 6, k],
        sin_path=block[COURSE + 7, k],
        depth=block[DEPTHS, k],
        sway=block[DEPTHS + 1, k],
    )


@helper(borrows=True)
def put_course(block: Array, k: int, course: Course) -> None:
    """Store the course at the end of interval k."""
    block[COURSE, k], block[COURSE + 1, k], block[COURSE + 2, k] = course.speed, course.yaw_rate, course.heading
    block[COURSE + 3, k], block[COURSE + 4, k] = course.cos_heading, course.sin_heading
    block[COURSE + 5, k], block[COURSE + 6, k], block[COURSE + 7, k] = course.path, course.cos_path, course.sin_path
    block[DEPTHS, k], block[DEPTHS + 1, k] = course.depth, course.sway


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
def _put_matrix(block: Array, k: int, c: SmallMatrix) -> None:
    block[AXES, k], block[AXES + 1, k], block[AXES + 2, k] = c.c00, c.c01, c.c02
    block[AXES + 3, k], block[AXES + 4, k], block[AXES + 5, k] = c.c10, c.c11, c.c12
    block[AXES + 6, k], block[AXES + 7, k], block[AXES + 8, k] = c.c20, c.c21, c.c22


@helper(borrows=True)
def orient(block: Array, n: int) -> None:
    """The direction cosine matrices at the ends of n intervals."""
    large = 0
    for k in range(n):
        roll, pitch = block[ANGLES, k + 1], block[ANGLES + 1, k + 1]
        cr, sr = _small_cosine_sine(roll)
        ct, st = _small_cosine_sine(pitch)
        _put_matrix(block, k + 1, matrix(cr, sr, ct, st, block[BOW, k], block[BOW + 1, k]))
        large += (abs(roll) > 0.3) | (abs(pitch) > 0.3)
    if large > 0:
        for k in range(n):
            cr, sr = cosine_sine(block[ANGLES, k + 1])
            ct, st = cosine_sine(block[ANGLES + 1, k + 1])
            _put_matrix(block, k + 1, matrix(cr, sr, ct, st, block[BOW, k], block[BOW + 1, k]))


@helper(borrows=True)
def body_rate(block: Array, k: int, rate: Array) -> Triple:
    """Mean angular rate of the body relative to north-east-down over interval k, body axes [rad/s]."""
    e0, e2 = block[EARTH, k], block[EARTH + 1, k]
    return (
        rate[0] - block[AXES, k + 1] * e0 - block[AXES + 6, k + 1] * e2,
        rate[1] - block[AXES + 1, k + 1] * e0 - block[AXES + 7, k + 1] * e2,
        rate[2] - block[AXES + 2, k + 1] * e0 - block[AXES + 8, k + 1] * e2,
    )


@helper(borrows=True)
def tap_at(out: Array, a: float, block: Array, k: int, turning: tuple[Triple, Triple], shear: float) -> None:
    """State at the fraction a of sample interval k: velocity and angles are linear, position is their integral.

    ``turning`` is the angular rate over the interval before and over this one.
    """
    before, now = turning
    dt = block[INTERVAL, k]
    yaw = atan2(block[AXES + 3, k], block[AXES, k])
    new_yaw = atan2(block[AXES + 3, k + 1], block[AXES, k + 1])
    # The fraction of the position change that belongs to a linear velocity
    for i in range(3):
        v, w = block[VELOCITY + i, k], block[VELOCITY + i, k + 1]
        mean = 0.5 * (v + w)
        change = -dt * mean
        if i == 0:
            change = dt * mean * block[PER_NORTH, k]
        elif i == 1:
            change = dt * mean * block[PER_EAST, k]
        gained = v * a + 0.5 * (w - v) * a * a
        scale = gained / mean if abs(mean) > 1e-9 else a
        out[i] = block[POSITION + i, k] + change * (1.0 if a >= 1.0 else scale)
        out[3 + i] = v + a * (w - v)
        # Angular rate at the instant, extrapolated from the means over this interval and the one before
        out[9 + i] = now[i] + (a - 0.5) * (now[i] - before[i])
    for i in range(2):
        out[6 + i] = block[ANGLES + i, k] + a * (block[ANGLES + i, k + 1] - block[ANGLES + i, k])
    out[8] = wrapped(yaw + a * wrapped(new_yaw - yaw))
    flow = max(0.0, 1.0 - shear * max(0.0, block[DEPTHS, k]))
    out[12] = flow * block[FLOW, k]
    out[13] = flow * block[FLOW + 1, k]
