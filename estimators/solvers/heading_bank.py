"""An EKF for each of several initial headings, until the measurements decide which one is right.

The error equations of an EKF are linear in the attitude error, which is valid up to about twenty degrees. A start
without a known heading is outside of this range: a single filter with a standard deviation of 100 degrees linearises
about the wrong heading and may converge to a wrong one. So the initial density of the heading is written as a mixture
of narrow Gaussians around the circle, and each has a filter of its own. The weight of a filter is multiplied by the
likelihood of every innovation v, N(v; 0, S), with the innovation covariance S. A filter with a negligible weight is
removed. If two filters reach the same heading, one of them is removed, and the other gets its weight. The last
remaining filter is the plain EKF.

The estimate is the mean of the mixture, and its covariance includes the spread between the filters. To limit the
influence of a gross error, a normalised innovation squared is limited to its `_CLIP` quantile.

If the initial heading is known to ``above_deg`` or better, there is one filter from the beginning.

Source: D. T. Magill, *Optimal adaptive estimation of sampled stochastic processes*, IEEE TAC 10(4), 1965; H. W.
Sorenson and D. L. Alspach, *Recursive Bayesian estimation using Gaussian sums*, Automatica 7(4), 1971; for large
heading errors B. M. Scherzinger, *Inertial navigator error models for large heading uncertainty*, PLANS 1996.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, exp, log, pi, radians, sqrt
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.composition import Solver
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.inertial_errors import ERROR
from simnav.estimators.models.suitable import ModelChoice
from simnav.geometry.rotation import wrap_angle
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

from .kalman import FilterFunctions, KalmanEstimator
from .state_difference import mean_of

__all__ = ["HeadingBank", "first_of_each_heading", "initial_headings", "starts_by_heading"]

#: Smallest probability of a measurement in the likelihood.
_CLIP = 0.9999
#: A filter with a smaller weight than this is removed.
_LEAST = 1e-4
#: Sigma of a filter's heading over the distance to the next filter, at the start.
_OVERLAP = 0.6
#: Two filters are the same where their headings differ by less than this part of their sigma.
_SAME = 0.5


def initial_headings(sigma: float, spacing: float) -> tuple[Array, Array]:
    """Offsets from the initial heading, and the weights of a mixture of Gaussians there.

    Parameters
    ----------
    sigma : float
        Standard deviation of the initial heading [rad].
    spacing : float
        Largest distance between neighbours [rad].

    Returns
    -------
    offsets, weights : (k,) array
        Offsets within three sigma on both sides, or once round the circle [rad], and weights that sum to 1.
    """
    if 6.0 * sigma >= 2.0 * pi:
        count = ceil(2.0 * pi / spacing)
        offsets = np.asarray(wrap_angle(2.0 * pi / count * np.arange(count, dtype=np.float64)))
    else:
        count = 2 * ceil(3.0 * sigma / spacing) + 1
        offsets = np.linspace(-3.0 * sigma, 3.0 * sigma, count)
    turns = offsets[:, None] + 2.0 * pi * np.arange(-4, 5)
    weights = np.exp(-0.5 * np.square(turns / sigma)).sum(axis=1)
    return offsets, weights / weights.sum()


def starts_by_heading(start: InitialState, above: float, spacing: float) -> list[tuple[InitialState, float]]:
    """The start as a mixture of starts whose headings are known well enough to be linearised at.

    Parameters
    ----------
    start : InitialState
        The start.
    above : float
        The start itself is returned, if its heading's standard deviation is not above this [rad].
    spacing : float
        Largest distance between neighbouring headings [rad].

    Returns
    -------
    list of (InitialState, float)
        The starts, and their weights, which sum to 1.
    """
    sigma = sqrt(float(start.covariance[ERROR.heading, ERROR.heading]))
    if sigma <= above:
        return [(start, 1.0)]
    offsets, weights = initial_headings(sigma, spacing)
    narrow, starts = min(1.0, _OVERLAP * _step(offsets) / sigma), []
    for offset, weight in zip(offsets.tolist(), weights.tolist(), strict=True):
        covariance = start.covariance.copy()
        covariance[ERROR.heading] *= narrow
        covariance[:, ERROR.heading] *= narrow
        attitude = np.asarray(wrap_angle(start.attitude + np.array([0.0, 0.0, offset])))
        starts.append((replace(start, attitude=attitude, covariance=covariance), weight))
    return starts


def first_of_each_heading(estimates: Sequence[Estimate]) -> list[int]:
    """For each of the estimates the index of the first that has the same heading: its own, if there is none before."""
    firsts = list[int]()
    for k, one in enumerate(estimates):
        before = dict.fromkeys(firsts)
        firsts.append(next((i for i in before if _same_heading(one, estimates[i])), k))
    return firsts


def _same_heading(one: Estimate, other: Estimate) -> bool:
    """Whether the headings of two estimates differ by less than `_SAME` of the smaller one of their sigmas."""
    assert one.attitude is not None
    assert other.attitude is not None
    assert one.covariance is not None
    assert other.covariance is not None
    at = (ERROR.heading, ERROR.heading)
    variance = min(float(one.covariance[at]), float(other.covariance[at]))
    return abs(float(wrap_angle(one.attitude[2] - other.attitude[2]))) < _SAME * sqrt(max(variance, 0.0))


class _Scored(KalmanEstimator):
    """The filter, with the logarithm of the likelihood of its innovations."""

    log_likelihood: float

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(start, instruments)
        self.log_likelihood = 0.0
        self._limits = chi_square_limits(_CLIP)

    def functions(self) -> FilterFunctions:
        """The correction scores the innovation."""
        return super().functions().replaced(correct=self.correct)

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct the covariance, and add the logarithm of the innovation's likelihood."""
        spread = 2.0 * pi * (prediction.predicted + prediction.noise)
        nis = super().correct(dynamics, choice, readings, k, prediction)
        if nis >= 0.0:
            determinant = float(np.linalg.det(spread))
            if determinant > 0.0:
                self.log_likelihood -= 0.5 * (min(nis, self._limits[len(prediction.innovation)]) + log(determinant))
        return nis


@dataclass
class _Hypothesis:
    filter: KalmanEstimator
    weight: float
    estimate: Estimate | None = None


class HeadingBank(Solver):
    """The solver of the module.

    The diagnostic ``hypotheses`` is the number of filters that are left.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        The model of each filter.
    above_deg : float
        A bank is used if the standard deviation of the initial heading is above this [deg].
    spacing_deg : float
        Largest distance between neighbouring initial headings [deg].
    """

    pieces: ClassVar[tuple[str, ...]] = ("model",)
    searches_heading: ClassVar[bool] = True
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "iteration": "its filters begin at headings that are near enough to be linearised at",
        "adaptation": "an adapted noise would decide the likelihood of a heading",
        "smoother": "a filter that is dropped leaves no trajectory",
    }

    def __init__(self, model: ModelChoice, above_deg: float = 15.0, spacing_deg: float = 20.0):
        if not above_deg > 0.0:
            raise ValueError(f"above_deg = {above_deg:g}: it must be above 0")
        if not 1.0 <= spacing_deg <= 90.0:
            raise ValueError(f"spacing_deg = {spacing_deg:g}: it must lie between 1 and 90")
        self._model_choice, self.above_deg, self.spacing_deg = model, above_deg, spacing_deg
        self._hypotheses: list[_Hypothesis] = []

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        starts = starts_by_heading(start, radians(self.above_deg), radians(self.spacing_deg))
        kind = KalmanEstimator if len(starts) == 1 else _Scored
        self._hypotheses = []
        for own, weight in starts:
            one = kind(copy.deepcopy(self._model_choice))
            one.row = self.label
            one.reset(own, instruments)
            self._hypotheses.append(_Hypothesis(one, weight))

    @property
    def best(self) -> KalmanEstimator:
        """The filter of the largest weight."""
        return max(self._hypotheses, key=lambda h: h.weight).filter

    @property
    def covariance(self) -> Array:
        """(n, n) covariance of the filter of the largest weight."""
        return self.best.covariance

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        several = len(self._hypotheses) > 1
        for h in self._hypotheses:
            h.estimate = h.filter.update(measurements)
        if several:
            self._judge()
        first = max(self._hypotheses, key=lambda h: h.weight)
        assert first.estimate is not None
        estimate = first.estimate if len(self._hypotheses) == 1 else self._mean(first)
        estimate.diagnostics = {**estimate.diagnostics, "hypotheses": float(len(self._hypotheses))}
        return estimate

    def _judge(self) -> None:
        """Update the weights by the likelihoods; remove filters with negligible weights, and duplicates."""
        logs = []
        for h in self._hypotheses:
            assert isinstance(h.filter, _Scored)
            logs.append(log(h.weight) + h.filter.log_likelihood)
            h.filter.log_likelihood = 0.0
        best = max(logs)
        weights = np.array([exp(x - best) for x in logs])
        weights /= weights.sum()
        for h, weight in zip(self._hypotheses, weights.tolist(), strict=True):
            h.weight = weight
        first, *others = sorted(self._hypotheses, key=lambda h: -h.weight)
        left = [first, *(h for h in others if h.weight >= _LEAST)]
        kept: list[_Hypothesis] = []
        for h, k in zip(left, first_of_each_heading([h.estimate for h in left if h.estimate is not None]), strict=True):
            if left[k] is h:
                kept.append(h)
            else:
                left[k].weight += h.weight
        total = sum(h.weight for h in kept)
        for h in kept:
            h.weight /= total
        self._hypotheses = kept

    def _mean(self, first: _Hypothesis) -> Estimate:
        """The mean of the mixture and its covariance, in the tangent space of the most probable filter."""
        ordered = [first, *(h for h in self._hypotheses if h is not first)]
        estimates = [h.estimate for h in ordered if h.estimate is not None]
        return mean_of(estimates, np.array([h.weight for h in ordered]))


def _step(offsets: Array) -> float:
    """Distance between neighbours on the circle [rad]."""
    return float(abs(wrap_angle(offsets[1] - offsets[0])))
