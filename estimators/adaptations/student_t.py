"""Measurement noise with heavy tails: Student's t distribution, by variational Bayes."""

from __future__ import annotations

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.cholesky import factorise, invert_factor
from simnav.estimators.algebra.direct_update import posterior
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .noise import NoiseAdaptation

__all__ = ["StudentT", "normalised_trace", "student_t_noise", "student_weight"]


@helper
def _whitening(noise: Array, inverse: Array) -> bool:
    """Overwrite with the inverse of the Cholesky factor of R; whether R is positive definite."""
    m = noise.shape[0]
    L = noise.copy()
    definite: bool = factorise(L, m, 1e-14, np.empty(m))
    invert_factor(L, m, inverse)
    return definite


@helper
def _trace(inverse: Array, residual: Array, spread: Array) -> float:
    """As `normalised_trace`, given `_whitening`."""
    total = 0.0
    for r in range(residual.size):
        for i in range(r + 1):
            for j in range(r + 1):
                total += inverse[r, i] * inverse[r, j] * (residual[i] * residual[j] + spread[i, j])
    return total


@kernel
def normalised_trace(noise: Matrix, residual: Vector, spread: Matrix) -> float:
    """``tr(R^-1 (e e' + A))`` of a residual e and an (m, m) matrix A (``spread``); -1 if R is singular."""
    inverse = np.empty((residual.size, residual.size))
    return _trace(inverse, residual, spread) if _whitening(noise, inverse) else -1.0


@helper
def student_weight(innovation: Vector, predicted: Matrix, noise: Matrix, dof: float, iterations: int) -> float:
    """The weight w of a measurement; its noise is R / w (see `StudentT`).

    Parameters
    ----------
    innovation : (m,) array
        Measurement minus its prediction.
    predicted, noise : (m, m) arrays
        H P H' and R.
    dof : float
        Degrees of freedom of the t distribution.
    iterations : int
        Number of alternating updates of state and weight.
    """
    m = innovation.size
    residual, after, used, inverse = np.empty(m), np.empty((m, m)), np.empty((m, m)), np.empty((m, m))
    if not _whitening(noise, inverse):
        return 1.0
    weight = 1.0
    for _ in range(iterations):
        for i in range(m):
            for j in range(m):
                used[i, j] = noise[i, j] / weight
        if posterior(innovation, predicted, used, residual, after) < 0.0:
            return 1.0
        trace = _trace(inverse, residual, after)
        if trace < 0.0:
            return 1.0
        weight = (dof + m) / (dof + trace)
    return weight


#: Degrees of freedom, and number of iterations.
SETTINGS = structure(dof=float, iterations=int)


@kernel(passed=True)
def student_t_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Divide the nominal noise by `student_weight`, which is returned."""
    own = settings.view(SETTINGS)[0]
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    weight = student_weight(innovation, predicted, nominal, own.dof, own.iterations)
    for i in range(innovation.size):
        for j in range(innovation.size):
            noise[i, j] = nominal[i, j] / weight
    return weight


class StudentT(NoiseAdaptation):
    """The noise of every measurement has Student's t distribution, with the datasheet's covariance R as scale matrix.

    A variable with this distribution is Gaussian with the covariance ``R / w``, where w is gamma distributed,
    ``w ~ gamma(dof/2, dof/2)``. By variational Bayes, state and w are estimated alternately (with P+ of the last
    update)::

        w = (dof + m) / (dof + tr(R^-1 (e e' + H P+ H'))),    e: residual after an update with the noise R / w

    for a measurement of m components with the Jacobian H; P+ is the covariance after the update. Unlike
    `VariationalBayes` it has no memory: each weight depends on one measurement only. With infinitely many degrees of
    freedom the filter is the plain one.

    After the measurement model of Y. Huang, Y. Zhang, N. Li, Z. Wu and J. A. Chambers, *A novel robust Student's
    t-based Kalman filter*, IEEE Trans. Aerospace and Electronic Systems 53(3), 2017; the prediction stays Gaussian.
    M. Roth, E. Ozkan and F. Gustafsson, *A Student's t filter for heavy tailed process and measurement noise*, ICASSP
    2013, keep the whole state of that distribution; their correction is linear in the innovation.

    Parameters
    ----------
    dof : float
        Degrees of freedom, above 0: the fewer, the heavier the tails. Infinite: Gaussian.
    turns : int
        Number of alternating updates of state and weight for a measurement; at least 1.
    """

    rule = student_t_noise
    reported = "weight"

    def __init__(self, dof: float = 8.0, turns: int = 5):
        if not dof > 0.0:
            raise ValueError(f"dof = {dof:g}: it must be above 0")
        if turns < 1:
            raise ValueError(f"turns = {turns}: it must be at least 1")
        self.dof, self.turns = min(dof, 1e12), turns

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(SETTINGS, dof=self.dof, iterations=self.turns)
