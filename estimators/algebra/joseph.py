"""The Kalman update in Joseph's form, as kernels.

Joseph's form stays symmetric and positive semi-definite for any gain (G. J. Bierman, *Factorization Methods for
Discrete Sequential Estimation*, 1977).
"""

from __future__ import annotations

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import Matrix, Stack, Vector

from .cholesky import factorise, solve_factor

__all__ = ["joseph_sequence", "joseph_update", "project"]


@kernel
def project(covariance: Matrix, jacobian: Matrix, cross: Matrix, predicted: Matrix) -> None:
    """Compute ``P H'`` and ``H P H'``, the covariance of a predicted measurement.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the state's error, symmetric.
    jacobian : (m, n) array
        Jacobian H of the measurement; its zeros are skipped.
    cross : (n, m) array
        Overwritten with P H'.
    predicted : (m, m) array
        Overwritten with H P H'.
    """
    m, n = jacobian.shape
    column = np.empty(n)
    for i in range(m):
        for r in range(n):
            column[r] = 0.0
        for c in range(n):
            x = jacobian[i, c]
            if x != 0.0:
                for r in range(n):
                    column[r] += x * covariance[c, r]
        for r in range(n):
            cross[r, i] = column[r]
    for i in range(m):
        for k in range(m):
            predicted[i, k] = 0.0
        for c in range(n):
            x = jacobian[i, c]
            if x != 0.0:
                for k in range(m):
                    predicted[i, k] += x * cross[c, k]


@kernel
def joseph_update(
    covariance: Matrix, cross: Matrix, innovation_covariance: Matrix, residual: Vector, correction: Vector
) -> float:
    """Kalman gain, correction and Joseph-form update of the covariance, in place.

    With S = H P H' + R and K = P H' S^-1, Joseph's (I - K H) P (I - K H)' + K R K' is, multiplied out,
    ``P - K (P H')' - (P H') K' + K S K'``.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the state's error, updated.
    cross : (n, m) array
        P H', with the Jacobian H of the measurement.
    innovation_covariance : (m, m) array
        Covariance S of the innovation.
    residual : (m,) array
        Innovation: the measurement minus its prediction.
    correction : (n,) array
        Overwritten with the correction of the state, K times the innovation.

    Returns
    -------
    float
        Normalised innovation squared; -1 if S is singular, and then nothing is changed.
    """
    n, m = cross.shape
    L, white = innovation_covariance.copy(), np.empty(m)
    if not factorise(L, m, 1e-14, white):
        return -1.0
    # Whitened: U = P H' L^-T, so that K S K' = U U', K (P H')' = U U'; Joseph's sum needs the gain K = U L^-1.
    # The inner loops are those over the states, on rows of transposed matrices: they use vector instructions.
    projected, gain, spread = np.empty((m, n)), np.empty((m, n)), np.empty((m, n))
    for i in range(m):
        for r in range(n):
            projected[i, r] = gain[i, r] = cross[r, i]
        for k in range(i):
            x = L[i, k]
            for r in range(n):
                gain[i, r] -= x * gain[k, r]
        x = L[i, i]
        for r in range(n):
            gain[i, r] /= x
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            x = L[k, i]
            for r in range(n):
                gain[i, r] -= x * gain[k, r]
        x = L[i, i]
        for r in range(n):
            gain[i, r] /= x
    for i in range(m):
        white[i] = residual[i]
    solve_factor(L, m, white)
    nis = 0.0
    for i in range(m):
        nis += white[i] * white[i]
    for r in range(n):
        correction[r] = 0.0
    for i in range(m):
        x = residual[i]
        for r in range(n):
            correction[r] += gain[i, r] * x
        for r in range(n):
            spread[i, r] = -projected[i, r]  # K S - P H'
        for k in range(m):
            x = innovation_covariance[k, i]
            for r in range(n):
                spread[i, r] += gain[k, r] * x
    for r in range(n):
        if m == 2:  # in one pass
            s, t, u, v = spread[0, r], spread[1, r], gain[0, r], gain[1, r]
            for c in range(r + 1):
                first, second = s * gain[0, c] - u * projected[0, c], t * gain[1, c] - v * projected[1, c]
                covariance[r, c] = covariance[r, c] + first + second
        else:
            for i in range(m):
                x, y = spread[i, r], gain[i, r]
                for c in range(r + 1):
                    covariance[r, c] += x * gain[i, c] - y * projected[i, c]
        for c in range(r):
            covariance[c, r] = covariance[r, c]
    return nis


@kernel
def joseph_sequence(
    covariance: Matrix, residual: Matrix, jacobian: Stack, noise: Stack, correction: Vector, nis: Vector, size: Vector
) -> None:
    """Apply `joseph_update` with k independent measurements, one after the other, linearised at one state.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the state's error, updated.
    residual : (k, m) array
        The measurements minus their predictions at the state.
    jacobian : (k, m, n) array
        Jacobians H of the predictions.
    noise : (k, m, m) array
        Covariances R of the noise.
    correction : (n,) array
        Overwritten with the correction of the state by all of them.
    nis, size : (k,) array
        Overwritten with the normalised square of each innovation given those before it, -1 for a measurement that was
        not used because its covariance is singular, and with its norm.
    """
    k, m, n = jacobian.shape
    innovation, cross, predicted, step = np.empty(m), np.empty((n, m)), np.empty((m, m)), np.empty(n)
    correction[:] = 0.0
    for j in range(k):
        squared = 0.0
        for i in range(m):
            x = residual[j, i]
            for c in range(n):
                x -= jacobian[j, i, c] * correction[c]
            innovation[i] = x
            squared += x * x
        project(covariance, jacobian[j], cross, predicted)
        for i in range(m):
            for c in range(m):
                predicted[i, c] += noise[j, i, c]
        nis[j], size[j] = joseph_update(covariance, cross, predicted, innovation, step), np.sqrt(squared)
        if nis[j] >= 0.0:
            for c in range(n):
                correction[c] += step[c]
