"""Interacting multiple models over the level of an instrument's noise."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, exp, hypot, log, sqrt
from typing import ClassVar

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.prediction import PredictionTest
from simnav.estimators.algebra.cholesky import factorise, invert_factor
from simnav.estimators.models.channels import summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import KINDS, Array, Estimate, InitialState, Instruments, Measurement, Measurements

from .kalman import KalmanEstimator
from .smoother import Smoother

__all__ = ["ImmEstimator", "mixture_update"]


@kernel(
    "UniTuple(f8, 2)(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[::1])"
)
def mixture_update(
    covariance: Array, cross: Array, predicted: Array, noise: Array, residual: Array, variances: Array,
    transition: Array, probability: Array, correction: Array,
) -> tuple[float, float]:  # fmt: skip
    """Kalman update with every noise level, weighted by likelihood and merged by moments, in place.

    With ``S_j = H P H' + variances_j R``, ``y_j = S_j^-1 v`` and mu_j proportional to the probability of level j times
    N(v; 0, S_j): the correction is ``P H' sum(mu_j y_j)``, and ``P H' (sum(mu_j S_j^-1) - spread of y_j) H P`` is
    subtracted from P.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the state's error, updated.
    cross : (n, m) array
        P H', with the Jacobian H of the measurement.
    predicted, noise : (m, m) array
        H P H' and the nominal noise R.
    residual : (m,) array
        Innovation v.
    variances : (j,) array
        Variance of each level, as a multiple of R.
    transition : (j, j) array
        Probabilities of the transitions between levels from one measurement to the next.
    probability : (j,) array
        Probability of each level at the previous measurement; overwritten by that at this one.
    correction : (n,) array
        Overwritten with the correction of the state.

    Returns
    -------
    nis : float
        Normalised innovation squared of the first level; -1 if an S_j is singular, and then nothing is changed.
    expected : float
        Expected variance, as a multiple of R.
    """
    n, m = cross.shape
    count = variances.size
    inverses, solved = np.zeros((count, m, m)), np.zeros((count, m))
    likelihood, distance = np.empty(count), np.empty(count)
    L, W, pivot = np.zeros((m, m)), np.empty((m, m)), np.empty(m)  # W: L^-1
    for j in range(count):
        for r in range(m):
            for c in range(r + 1):
                L[r, c] = predicted[r, c] + variances[j] * noise[r, c]
        if not factorise(L, m, 1e-14, pivot):
            return -1.0, 0.0
        determinant = 0.0
        for r in range(m):
            determinant += log(pivot[r])
        invert_factor(L, m, W)
        for r in range(m):
            for c in range(m):
                x = 0.0
                for k in range(max(r, c), m):
                    x += W[k, r] * W[k, c]
                inverses[j, r, c] = x
        nis = 0.0
        for r in range(m):
            x = 0.0
            for c in range(m):
                x += inverses[j, r, c] * residual[c]
            solved[j, r] = x
            nis += x * residual[r]
        distance[j] = nis
        likelihood[j] = -0.5 * (nis + determinant)
    best = likelihood.max()
    total = 0.0
    for j in range(count):
        prior = 0.0
        for k in range(count):
            prior += probability[k] * transition[k, j]
        likelihood[j] = prior * exp(likelihood[j] - best)
        total += likelihood[j]
    if not total > 0.0:
        return -1.0, 0.0
    merged, expected = np.zeros(m), 0.0
    for j in range(count):
        probability[j] = likelihood[j] / total
        expected += probability[j] * variances[j]
        for r in range(m):
            merged[r] += probability[j] * solved[j, r]
    information = np.zeros((m, m))
    for j in range(count):
        for r in range(m):
            for c in range(m):
                apart = (solved[j, r] - merged[r]) * (solved[j, c] - merged[c])
                information[r, c] += probability[j] * (inverses[j, r, c] - apart)
    half = np.zeros((n, m))
    for r in range(n):
        correction[r] = 0.0
        for i in range(m):
            correction[r] += cross[r, i] * merged[i]
            for k in range(m):
                half[r, i] += cross[r, k] * information[k, i]
    for r in range(n):
        for c in range(r + 1):
            x = covariance[r, c]
            for i in range(m):
                x -= half[r, i] * cross[c, i]
            covariance[r, c] = x
            covariance[c, r] = x
    return distance[0], expected


class ImmEstimator(KalmanEstimator):
    """Kalman filter in which the noise of each instrument switches between levels, by a Markov chain of its own.

    Blom and Bar-Shalom (1988), "The interacting multiple model algorithm for systems with Markovian switching
    coefficients"; Bar-Shalom, Li and Kirubarajan (2001), section 11.6. The levels differ in R only, and the instruments
    switch independently, so with J levels and several instruments there would be one filter for each combination of
    levels. Here the J updates of a measurement share one prediction, and their results are merged, with the spread of
    their means, before the next measurement. The mode probabilities interact, but the mode-conditioned estimates are
    not kept (the first-order generalised pseudo-Bayesian form of the algorithm; it is equal to IMM if successive levels
    are independent). There is one propagation for any J.

    If the prediction is wrong (`PredictionTest`), the update of the plain filter is used.

    Diagnostics: ``sigma_<component>.<instrument>`` is the root of the expected variance; ``quiet.<instrument>`` the
    probability of the lowest level.

    Parameters
    ----------
    model, smoother
        Model and smoother of the filter, as for `KalmanEstimator`.
    levels : tuple of float
        Sigmas of the levels, as multiples of the nominal one; the first is 1. Empty: from ``highest`` and ``ratio``.
    highest : float
        Highest level, if ``levels`` is empty.
    ratio : float
        Largest ratio of neighbouring levels, if ``levels`` is empty. Closely spaced levels approximate a continuous
        distribution of the noise, uniform in its logarithm.
    stay : float
        Probability to stay at the lowest level from one measurement to the next.
    stay_high : float
        Probability to stay at each of the other levels; most transitions from them go to the lowest level.
    """

    pieces = ("model", "smoother")
    sets_aside: ClassVar[bool] = True
    takes_steps = False
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "adaptation": "the noise of each measurement is a mixture over its levels",
        "iteration": "the mixture is over one linearisation",
    }

    def __init__(
        self,
        model: ModelChoice,
        smoother: Smoother | None = None,
        *,
        levels: tuple[float, ...] = (),
        highest: float = 77.5,
        ratio: float = 1.5,
        stay: float = 0.992,
        stay_high: float = 0.675,
    ):
        super().__init__(model, smoother=smoother)
        if self._stepwise:
            raise ValueError(f"{type(smoother).__name__} needs one noise of a measurement; here it is a mixture")
        if not levels:
            if not (np.isfinite(highest) and highest > 1.0 and ratio > 1.0):
                raise ValueError(f"highest = {highest:g}, ratio = {ratio:g}: both must be above 1")
            levels = tuple(np.geomspace(1.0, highest, 1 + ceil(log(highest) / log(ratio) - 1e-9)).tolist())
        if len(levels) < 2 or list(levels) != sorted(set(levels)) or not levels[0] > 0.0:
            raise ValueError(f"levels = {', '.join(f'{x:g}' for x in levels)}: two or more, above 0 and rising")
        for name, p in (("stay", stay), ("stay_high", stay_high)):
            if not 0.0 < p < 1.0:
                raise ValueError(f"{name} = {p:g}: it must lie between 0 and 1")
        self._variances = np.square(np.array(levels, dtype=np.float64))
        self.transition = _chain(len(levels), stay, stay_high)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        instruments = by_source(instruments, self._choice, self.label)
        super().reset(start, instruments)
        self._prediction = PredictionTest(instruments)
        # The chain's stationary distribution
        values, vectors = np.linalg.eig(self.transition.T)
        first = np.real(vectors[:, int(np.argmax(np.real(values)))])
        self._probability = {name: first / first.sum() for name in self._names}
        self._report: dict[str, float | Array] = {}
        self._labels = {n: [f"sigma_{e}.{n}" for e in KINDS[s.kind].errors] for n, s in instruments.items()}
        for name in self._names:
            self._report.update(zip(self._labels[name], map(float, instruments[name].sigma)))
            self._report[f"quiet.{name}"] = float(self._probability[name][0])

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements."""
        estimate = super().update(measurements)
        estimate.diagnostics = {**estimate.diagnostics, **self._report, **summary(self._report, self._owners)}
        return estimate

    def _take(self, m: Measurement, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]) -> None:
        observation = self._observe(m)
        if observation is None:
            self._admission.skipped += 1
            return
        residual, cross, predicted, noise = observation
        if self._prediction.fails(Innovation(m, residual, predicted, noise)):
            super()._take(m, diagnostics, flagged)
            return
        probability = self._probability[m.instrument]
        nis, expected = mixture_update(
            self.covariance, cross, predicted, noise, residual, self._variances, self.transition, probability,
            self._correction,
        )  # fmt: skip
        if nis >= 0.0:
            self.model.correct(self._correction)
            for label, variance in zip(self._labels[m.instrument], noise.diagonal().tolist()):
                self._report[label] = sqrt(expected * variance)
            self._report[f"quiet.{m.instrument}"] = float(probability[0])
        self._note(m, nis, hypot(*residual.tolist()), diagnostics)


def _chain(n: int, stay: float, stay_high: float) -> Array:
    """(n, n) transition probabilities. Half of the transitions from a high level go to the lowest (all for n = 2)."""
    chain = np.full((n, n), (1.0 - stay) / (n - 1))
    chain[0, 0] = stay
    for i in range(1, n):
        others = n - 2
        down = (1.0 - stay_high) * (0.5 if others else 1.0)
        chain[i] = (1.0 - stay_high - down) / others if others else 0.0
        chain[i, 0], chain[i, i] = down, stay_high
    return chain
