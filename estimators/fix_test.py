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
from math import cos, hypot, isfinite, sin, sqrt
from typing import NamedTuple

from simnav.compiled import kernel
from simnav.estimators.algebra.chi_square import chi_square_limits, normal_quantile
from simnav.geometry.earth import radii_scalar
from simnav.kinds import kinds_with
from simnav.types import Array, Datasheet, Estimate, Instruments, Measurement, Measurements

from .persistence import Courses, add_innovation, is_correlated, is_large, no_innovations

__all__ = ["FixTest"]


@kernel
def _judge(
    fix: tuple[float, float, float],
    position: tuple[float, float, float],
    antenna: tuple[float, float],
    estimated: tuple[float, float],
    measured: tuple[float, float],
    limits: tuple[float, float, float],
    course: Courses,
) -> int:
    """Whether the fixes of a receiver are off in one direction; -1 if this one cannot be compared.

    Parameters
    ----------
    fix : (float, float, float)
        Time [s]; latitude and longitude [rad].
    position : (float, float, float)
        The estimate: latitude, longitude [rad] and height [m].
    antenna : (float, float)
        Where the antenna is, north and east of the estimate [m].
    estimated, measured : (float, float)
        Variances of the estimate and of a fix, north and east [m^2].
    limits : (float, float, float)
        Limit of chi-square for one fix; normal quantiles of a direction, and of too large a distance.
    course : Courses
        The course of the receiver; updated.
    """
    north, east = antenna
    limit, persistent, large = limits
    meridian, prime_vertical = radii_scalar(sin(position[0]))
    north = (fix[1] - position[0]) * (meridian + position[2]) - north
    east = (fix[2] - position[1]) * (prime_vertical + position[2]) * cos(position[0]) - east
    u, v = north / sqrt(estimated[0] + measured[0]), east / sqrt(estimated[1] + measured[1])
    if not isfinite(u + v):
        return -1
    add_innovation(course, 0, u, v, 0.0, 2, fix[0], u * u + v * v > limit)
    return 1 if is_correlated(course, 0, persistent) and is_large(course, 0, large) else 0


class _Receiver(NamedTuple):
    """A receiver: the horizontal lever arm, forward and starboard [m], and the variances of a fix [m^2]."""

    course: Courses
    forward: float
    starboard: float
    north: float
    east: float


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
        quantiles = normal_quantile(self.PERSISTENT), normal_quantile(self.SOUND)
        self._limits = chi_square_limits(self.SOUND)[2], *quantiles
        kinds = kinds_with("position", "horizontal_position")
        self._receivers = {n: _receiver(s) for n, s in instruments.items() if s.kind in kinds}
        self._against = dict.fromkeys(self._receivers, 0)
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
        if self._receivers and estimate.position is not None and estimate.covariance is not None:
            for m in measurements.aids:
                if m.instrument in self._receivers and m.time > measurements.start - 1e-6:
                    self._add(m, estimate, estimate.position, estimate.covariance)
        if not self.contradicted:
            return estimate
        return replace(estimate, diagnostics={**estimate.diagnostics, "inconsistent": 1.0})

    def _add(self, m: Measurement, estimate: Estimate, position: Array, covariance: Array) -> None:
        """Add a fix of this step. The lever arm is turned by the heading; roll and pitch move it by less than a fix."""
        course, forward, starboard, first, second = self._receivers[m.instrument]
        north = east = 0.0
        if m.time != estimate.time and estimate.velocity is not None:
            later = m.time - estimate.time
            north, east = later * float(estimate.velocity[0]), later * float(estimate.velocity[1])
        if forward or starboard:
            heading = float("nan") if estimate.attitude is None else float(estimate.attitude[2])
            if isfinite(heading):
                c, s = cos(heading), sin(heading)
                north, east = north + c * forward - s * starboard, east + s * forward + c * starboard
            else:  # it lies in some direction
                first, second = (v + hypot(forward, starboard) ** 2 for v in (first, second))
        fix, estimated = m.value.tolist(), (covariance.item(0, 0), covariance.item(1, 1))
        against = _judge.unchecked(
            (m.time, fix[0], fix[1]),
            tuple(position.tolist()),
            (north, east),
            estimated,
            (first, second),
            self._limits,
            course,
        )
        if against >= 0:
            self._against[m.instrument] = self._against[m.instrument] + 1 if against else 0
            self.contradicted = max(self._against.values()) >= self.PATIENCE


def _receiver(sheet: Datasheet) -> _Receiver:
    """What is needed of a receiver's datasheet; a random walk has no variance of its own, and is left out."""
    variance = sheet.sigma**2 + sheet.bias**2
    if isfinite(sheet.correlation_time):
        variance = variance + sheet.bias_instability**2
    forward, starboard, _ = sheet.lever_arm.tolist()
    return _Receiver(no_innovations(1), forward, starboard, float(variance[0]), float(variance[1]))
