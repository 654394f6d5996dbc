"""The update of a Kalman filter whose noise has one of several levels, as a kernel.

Source: Y. Bar-Shalom, X. R. Li and T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 11.6.
"""

from __future__ import annotations

from math import exp, log, pi

import numpy as np

from simnav.compiled import helper
from simnav.kernel_types import Matrix, Vector

from .cholesky import factorise, invert_factor

__all__ = ["mixture_update"]


@helper
def mixture_update(
    covariance: Matrix,
    cross: Matrix,
    predicted: Matrix,
    noise: Matrix,
    residual: Vector,
    variances: Vector,
    transition: Matrix,
    probability: Vector,
    correction: Vector,
) -> tuple[float, float, float]:
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
    evidence : float
        Logarithm of the density of the innovation, over all levels.
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
            return -1.0, 0.0, 0.0
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
    best, total = likelihood[0], 0.0
    for j in range(1, count):
        best = max(best, likelihood[j])
    for j in range(count):
        prior = 0.0
        for k in range(count):
            prior += probability[k] * transition[k, j]
        likelihood[j] = prior * exp(likelihood[j] - best)
        total += likelihood[j]
    if not total > 0.0:
        return -1.0, 0.0, 0.0
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
    return distance[0], expected, best + log(total) - 0.5 * m * log(2.0 * pi)
