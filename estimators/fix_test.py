"""The self-test of a row against the fixes that it sets aside.

A row that gives fixes less weight, or rejects them, is consistent with itself whatever the truth is: what it does not
use cannot contradict it. If it rejects wrong fixes, this is its task. If it has lost its position, it rejects the right
ones. Its own measurements cannot tell these two cases apart, so the row says that there is a contradiction: the
diagnostic ``inconsistent`` is 1 while the fixes are in the same direction from the estimate again and again, further
than its covariance and the datasheet of the receiver allow. Noise, however large, has no direction, and single gross
errors do not persist, so neither is a contradiction.

The statistic is that of `simnav.estimators.persistence`, of the north and east components of a fix minus
the estimate after the step, with the datasheet's noise, bias and the covariance of the estimate.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, isfinite, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.estimates import Estimates
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.geometry.earth import radii_scalar
from simnav.geometry.rotation import wrap_scalar
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.kinds import kinds_with
from simnav.records import Record
from simnav.steps import Steps
from simnav.types import Array, Datasheet, Estimate, Instruments, Measurement, Measurements

from .persistence import Courses, add_innovation, is_correlated, is_large, no_innovations

__all__ = ["FixTest"]

#: Rows of `simnav.types.Estimate.covariance`: errors of position, and of the attitude about the axes.
NORTH, EAST, ABOUT_NORTH, ABOUT_EAST, ABOUT_DOWN = 0, 1, 6, 7, 8
_SAME = 1e-6  # a fix from before the step by less than this is of the step [s]
_STILL, _UNKNOWN = np.zeros(3), np.full(3, np.nan)


class _Limits(NamedTuple):
    """The limits of the test.

    Attributes
    ----------
    square : float
        Limit of chi-square for one fix.
    direction, distance : float
        Normal quantiles from which fixes have a direction, and are too far away.
    """

    square: float
    direction: float
    distance: float


class _Before(NamedTuple):
    """The estimate before: its time (1,), velocity and attitude (3,); the time is NaN before the first."""

    time: Vector
    velocity: Vector
    attitude: Vector


class _Receivers(Record):
    """The r receivers of a run, and the course of each.

    Attributes
    ----------
    courses : Courses
        Their recent fixes.
    before : _Before
        The estimate before the present one.
    against : (r,) array of int
        How many fixes in a row contradict the estimate.
    arm : (r, 3) array
        Lever arm, forward, starboard and down [m].
    variance : (r, 2) array
        Variances of a fix, north and east [m^2].
    swing : (r,) array
        Square of the horizontal lever arm: the variance of a fix where the heading is not known [m^2].
    limits : _Limits
        Of the test.
    """

    courses: Courses
    before: _Before
    against: IntegerVector
    arm: Matrix
    variance: Matrix
    swing: Vector
    limits: _Limits


class _Estimate(NamedTuple):
    """An estimate with which a fix is compared.

    Attributes
    ----------
    time : float
        Its time [s].
    position, velocity, attitude : (3,) arrays
        As of `simnav.types.Estimate`.
    covariance : (9, 9) array
        Of the error of position, velocity and attitude.
    """

    time: float
    position: Vector
    velocity: Vector
    attitude: Vector
    covariance: Matrix


@helper
def _turned(arm: Vector, roll: float, pitch: float, heading: float) -> tuple[float, float, float]:
    """A vector in body axes, turned to north, east and down."""
    sr, cr, sp, cp, s, c = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(heading), cos(heading)
    starboard, below = cr * arm[1] - sr * arm[2], sr * arm[1] + cr * arm[2]
    forward = cp * arm[0] + sp * below
    return c * forward - s * starboard, s * forward + c * starboard, cp * below - sp * arm[0]


@helper
def _between(angle: float, before: float, share: float) -> float:
    """An angle that changes in proportion to time, at a share of the step from its end (0 or less)."""
    return angle + share * wrap_scalar(angle - before)


@helper
def _add_fix(receivers: _Receivers, row: int, time: float, latitude: float, longitude: float, estimate: Any) -> None:
    """Compare a fix with the estimate after its step.

    The estimate is carried back to the time of the fix, by velocity and angles that change in proportion to time. The
    antenna is on its lever arm, and an error of the attitude moves it.
    """
    covariance = estimate.covariance
    first = receivers.variance[row, 0] + covariance[NORTH, NORTH]
    second = receivers.variance[row, 1] + covariance[EAST, EAST]
    velocity, angles, before = estimate.velocity, estimate.attitude, receivers.before
    later = time - estimate.time
    share = later / (estimate.time - before.time[0])
    if not isfinite(share):
        share = 0.0
    north = later * (velocity[0] + 0.5 * share * (velocity[0] - before.velocity[0]))
    east = later * (velocity[1] + 0.5 * share * (velocity[1] - before.velocity[1]))
    arm = receivers.arm[row]
    if arm[0] != 0.0 or arm[1] != 0.0 or arm[2] != 0.0:
        roll = _between(angles[0], before.attitude[0], share)
        pitch = _between(angles[1], before.attitude[1], share)
        heading = _between(angles[2], before.attitude[2], share)
        if isfinite(roll + pitch + heading):
            x, y, z = _turned(arm, roll, pitch, heading)
            north, east = north + x, east + y
            first += z * z * covariance[ABOUT_EAST, ABOUT_EAST] + y * y * covariance[ABOUT_DOWN, ABOUT_DOWN]
            second += z * z * covariance[ABOUT_NORTH, ABOUT_NORTH] + x * x * covariance[ABOUT_DOWN, ABOUT_DOWN]
        else:  # it lies in some direction
            first, second = first + receivers.swing[row], second + receivers.swing[row]
    position, limits, course = estimate.position, receivers.limits, receivers.courses
    meridian, prime_vertical = radii_scalar(sin(position[0]))
    north = (latitude - position[0]) * (meridian + position[2]) - north
    east = (longitude - position[1]) * (prime_vertical + position[2]) * cos(position[0]) - east
    u, v = north / sqrt(first), east / sqrt(second)
    if isfinite(u + v):
        add_innovation(course, row, u, v, 0.0, 2, time, u * u + v * v > limits.square)
        against = is_correlated(course, row, limits.direction) and is_large(course, row, limits.distance)
        receivers.against[row] = receivers.against[row] + 1 if against else 0


@kernel
def _keep(before: _Before, time: float, velocity: Vector, attitude: Vector) -> None:
    """Keep an estimate for the next step."""
    before.time[0] = time
    for axis in range(3):
        before.velocity[axis], before.attitude[axis] = velocity[axis], attitude[axis]


@kernel
def _judge_fix(receivers: _Receivers, row: int, fix: tuple[float, float, float], estimate: _Estimate) -> int:
    """Compare a fix, its time, latitude and longitude; how many in a row contradict, of the worst receiver."""
    _add_fix(receivers, row, fix[0], fix[1], fix[2], estimate)
    return int(receivers.against.max())


class _Fixes(NamedTuple):
    """The fixes of several steps.

    Attributes
    ----------
    step, receiver : (k,) array of int
        Number of the step, and row of the receiver.
    time : (k,) array
        Time of validity [s].
    place : (k, 2) array
        Latitude and longitude [rad].
    """

    step: IntegerVector
    receiver: IntegerVector
    time: Vector
    place: Matrix


class _Answers(NamedTuple):
    """The estimates of t steps: time (t,), vectors (t, 3) and covariance (t, 9, 9)."""

    time: Vector
    position: Matrix
    velocity: Matrix
    attitude: Matrix
    covariance: Stack


@kernel
def _judge_fixes(receivers: _Receivers, fixes: _Fixes, answers: _Answers, worst: IntegerVector) -> None:
    """Compare fixes with the estimates after their steps; ``worst`` (t,) is that of `_judge_fix` after each step."""
    k, against = 0, receivers.against.max()
    for step in range(worst.size):
        while k < fixes.step.size and fixes.step[k] == step:
            estimate = _Estimate(
                answers.time[step], answers.position[step], answers.velocity[step], answers.attitude[step],
                answers.covariance[step],
            )  # fmt: skip
            _add_fix(receivers, fixes.receiver[k], fixes.time[k], fixes.place[k, 0], fixes.place[k, 1], estimate)
            against = receivers.against.max()
            k += 1
        _keep(receivers.before, answers.time[step], answers.velocity[step], answers.attitude[step])
        worst[step] = against


class FixTest:
    """The test of the module, for the receivers of a run.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.

    Attributes
    ----------
    contradicted : bool
        Whether the fixes of a receiver contradict the estimate.
    """

    PERSISTENT = 0.99  # probability that fixes with white noise are not found to have a direction
    SOUND = 0.999  # probability that fixes which are as good as their datasheet are not found too far away
    PATIENCE = 5  # fixes in a row that must contradict

    def __init__(self, instruments: Instruments):
        kinds = kinds_with("position", "horizontal_position")
        sheets = [s for s in instruments.values() if s.kind in kinds]
        self._rows = {sheet.name: row for row, sheet in enumerate(sheets)}
        arms = np.array([sheet.lever_arm for sheet in sheets]).reshape(-1, 3)
        self._receivers = _Receivers(
            courses=no_innovations(len(sheets)), before=_Before(np.full(1, np.nan), np.zeros(3), np.zeros(3)),
            against=np.zeros(len(sheets), np.int64), arm=arms,
            variance=np.array([_variance(sheet)[:2] for sheet in sheets]).reshape(-1, 2),
            swing=np.sum(arms[:, :2] ** 2, axis=1),
            limits=_Limits(
                square=chi_square_limits(self.SOUND)[2], direction=normal_quantile(self.PERSISTENT),
                distance=normal_quantile(self.SOUND),
            ),
        )  # fmt: skip
        self.contradicted = False

    def judge(self, measurements: Measurements, estimate: Estimate) -> Estimate:
        """The estimate, with the diagnostic ``inconsistent`` at 1 if fixes contradict it.

        Parameters
        ----------
        measurements : Measurements
            What the row got in this step.
        estimate : Estimate
            What it returned. Without a position or a covariance it is not tested.

        Returns
        -------
        Estimate
        """
        if self._rows and estimate.position is not None and estimate.covariance is not None:
            answer = _answer(estimate, estimate.position, estimate.covariance)
            for m in measurements.aids:
                if m.instrument in self._rows and m.time > measurements.start - _SAME:
                    self._add(m, answer)
            _keep.unchecked(self._receivers.before, answer.time, answer.velocity, answer.attitude)
        if not self.contradicted:
            return estimate
        return replace(estimate, diagnostics={**estimate.diagnostics, "inconsistent": 1.0})

    def _add(self, m: Measurement, answer: _Estimate) -> None:
        """Add a fix of this step."""
        fix: list[float] = m.value.tolist()
        worst = _judge_fix.unchecked(self._receivers, self._rows[m.instrument], (m.time, fix[0], fix[1]), answer)
        self.contradicted = worst >= self.PATIENCE

    def judge_all(self, steps: Steps, estimates: Estimates) -> None:
        """Judge the estimates of several steps; they are changed."""
        position, covariance, t = estimates.position, estimates.covariance, len(estimates)
        if not self._rows or position is None or covariance is None:
            return
        rows, step, starts = steps.rows_of(self._rows), steps.step, np.array([steps.start, *steps.ends[:-1]])
        at = np.flatnonzero((rows >= 0) & (steps.time > starts[step] - _SAME))
        fixes = _Fixes(step[at], rows[at], steps.time[at], np.ascontiguousarray(steps.value[at, :2]))
        answers = _Answers(
            ready(estimates.time), ready(position),
            np.zeros((t, 3)) if estimates.velocity is None else ready(estimates.velocity),
            np.full((t, 3), np.nan) if estimates.attitude is None else ready(estimates.attitude),
            ready(covariance),
        )  # fmt: skip
        worst = np.empty(t, np.int64)
        _judge_fixes.unchecked(self._receivers, fixes, answers, worst)
        contradicted = worst >= self.PATIENCE
        self.contradicted = bool(contradicted[-1])
        if contradicted.any():
            estimates.diagnostics["inconsistent"] = np.where(contradicted, 1.0, estimates.diagnostics["inconsistent"])


def _answer(estimate: Estimate, position: Array, covariance: Array) -> _Estimate:
    """An estimate as the kernels take it."""
    return _Estimate(
        estimate.time, ready(position), ready(_STILL if estimate.velocity is None else estimate.velocity),
        ready(_UNKNOWN if estimate.attitude is None else estimate.attitude), ready(covariance),
    )  # fmt: skip


def _variance(sheet: Datasheet) -> Array:
    """The variances of a fix; a random walk has no variance of its own, and is left out."""
    variance = sheet.sigma**2 + sheet.bias**2
    if isfinite(sheet.correlation_time):
        variance = variance + sheet.bias_instability**2
    return variance
