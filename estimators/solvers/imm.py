"""Interacting multiple models over the level of an instrument's noise."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, log, sqrt
from typing import ClassVar

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.adaptations.choice import Choice, choose_noise, keep_nominal
from simnav.estimators.adaptations.noise_report import NoiseReport
from simnav.estimators.adaptations.prediction import PredictionTest
from simnav.estimators.algebra.mixture import mixture_update
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import Array, Instruments

from .filter_step import correct
from .kalman import FilterFunctions, KalmanEstimator
from .smoother import Smoother

__all__ = ["ImmEstimator", "mix"]


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
        if smoother is not None and smoother.stepwise:
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

    def functions(self) -> FilterFunctions:
        """The prediction is tested, and the correction is a mixture."""
        functions = super().functions()
        correct = self.correct if self.smoother is not None else correct_by_mixture
        return functions.replaced(choose=choose_noise, correct=correct)

    def noise_choice(self, instruments: Instruments) -> Choice:
        """The levels as settings, and the probabilities of the levels as memories; at first the stationary ones."""
        values, vectors = np.linalg.eig(self.transition.T)
        first = np.real(vectors[:, int(np.argmax(np.real(values)))])
        probability, i = np.tile(first / first.sum(), (len(instruments), 1)), len(self._names)
        index = {name: k for k, name in enumerate(instruments)}
        return Choice(
            rule=keep_nominal, estimates=False, inflates_disturbed=False,
            index=np.array([index[name] for name in self._names], np.int64), in_scope=np.ones(i, np.bool_),
            last=np.zeros((i, 9)),
            settings=np.tile([*self._variances, *self.transition.ravel()], (len(instruments), 1)),
            memories=probability.ravel(), first=np.arange(0, probability.size + 1, len(self._variances)),
            common=np.empty(0), test=PredictionTest(instruments).record(self.model.size),
        )  # fmt: skip

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct by the mixture, and tell a smoother."""
        nis = correct_by_mixture(dynamics, choice, readings, k, prediction)
        if nis >= 0.0 and self.smoother is not None:
            self.smoother.use(dynamics.correction, self._linearised, prediction.noise)
        return nis

    def _reported_noise(self, instruments: Instruments) -> NoiseReport:
        """The roots of the expected variances, and the probabilities of the lowest level."""
        report = NoiseReport(instruments, self._names, "quiet", with_zero=True)
        report.rows["number"] = self._filter.choice.memories.reshape(len(instruments), -1)[:, 0]
        return report


@helper
def mix(
    dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction
) -> tuple[float, float, float]:
    """Correct the covariance by the mixture over the levels of an instrument, whose probabilities are updated.

    Returns
    -------
    nis, expected, evidence : float
        As of `simnav.estimators.algebra.mixture.mixture_update`.
    """
    i = choice.index[readings.instrument[k]]
    probability, count = choice.memories[choice.first[i] : choice.first[i + 1]], choice.first[i + 1] - choice.first[i]
    levels, transition = choice.settings[i, :count], choice.settings[i, count:].reshape((count, count))
    return mixture_update(
        dynamics.covariance, prediction.cross, prediction.predicted, prediction.nominal, prediction.innovation, levels,
        transition, probability, dynamics.correction,
    )  # fmt: skip


@kernel(passed=True)
def correct_by_mixture(dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
    """Correct the covariance by a mixture of levels; by the nominal noise where the prediction is wrong."""
    if readings.wrong[k]:
        readings.sigma[k, 0] = np.nan
        return correct(dynamics, choice, readings, k, prediction)
    nis, expected, _ = mix(dynamics, choice, readings, k, prediction)
    readings.reported[k] = choice.memories[choice.first[choice.index[readings.instrument[k]]]]
    for a in range(prediction.innovation.size):
        readings.sigma[k, a] = sqrt(expected * prediction.nominal[a, a])
    return nis


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
