"""Guidance in compiled passes over many voyages: steering, scores and what is observed.

What is decided, observed and scored is described in `simnav.estimators.learning.guidance`. The environment of one
voyage and the vector form call the same kernels, so that they agree bit for bit.
"""

from __future__ import annotations

from math import atan2, cos, exp, hypot, inf, log1p, log10, pi, radians, sin
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import Array, helper, kernel
from simnav.geometry.rotation import wrap_scalar
from simnav.kernel_types import FlagMatrix, FlagVector, IntegerVector, Matrix, Stack, Vector
from simnav.sensors.stepwise import Delivered
from simnav.structures import structure

from .features import GUIDANCE, LIMIT, SPEED, TURN_RATE

__all__ = [
    "AGROUND",
    "ASIDE",
    "BERTH",
    "FUEL",
    "LARGEST_TURN",
    "SIZE",
    "TALLY",
    "Commands",
    "Route",
    "Tracks",
    "judge",
    "look",
    "steer",
]

#: Unit of the distance from the track [m], and largest change of heading [rad].
ASIDE, LARGEST_TURN = 20.0, radians(60.0)
#: Weights of the reward.
FUEL, AGROUND, BERTH = 0.2, 100.0, 100.0
#: Numbers of an observation.
SIZE = len(GUIDANCE)
#: Points of the track that are looked at before and after the last one.
BEHIND, AHEAD = 20, 120


#: Of a voyage: distance along the track [m], sum of the squared distances from it [m^2], fuel, smallest clearance [m].
TALLY = structure(along=float, squares=float, fuel=float, clearance=float)


class Route(NamedTuple):
    """What is wanted of a voyage beside to follow its track.

    Attributes
    ----------
    half_width : float
        Half the width of the channel [m]; inf without one.
    berth : float
        Reward of an end at rest in the berth; 0 without one.
    """

    half_width: float
    berth: float


class Tracks(NamedTuple):
    """The r planned tracks of b voyages, as lines of at most p points.

    Attributes
    ----------
    of : (b,) int array
        Number of each voyage's track.
    length : (r,) int array
        Number of points of each track.
    points : (r, p, 4) array
        North and east of the start [m], heading [rad], speed through the water [m/s].
    geodetic : (r, p, 4) array
        Latitude, longitude [rad], and metres per radian of both.
    course, along : (r, p) array
        Course of the track [rad], and the distance from its start [m].
    """

    of: IntegerVector
    length: IntegerVector
    points: Stack
    geodetic: Stack
    course: Matrix
    along: Matrix


class Commands(NamedTuple):
    """The commands of b vessels, for `simnav.world.motion.command`.

    Attributes
    ----------
    planned : (b,) array
        Planned speed [m/s].
    wrong : (b,) array
        Error of the estimated heading [rad].
    heading, speed : (b,) array
        Commanded heading [rad] and speed through the water [m/s].
    """

    planned: Vector
    wrong: Vector
    heading: Vector
    speed: Vector


@kernel
def steer(
    active: FlagVector,
    actions: Matrix,
    at: IntegerVector,
    ahead: IntegerVector,
    tracks: Tracks,
    truth: Matrix,
    estimate: Matrix,
    commands: Commands,
) -> None:
    """Convert the actions of the agents to commands of the vessels.

    Parameters
    ----------
    active : (b,) bool array
        True for each voyage that is steered.
    actions : (b, 2) array
        Actions of the agents; they are clipped to [-1, 1].
    at, ahead : (b,) int arrays
        Index of the track's point nearest to the estimated position, and number of points by which the planned heading
        is taken ahead of it.
    tracks : Tracks
        The planned tracks.
    truth, estimate : (b, 9) arrays
        Position, velocity, roll, pitch and yaw; NaN for components that are not estimated.
    commands : Commands
        Overwritten.
    """
    points, planned = tracks.points, commands.planned
    for b in range(active.size):
        if not active[b]:
            continue
        r = tracks.of[b]
        turn, haste = min(max(actions[b, 0], -1.0), 1.0), min(max(actions[b, 1], -1.0), 1.0)
        planned[b] = points[r, at[b], 3]
        commands.wrong[b] = wrap_scalar(estimate[b, 8] - truth[b, 8])
        last = tracks.length[r] - 1
        commands.heading[b] = points[r, min(at[b] + ahead[b], last), 2] + LARGEST_TURN * turn
        commands.speed[b] = planned[b] * (1.0 + 0.5 * haste)


@helper
def _place(
    latitude: float, longitude: float, at: int, length: int, geodetic: Array, course: Array, along: Array
) -> tuple[int, float, float]:
    """Nearest point within two minutes of point ``at``, distance to starboard [m], and distance along the track [m]."""
    low, high = max(at - BEHIND, 0), min(at + AHEAD, length)
    least, north, east = inf, 0.0, 0.0
    for i in range(low, high):
        dn = (latitude - geodetic[i, 0]) * geodetic[i, 2]
        de = wrap_scalar(longitude - geodetic[i, 1]) * geodetic[i, 3]
        square = dn * dn + de * de
        if square < least:
            at, least, north, east = i, square, dn, de
    c, s = cos(course[at]), sin(course[at])
    return at, east * c - north * s, along[at] + (north * c + east * s)


@kernel
def judge(
    which: tuple[FlagVector, FlagVector],
    paces: tuple[Vector, Vector, Vector],
    truth: Matrix,
    tracks: Tracks,
    route: Route,
    at: IntegerVector,
    tally: Matrix,
    outcome: tuple[Vector, Vector, FlagVector],
) -> None:
    """Compute the rewards of a step.

    Parameters
    ----------
    which : two (b,) bool arrays
        True for each voyage that is scored, and for each voyage whose last step this is.
    paces : three (b,) arrays
        Length of a step [s], planned speed, and true speed through the water [m/s].
    truth : (b, 9) array
        True position, velocity, roll, pitch and yaw.
    tracks : Tracks
        The planned tracks.
    route : Route
        The route.
    at : (b,) int array
        Index of the track's point nearest to the true position; updated.
    tally : (b, 4) array
        The `TALLY` of each voyage; updated.
    outcome : three (b,) arrays
        Overwritten with the distance to starboard of the track [m], the reward, and whether the vessel touched the
        side.
    """
    active, last = which
    step, planned, speed = paces
    length, geodetic = tracks.length, tracks.geodetic
    aside, rewards, aground = outcome
    for b in range(active.size):
        rewards[b], aground[b] = 0.0, False
        if not active[b]:
            continue
        r, t = tracks.of[b], tally[b].view(TALLY)[0]
        at[b], off, far = _place(
            truth[b, 0], truth[b, 1], at[b], length[r], geodetic[r], tracks.course[r], tracks.along[r]
        )
        usual = max(planned[b], 0.1)
        progress = min((far - t.along) / (usual * step[b]), 1.0)
        burnt = speed[b] / usual
        burnt = burnt * burnt * burnt
        t.along = far
        t.squares += off * off
        t.fuel += burnt
        aside[b] = off
        value = step[b] * (progress - min(abs(off) / ASIDE, 10.0) - FUEL * burnt)
        t.clearance = min(t.clearance, route.half_width - abs(off))
        if t.clearance <= 0.0:
            aground[b] = True
            value -= AGROUND
        if route.berth > 0.0 and last[b]:
            end = geodetic[r, length[r] - 1]
            left = hypot((truth[b, 0] - end[0]) * end[2], wrap_scalar(truth[b, 1] - end[1]) * end[3]) / 10.0
            fast = hypot(truth[b, 3], truth[b, 4]) / 0.5
            value += route.berth * exp(-left * left - fast * fast)
        rewards[b] = value


@helper
def _sigma(variance: float, unit: float) -> float:
    """Decimal logarithm of a sigma in a unit."""
    return 0.5 * log10(max(variance, 1e-18)) - log10(unit)


@helper
def _number(value: float) -> float:
    return min(max(value, -LIMIT), LIMIT) if value == value else 0.0


@kernel
def look(
    active: FlagVector,
    clock: tuple[IntegerVector, Vector, Vector],
    estimated: tuple[Matrix, Matrix],
    delivered: Delivered,
    fix: FlagMatrix,
    tracks: Tracks,
    half_width: float,
    memory: tuple[IntegerVector, Matrix, Matrix],
    observation: Annotated[NDArray[np.float32], "float32[:, ::1]"],
) -> None:
    """Compute the observations of the agents.

    Parameters
    ----------
    active : (b,) bool array
        True for each voyage that is observed.
    clock : three (b,) arrays
        Number of the step (0 at the start of a voyage, before any step); time of the estimate, and length of a step
        [s].
    estimated : (b, 9) and (b, 2) arrays
        Estimated position, velocity and attitude; variances of the horizontal position [m^2] and of the heading
        [rad^2].
    delivered : Delivered
        Measurements of the step.
    fix : (b, i) bool array
        True for each instrument that gives a position.
    tracks : Tracks
        The planned tracks.
    half_width : float
        Half the width of the channel [m]; `ASIDE` without a channel.
    memory : (b,) int, (b, 3) and (b, 2) arrays
        Index of the track's point nearest to the estimated position, updated; heading of the last estimate, turn rate
        and time of the last fix, updated; variances at the start.
    observation : (b, 16) float32 array
        Overwritten for the voyages that are active.
    """
    steps, now, step = clock
    estimate, variance = estimated
    who, when = delivered.who, delivered.when
    length, geodetic, course, along = tracks.length, tracks.geodetic, tracks.course, tracks.along
    at, notes, start = memory
    for b in range(active.size):
        if not active[b]:
            continue
        r, e, row = tracks.of[b], estimate[b], observation[b]
        if steps[b] > 0:
            turned = wrap_scalar(e[8] - notes[b, 0])
            if turned == turned:
                notes[b, 1] = turned / step[b]
            for j in range(delivered.number[b]):
                if fix[b, who[b, j]]:
                    notes[b, 2] = when[b, j]
        notes[b, 0] = e[8]
        off, far = 0.0, along[r, at[b]]
        if abs(e[0]) < inf and abs(e[1]) < inf:
            at[b], off, far = _place(e[0], e[1], at[b], length[r], geodetic[r], course[r], along[r])
        k, end = at[b], length[r] - 1
        north, east = e[3] if e[3] == e[3] else 0.0, e[4] if e[4] == e[4] else 0.0
        over_ground = atan2(east, north) - course[r, k]
        row[0] = _number(off / ASIDE)
        row[1], row[2] = sin(over_ground), cos(over_ground)
        row[3] = wrap_scalar(course[r, min(k + 10, end)] - course[r, k])
        row[4] = wrap_scalar(course[r, min(k + 30, end)] - course[r, k])
        row[5] = wrap_scalar(course[r, min(k + 60, end)] - course[r, k])
        row[6], row[7] = _number(hypot(north, east) / SPEED), _number(tracks.points[r, k, 3] / SPEED)
        row[8] = _number(notes[b, 1] / TURN_RATE)
        row[9], row[10] = _number(_sigma(variance[b, 0], 1.0)), _number(_sigma(variance[b, 1], pi / 180.0))
        row[11] = _number(log1p(max(now[b] - notes[b, 2], 0.0)))
        row[12] = _number(log1p(max(along[r, end] - far, 0.0)) / 5.0)
        row[13] = _number(half_width / ASIDE)
        row[14], row[15] = _number(_sigma(start[b, 0], 1.0)), _number(_sigma(start[b, 1], pi / 180.0))
