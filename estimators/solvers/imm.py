"""Interacting multiple models over the level of an instrument's noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil, hypot, log, sqrt
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.adaptive_step import mixture_rule
from simnav.estimators.adaptations.base import Innovation
from simnav.estimators.adaptations.prediction import PredictionTest
from simnav.estimators.algebra.mixture import mixture_update
from simnav.estimators.models.base import REPORT, SIGMA, StepRule
from simnav.estimators.models.channels import summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import KINDS, Array, Estimate, InitialState, Instruments, Measurement, Measurements

from .kalman import KalmanEstimator
from .smoother import Smoother

__all__ = ["ImmEstimator"]


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
        self._report: dict[str, float | Array] = {}
        self._labels = {n: [f"sigma_{e}.{n}" for e in KINDS[s.kind].errors] for n, s in instruments.items()}
        for name in self._names:
            self._report.update(zip(self._labels[name], map(float, instruments[name].sigma)))
            self._report[f"quiet.{name}"] = float(self._probability[name][0])

    def _step_rule(self, instruments: Instruments) -> StepRule:
        self._prediction = PredictionTest(instruments)
        # The chain's stationary distribution
        values, vectors = np.linalg.eig(self.transition.T)
        first = np.real(vectors[:, int(np.argmax(np.real(values)))])
        probability = np.tile(first / first.sum(), (len(instruments), 1))
        self._probability = dict(zip(instruments, probability, strict=True))
        return mixture_rule(
            self._variances, self.transition, probability, self._names, self._prediction, self._first_variances
        )

    def _reporter(self) -> Callable[[str, Sequence[float]], None]:
        return self._noted

    def _noted(self, name: str, row: Sequence[float]) -> None:
        if row[SIGMA] == row[SIGMA]:
            self._report.update(zip(self._labels[name], row[SIGMA:]))
            self._report[f"quiet.{name}"] = row[REPORT]

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements."""
        estimate = super().update(measurements)
        means = summary(self._report, self._owners) if self._owners else {}
        estimate.diagnostics = {**estimate.diagnostics, **self._report, **means}
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
