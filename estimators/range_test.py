"""The self-test of a row that linearises ranges: whether they are so long that a range is linear in the position.

A range r to a beacon is linear in the position only nearly. If the horizontal position has the variances N and E, north
and east, the term of second order adds up to ``(N + E) / (2 r)`` to the mean of the range. A filter that linearises
leaves it out. With one beacon, and without a velocity, the position is uncertain along the circle about the beacon; the
term then is in all readings with the same sign, the filter takes it for knowledge of the direction along the circle,
and its covariance becomes far too small there. The innovations stay small, so that no test of them shows it.

The test compares the sum of these terms, each divided by the standard deviation of the range, with what noise of as
many readings adds up to. If it is larger for some readings in a row, the row says so: the diagnostic ``inconsistent``
is 1. Old readings fade, and no reading counts for more than `BOUND`, so that a row which begins far from where it
believes to be, and finds its position, is not reported for long.

Source of the term of second order: Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with Applications to
Tracking and Navigation*, Wiley, 2001, section 10.3.2.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, nan, sqrt

from simnav.estimates import Estimates
from simnav.steps import Steps
from simnav.types import KINDS, Array, Estimate, Instruments, Measurements

__all__ = ["RangeTest"]

#: Readings over which the sum fades.
MEMORY = 100
#: What a reading counts at most, in standard deviations.
BOUND = 2.0
#: Readings in a row for which the sum must be too large.
PATIENCE = 5


class RangeTest:
    """The test of the module, for the ranges to fixed beacons of a run.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments.

    Attributes
    ----------
    curved : bool
        Whether the ranges are not linear enough.
    """

    def __init__(self, instruments: Instruments):
        self._sigma = {
            sheet.name: float(sheet.sigma[0])
            for sheet in instruments.values()
            if KINDS[sheet.kind].role == "range" and not KINDS[sheet.kind].side and sheet.sigma[0] > 0.0
        }
        self._sum = self._variance = 0.0
        self._too_large = 0

    def __bool__(self) -> bool:
        return bool(self._sigma)

    @property
    def curved(self) -> bool:
        return self._too_large >= PATIENCE

    def judge(self, measurements: Measurements, estimate: Estimate) -> Estimate:
        """The estimate, with the diagnostic ``inconsistent`` at 1 if ranges are not linear enough.

        Parameters
        ----------
        measurements : Measurements
            What the row got in this step.
        estimate : Estimate
            What it returned. Without a covariance it is not tested.

        Returns
        -------
        Estimate
        """
        self._add(measurements, estimate.covariance)
        if not self.curved:
            return estimate
        return replace(estimate, diagnostics={**estimate.diagnostics, "inconsistent": 1.0})

    def judge_all(self, steps: Steps, estimates: Estimates) -> None:
        """Judge the estimates of several steps; they are changed."""
        for k, measurements in enumerate(steps):
            self._add(measurements, None if estimates.covariance is None else estimates.covariance[k])
            if self.curved:
                estimates.diagnostics["inconsistent"][k] = 1.0

    def _add(self, measurements: Measurements, covariance: Array | None) -> None:
        """Add the ranges of a step; without a finite covariance there is nothing to add."""
        spread = nan if covariance is None else float(covariance[0, 0] + covariance[1, 1])
        fading = 1.0 - 1.0 / MEMORY
        for m in measurements.aids if isfinite(spread) else ():
            sigma, distance = self._sigma.get(m.instrument), float(m.value[0])
            if sigma is None or not distance > 0.0:
                continue
            self._sum = fading * self._sum + min(spread / (2.0 * distance * sigma), BOUND)
            self._variance = fading**2 * self._variance + 1.0
            self._too_large = self._too_large + 1 if self._sum > sqrt(self._variance) else 0
