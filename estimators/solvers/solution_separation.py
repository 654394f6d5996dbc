"""Solution separation: a filter for every instrument that could be wrong, which does without it.

The main filter uses all instruments, sub-filter i all but instrument i. If instrument i is wrong, sub-filter i is right
and the main filter is not: they separate. Both use the same measurements but for those of i, so that for filters with
the right model the separation d has the covariance

    cov(d) = P_i - P_0                                              (R. G. Brown and P. W. McBurney 1988)

which gives the threshold of the test, component by component of the position, velocity and heading:
``T_i = K_fa sqrt(P_i - P_0)``. Where a test fails, an instrument is excluded: of those whose test fails, the one whose
sub-filter is in the best agreement with the instruments that it uses (the least mean NIS of its worst instrument over
`_RECENT` seconds; residual monitoring after Young and McGraw). Its sub-filter becomes the main one, so that what the
fault has done so far is undone, too.

An excluded instrument is tried on: when it has agreed with the main filter for ``recovery`` seconds it is used again.

**Protection level.** For the north and the east component, with the sigmas of main and sub-filters, ::

    PL = max(K_0 sigma_0, max_i (T_i + K_i sigma_i))

bounds the error whatever single instrument is wrong, but for a risk that is shared out evenly between the hypotheses
"none" and "instrument i", the latter weighed by the prior probability of a fault (the closed form of Blanch et al.
2015). The horizontal protection level is the root of the sum of the two squared. It is the diagnostic
``protection_level`` [m].

**Horizon.** A sub-filter without GNSS grows less certain for ever, until it tests nothing. Sub-filters are therefore
begun anew from the main filter: there are two for each instrument, the elder ``horizon / 2`` to ``horizon`` seconds old.
So a fault that grows more slowly than the dead reckoning of that time is followed, and the protection level covers
faults that began after the elder sub-filters. After an exclusion all of them are new.

Sources: R. G. Brown and P. W. McBurney, *Self-contained GPS integrity check using maximum solution separation*,
Navigation 35(1), 1988; M. Brenner, *Integrated GPS/inertial fault detection availability*, Navigation 43(2), 1996;
R. S. Y. Young and G. A. McGraw, *Fault detection and exclusion using normalized solution separation and residual
monitoring methods*, Navigation 50(3), 2003; J. Blanch, T. Walter, P. Enge et al., *Baseline advanced RAIM user
algorithm and possible improvements*, IEEE Trans. Aerospace and Electronic Systems 51(1), 2015.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, hypot, sqrt
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.noise import normalised_square
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.composition import Solver
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.estimators.solvers.state_difference import difference
from simnav.types import KINDS, Array, Estimate, InitialState, Instruments, Measurements

__all__ = ["SolutionSeparation"]

#: Components whose separation is tested: position, velocity, heading.
_TESTED = (0, 1, 2, 3, 4, 5, 8)
#: Part of the main filter's sigma that a separation may have by linearisation alone.
_LINEARISATION = 0.1
#: Memory of the mean NIS of an instrument in a filter [s].
_RECENT = 10.0
#: Of a good measurement to agree with the main filter.
_AGREES = 0.999


class _Exclusion(Adaptation):
    """Leaves the excluded instruments out, and notes since when each has agreed with the filter."""

    def __init__(self) -> None:
        self.excluded: set[str] = set()
        self.agrees_since: dict[str, float] = {}
        self._limits = chi_square_limits(_AGREES)

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self.excluded, self.agrees_since = set(), {}

    def adapt(self, innovation: Innovation) -> Array | None:
        """The nominal noise, or None."""
        name, time = innovation.measurement.instrument, innovation.measurement.time
        if name not in self.excluded:
            return innovation.noise
        nis = normalised_square(innovation.residual, innovation.predicted, innovation.noise)
        if nis <= self._limits[len(innovation.residual)]:
            self.agrees_since.setdefault(name, time)
        else:
            self.agrees_since.pop(name, None)
        return None


@dataclass
class _Without:
    """A sub-filter: the instrument that it does without, when it was begun, its estimate and the mean NIS."""

    name: str
    filter: KalmanEstimator
    begun: float
    estimate: Estimate | None = None


class SolutionSeparation(Solver):
    """The solver of the module.

    Diagnostics: ``protection_level`` [m]; ``separation.<instrument>``, the largest separation over its threshold;
    ``excluded.<instrument>``, 1 where it is excluded.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
    false_alarm : float
        Probability of each test to fail where nothing is wrong, in (0, 1).
    horizon : float
        Age at which a sub-filter is begun anew [s].
    recovery : float
        Time for which an excluded instrument must agree before it is used again [s].
    risk : float
        Probability that the horizontal error exceeds the protection level. IMO A.915(22) allows 1e-5 in three hours.
    fault_probability : float
        Prior probability that a certain instrument is wrong.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    refuses: ClassVar[Mapping[str, str]] = {
        "adaptation": "the covariance of the separation holds for filters that believe the same noise",
        "smoother": "an exclusion changes the filter",
    }

    def __init__(
        self,
        model: ModelChoice,
        false_alarm: float = 1e-6,
        horizon: float = 300.0,
        recovery: float = 30.0,
        risk: float = 1e-5,
        fault_probability: float = 1e-2,
    ):
        for name, p in (("false_alarm", false_alarm), ("risk", risk), ("fault_probability", fault_probability)):
            if not 0.0 < p < 1.0:
                raise ValueError(f"{name} = {p:g}: it must lie between 0 and 1")
        if not horizon > 0.0:
            raise ValueError(f"horizon = {horizon:g} s: it must be above 0")
        if not recovery >= 0.0:
            raise ValueError(f"recovery = {recovery:g} s: it must not be negative")
        self._choice = model
        self.false_alarm, self.horizon, self.recovery = false_alarm, horizon, recovery
        self.risk, self.fault_probability = risk, fault_probability

    def _filter(self, start: InitialState, instruments: Instruments, exclusion: _Exclusion | None) -> KalmanEstimator:
        one = KalmanEstimator(copy.deepcopy(self._choice), exclusion)
        one.row = self.label
        one.reset(start, instruments)
        return one

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        from scipy.stats import norm

        self._exclusion = _Exclusion()
        self._main = self._filter(start, instruments, self._exclusion)
        self._names = [name for name, sheet in instruments.items() if self._main.model.observes(sheet)]
        self._components = {name: len(KINDS[instruments[name].kind].errors) for name in self._names}
        self._pairs = {
            name: [_Without(name, self._filter(start, instruments, None), start.time) for _ in range(2)]
            for name in self._names
        }
        for _, younger in self._pairs.values():
            younger.begun = start.time - 0.5 * self.horizon  # so that the two come of age in turns
        tests = max(len(self._names), 1) * len(_TESTED)
        hypotheses = len(self._names) + 1
        self._threshold = float(norm.isf(0.5 * self.false_alarm / tests))
        self._quiet = float(norm.isf(0.25 * self.risk / hypotheses))
        share = self.risk / (2.0 * hypotheses * self.fault_probability)
        self._missed = float(norm.isf(min(share, 0.5)))
        self._nis: dict[int, dict[str, float]] = {}
        self._time = start.time

    @property
    def model(self) -> object:
        """Of the main filter."""
        return self._main.model

    @property
    def covariance(self) -> Array:
        """(n, n) covariance of the main filter."""
        return self._main.covariance

    @property
    def excluded(self) -> frozenset[str]:
        """The instruments that are excluded now."""
        return frozenset(self._exclusion.excluded)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        out = self._exclusion.excluded
        estimate = self._main.update(measurements)
        fading = exp(-max(measurements.time - self._time, 0.0) / _RECENT)
        self._note(self._main, estimate, fading)
        self._time = measurements.time
        for name in self._names:
            if name in out:
                continue
            left = [m for m in measurements.aids if m.instrument != name and m.instrument not in out]
            packet = Measurements(measurements.start, measurements.time, measurements.imu, left)
            for sub in self._pairs[name]:
                sub.estimate = sub.filter.update(packet)
                self._note(sub.filter, sub.estimate, fading)
        flagged = list(estimate.flagged)
        ratios = {name: self._separation(name, estimate) for name in self._names if name not in out}
        wrong = [name for name, ratio in ratios.items() if ratio > 1.0]
        diagnostics = dict(estimate.diagnostics)
        if wrong:
            guilty = min(wrong, key=self._disagreement)
            estimate = self._exclude(guilty)
            flagged += [(guilty, m.time) for m in measurements.aids if m.instrument == guilty]
        self._readmit(measurements.time)
        self._renew(measurements.time)
        diagnostics["protection_level"] = self._protection_level(estimate)
        for name in self._names:
            diagnostics[f"separation.{name}"] = ratios.get(name, np.nan)
            diagnostics[f"excluded.{name}"] = float(name in self._exclusion.excluded)
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        return estimate

    def _note(self, one: KalmanEstimator, estimate: Estimate, fading: float) -> None:
        """Take the NIS of a step into the means of a filter."""
        means = self._nis.setdefault(id(one), {})
        for name in self._names:
            nis = estimate.diagnostics.get(f"nis.{name}", np.nan)
            if nis == nis:
                means[name] = fading * means.get(name, 1.0) + (1.0 - fading) * float(nis) / self._components[name]

    def _disagreement(self, name: str) -> float:
        """The largest mean NIS of an instrument in the elder sub-filter without ``name``."""
        means = self._nis.get(id(self._elder(name).filter), {})
        used = [v for n, v in means.items() if n != name and n not in self._exclusion.excluded]
        return max(used, default=1.0)

    def _elder(self, name: str) -> _Without:
        return min(self._pairs[name], key=lambda sub: sub.begun)

    def _sigmas(self, sub: _Without, estimate: Estimate) -> tuple[Array, Array]:
        """Variances of a sub-filter's nine components, and of its separation."""
        assert sub.estimate is not None
        assert sub.estimate.covariance is not None
        assert estimate.covariance is not None
        main = estimate.covariance.diagonal()
        own = sub.estimate.covariance.diagonal()
        return own, np.maximum(own - main, 0.0) + _LINEARISATION**2 * main

    def _separation(self, name: str, estimate: Estimate) -> float:
        """The largest separation over its threshold, of all tested components and both sub-filters."""
        mask, largest = estimate.mask(), 0.0
        for sub in self._pairs[name]:
            assert sub.estimate is not None
            apart = difference(sub.estimate, estimate).tolist()
            _, variance = self._sigmas(sub, estimate)
            for q in _TESTED:
                if mask[q] and variance[q] > 0.0:
                    largest = max(largest, abs(apart[q]) / (self._threshold * sqrt(variance[q])))
        return largest

    def _exclude(self, name: str) -> Estimate:
        """Take the sub-filter without an instrument for the main filter; all others begin anew from it."""
        chosen = self._elder(name)
        assert chosen.estimate is not None
        self._exclusion.excluded.add(name)
        self._exclusion.agrees_since.pop(name, None)
        self._take_over(self._main, chosen.filter)
        for other in self._names:
            for k, sub in enumerate(self._pairs[other]):
                self._begin(sub, self._time - 0.5 * self.horizon * k, chosen.estimate)
        return copy.copy(chosen.estimate)

    def _readmit(self, time: float) -> None:
        """Use instruments again that have agreed for long enough."""
        for name, since in list(self._exclusion.agrees_since.items()):
            if time - since >= self.recovery:
                self._exclusion.excluded.discard(name)
                del self._exclusion.agrees_since[name]
                for k, sub in enumerate(self._pairs[name]):
                    self._begin(sub, time - 0.5 * self.horizon * k, None)

    def _renew(self, time: float) -> None:
        """Begin sub-filters anew that have come of age."""
        for name in self._names:
            for sub in self._pairs[name]:
                if time - sub.begun >= self.horizon and name not in self._exclusion.excluded:
                    self._begin(sub, time, None)

    def _begin(self, sub: _Without, time: float, estimate: Estimate | None) -> None:
        """Begin a sub-filter from the main filter's state."""
        self._take_over(sub.filter, self._main)
        sub.begun = time
        sub.estimate = estimate if estimate is not None else self._main.model.estimate(self._main.covariance)

    def _take_over(self, one: KalmanEstimator, other: KalmanEstimator) -> None:
        one.model.take_over(other.model)
        one.covariance[...] = other.covariance
        self._nis[id(one)] = dict(self._nis.get(id(other), {}))

    def _protection_level(self, estimate: Estimate) -> float:
        """The horizontal protection level [m]."""
        assert estimate.covariance is not None
        levels = []
        for q in (0, 1):
            level = self._quiet * sqrt(max(float(estimate.covariance[q, q]), 0.0))
            for name in self._names:
                if name in self._exclusion.excluded:
                    continue
                own, apart = self._sigmas(self._elder(name), estimate)
                level = max(level, self._threshold * sqrt(float(apart[q])) + self._missed * sqrt(float(own[q])))
            levels.append(level)
        return hypot(*levels)
