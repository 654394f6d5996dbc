"""The filter of one hypothesis: it can be copied from another one, and says how probable the measurements were to it."""

from __future__ import annotations

from collections.abc import Sequence
import dataclasses
from copy import deepcopy
from math import log, pi

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.cholesky import factorise
from simnav.estimators.algebra.mixture import mixture_update
from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.adaptations.prediction import PredictionTest
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.kernel_types import Matrix
from simnav.types import Estimate, Measurement, Measurements

from .filter_step import correct
from .imm import ImmEstimator
from .kalman import FilterFunctions

__all__ = ["HypothesisFilter"]


@kernel
def log_density(nis: float, spread: Matrix) -> float:
    """Logarithm of the Gaussian density of an innovation, by its NIS and its (m, m) covariance; 0 if that is singular."""
    m = spread.shape[0]
    L, pivot, determinant = np.zeros((m, m)), np.empty(m), 0.0
    for r in range(m):
        for c in range(r + 1):
            L[r, c] = spread[r, c]
    if not factorise(L, m, 1e-14, pivot):
        return 0.0
    for r in range(m):
        determinant += log(pivot[r])
    return -0.5 * (nis + determinant + m * log(2.0 * pi))


@kernel(passed=True)
def correct_with_evidence(
    dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Correct as `correct_by_mixture`, and report the logarithm of the density of the innovation."""
    d = prediction.innovation.size
    if readings.wrong[k]:
        readings.sigma[k, 0] = np.nan
        nis = correct(dynamics, choice, readings, k, prediction)
        spread = np.empty((d, d))
        for a in range(d):
            for b in range(d):
                spread[a, b] = prediction.predicted[a, b] + prediction.noise[a, b]
        readings.reported[k] = log_density(nis, spread) if nis >= 0.0 else 0.0
        return nis
    i = choice.index[readings.instrument[k]]
    probability, count = choice.memories[choice.first[i] : choice.first[i + 1]], choice.first[i + 1] - choice.first[i]
    levels, transition = choice.settings[i, :count], choice.settings[i, count:].reshape((count, count))
    nis, _, evidence = mixture_update(
        dynamics.covariance, prediction.cross, prediction.predicted, prediction.nominal, prediction.innovation, levels,
        transition, probability, dynamics.correction,
    )  # fmt: skip
    readings.reported[k] = evidence
    return nis


class HypothesisFilter(ImmEstimator):
    """The filter of the module: `ImmEstimator`, whose noise of each instrument switches between levels.

    Attributes
    ----------
    evidence : float
        Logarithm of the density of the measurements of the last step.
    """

    evidence: float = 0.0

    highest_rate: float = 1.0

    def reset(self, start, instruments):
        super().reset(start, instruments)
        self._shares = {n: min(1.0, self.highest_rate / s.rate) for n, s in self.model.instruments.items()}

    def choice(self, instruments):
        return dataclasses.replace(super().choice(instruments), tested=PredictionTest(instruments, together=0).tested(0))

    def functions(self) -> FilterFunctions:
        """The correction is a mixture that reports its evidence."""
        return super().functions()._replace(correct=correct_with_evidence)

    def _report_choice(self, m: Measurement, sigma: Sequence[float], number: float) -> None:
        self.evidence += self._shares[m.instrument] * number

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements."""
        self.evidence = self.surprise = self.freedom = 0.0
        return super().update(measurements)

    def _note(self, m, nis, size, diagnostics):
        super()._note(m, nis, size, diagnostics)
        if nis >= 0.0:
            share = self._shares[m.instrument]
            self.surprise += share * nis
            self.freedom += share * len(m.value)

    def quiet(self) -> dict[str, float]:
        """Probability by instrument that its noise is that of its datasheet."""
        return {name: float(self._probability[name][0]) for name in self._names}

    def take_over(self, other: HypothesisFilter) -> None:
        """Copy the state of another filter of the same run, with all that it keeps."""
        self.model.take_over(other.model)
        self.model.take_over_doubt(other.model)
        self.covariance[...] = other.covariance
        mine, theirs = self._filter.choice, other._filter.choice
        mine.memories[...] = theirs.memories
        mine.last[...] = theirs.last
        self._admission._used.update(other._admission._used)
        self._innovation_test = deepcopy(other._innovation_test)
