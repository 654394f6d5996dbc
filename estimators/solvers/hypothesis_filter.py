"""The filter of one hypothesis: it can be copied from another one, and says how probable the measurements were to it."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from math import log, pi

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.cholesky import factorise
from simnav.estimators.algebra.mixture import mixture_update
from simnav.estimators.adaptations.choice import Choice
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

    together: int = 3

    def choice(self, instruments):
        own = super().choice(instruments)
        from simnav.estimators.adaptations.prediction import PredictionTest
        import dataclasses
        return dataclasses.replace(own, tested=PredictionTest(instruments, together=self.together).tested(self.model.size))

    def functions(self) -> FilterFunctions:
        """The correction is a mixture that reports its evidence."""
        return super().functions()._replace(correct=correct_with_evidence)

    def _report_choice(self, m: Measurement, sigma: Sequence[float], number: float) -> None:
        self.evidence += number

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements."""
        self.evidence = 0.0
        return super().update(measurements)

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
        for name, value in _arrays(theirs.tested):
            getattr(mine.tested, name)[...] = value
        for name, value in _arrays(theirs.tested.courses):
            getattr(mine.tested.courses, name)[...] = value
        self._innovation_test = deepcopy(other._innovation_test)


def _arrays(record: object) -> list[tuple[str, np.ndarray]]:
    """The arrays of a record or a named tuple."""
    names = getattr(record, "numba_fields", None) or record._fields
    return [(n, v) for n in names if isinstance(v := getattr(record, n), np.ndarray)]
