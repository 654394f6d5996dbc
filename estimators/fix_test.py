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
from math import cos, hypot, isfinite, nan, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.estimates import Estimates
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.geometry.earth import radii_scalar
from simnav.kernel_types import IntegerVector, Matrix, Vector
from simnav.kinds import kinds_with
from simnav.records import Record
from simnav.steps import Steps
from simnav.types import Array, Datasheet, Estimate, Instruments, Measurement, Measurements

from .persistence import Courses, add_innovation, is_correlated, is_large, no_innovations

__all__ = ["FixTest"]

_SAME = 1e-6  # a fix from before the step by less than this is of the step [s]
_STILL = np.zeros(3)


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


class _Receivers(Record):
    """The r receivers of a run, and the course of each.

    Attributes
    ----------
    courses : Courses
        Their recent fixes.
    against : (r,) array of int
        How many fixes in a row contradict the estimate.
    arm : (r, 2) array
        Horizontal lever arm, forward and starboard [m].
    variance : (r, 2) array
        Variances of a fix, north and east [m^2].
    swing : (r,) array
        Square of the lever arm, which is the variance of a fix where the heading is not known [m^2].
    limits : _Limits
        Of the test.
    """

    courses: Courses
    against: IntegerVector
    arm: Matrix
    variance: Matrix
    swing: Vector
    limits: _Limits


class _Estimate(NamedTuple):
    """An estimate with which a fix is compared: its time and vectors, and the variances north and east [m^2]."""

    time: float
    position: Vector
    velocity: Vector
    heading: float
    north: float
    east: float


@helper
def _add_fix(receivers: _Receivers, row: int, time: float, latitude: float, longitude: float, estimate: Any) -> None:
    """Compare a fix with the estimate after its step.

    The lever arm is turned by the heading; roll and pitch move it by less than a fix.
    """
    north = east = 0.0
    first, second = receivers.variance[row, 0], receivers.variance[row, 1]
    if time != estimate.time:
        later = time - estimate.time
        north, east = later * estimate.velocity[0], later * estimate.velocity[1]
    forward, starboard = receivers.arm[row, 0], receivers.arm[row, 1]
    if forward != 0.0 or starboard != 0.0:
        if isfinite(estimate.heading):
            c, s = cos(estimate.heading), sin(estimate.heading)
            north, east = north + c * forward - s * starboard, east + s * forward + c * starboard
        else:  # it lies in some direction
            first, second = first + receivers.swing[row], second + receivers.swing[row]
    position, limits, course = estimate.position, receivers.limits, receivers.courses
    meridian, prime_vertical = radii_scalar(sin(position[0]))
    north = (latitude - position[0]) * (meridian + position[2]) - north
    east = (longitude - position[1]) * (prime_vertical + position[2]) * cos(position[0]) - east
    u, v = north / sqrt(estimate.north + first), east / sqrt(estimate.east + second)
    if isfinite(u + v):
        add_innovation(course, row, u, v, 0.0, 2, time, u * u + v * v > limits.square)
        against = is_correlated(course, row, limits.direction) and is_large(course, row, limits.distance)
        receivers.against[row] = receivers.against[row] + 1 if against else 0


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
    """The estimates of t steps: time (t,), position and velocity (t, 3), heading (t,), variances (t, 2)."""

    time: Vector
    position: Matrix
    velocity: Matrix
    heading: Vector
    variance: Matrix


@kernel
def _judge_fixes(receivers: _Receivers, fixes: _Fixes, answers: _Answers, worst: IntegerVector) -> None:
    """Compare fixes with the estimates after their steps; ``worst`` (t,) is that of `_judge_fix` after each step."""
    k, against = 0, receivers.against.max()
    for step in range(worst.size):
        while k < fixes.step.size and fixes.step[k] == step:
            estimate = _Estimate(
                answers.time[step], answers.position[step], answers.velocity[step], answers.heading[step],
                answers.variance[step, 0], answers.variance[step, 1],
            )  # fmt: skip
            _add_fix(receivers, fixes.receiver[k], fixes.time[k], fixes.place[k, 0], fixes.place[k, 1], estimate)
            against = receivers.against.max()
            k += 1
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
        arms = np.array([sheet.lever_arm[:2] for sheet in sheets]).reshape(-1, 2)
        self._receivers = _Receivers(
            courses=no_innovations(len(sheets)), against=np.zeros(len(sheets), np.int64), arm=arms,
            variance=np.array([_variance(sheet)[:2] for sheet in sheets]).reshape(-1, 2),
            swing=np.array([hypot(*arm) ** 2 for arm in arms.tolist()]),
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
            for m in measurements.aids:
                if m.instrument in self._rows and m.time > measurements.start - _SAME:
                    self._add(m, estimate, estimate.position, estimate.covariance)
        if not self.contradicted:
            return estimate
        return replace(estimate, diagnostics={**estimate.diagnostics, "inconsistent": 1.0})

    def _add(self, m: Measurement, estimate: Estimate, position: Array, covariance: Array) -> None:
        """Add a fix of this step."""
        velocity = _STILL if estimate.velocity is None else ready(estimate.velocity)
        heading = nan if estimate.attitude is None else float(estimate.attitude[2])
        variances = float(covariance[0, 0]), float(covariance[1, 1])
        answer = _Estimate(estimate.time, ready(position), velocity, heading, *variances)
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
            np.full(t, nan) if estimates.attitude is None else ready(estimates.attitude[:, 2]),
            ready(covariance.diagonal(axis1=1, axis2=2)[:, :2]),
        )  # fmt: skip
        worst = np.empty(t, np.int64)
        _judge_fixes.unchecked(self._receivers, fixes, answers, worst)
        contradicted = worst >= self.PATIENCE
        self.contradicted = bool(contradicted[-1])
        if contradicted.any():
            estimates.diagnostics["inconsistent"] = np.where(contradicted, 1.0, estimates.diagnostics["inconsistent"])


def _variance(sheet: Datasheet) -> Array:
    """The variances of a fix; a random walk has no variance of its own, and is left out."""
    variance = sheet.sigma**2 + sheet.bias**2
    if isfinite(sheet.correlation_time):
        variance = variance + sheet.bias_instability**2
    return variance
