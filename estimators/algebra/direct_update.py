"""The Kalman update of a state of up to three components that is observed directly, as kernels.

This is the update of a filter's state in the components of one measurement: with H P H' in place of P, and the unit
matrix in place of H. It has the bits of `simnav.estimators.algebra.joseph.joseph_update`, in a third of the time: loops
over three elements take longer than their arithmetic, so the components are written side by side. Those that are not
there are zeros.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

__all__ = ["normalised_square", "posterior"]

#: A pivot that is not larger than this fraction of its variance counts as zero.
LEAST = 1e-14


class _Factor(NamedTuple):
    """The lower triangle of a Cholesky factor of at most three rows, and whether it exists."""

    definite: bool
    a00: float
    a10: float
    a11: float
    a20: float
    a21: float
    a22: float


@helper
def _factor(predicted: Array, noise: Array) -> _Factor:
    """Whether ``S = H P H' + R`` is positive definite, and the rows of its Cholesky factor."""
    m = predicted.shape[0]
    a10, a11, a20, a21, a22 = 0.0, 1.0, 0.0, 0.0, 1.0
    variance = predicted[0, 0] + noise[0, 0]
    if not variance > LEAST * variance:
        return _Factor(False, 0.0, a10, a11, a20, a21, a22)
    a00 = sqrt(variance)
    if m > 1:
        a10 = (predicted[1, 0] + noise[1, 0]) / a00
        variance = predicted[1, 1] + noise[1, 1]
        pivot = variance - a10 * a10
        if not pivot > LEAST * variance:
            return _Factor(False, a00, a10, a11, a20, a21, a22)
        a11 = sqrt(pivot)
    if m > 2:
        a20 = (predicted[2, 0] + noise[2, 0]) / a00
        a21 = (predicted[2, 1] + noise[2, 1] - a20 * a10) / a11
        variance = predicted[2, 2] + noise[2, 2]
        pivot = variance - a20 * a20 - a21 * a21
        if not pivot > LEAST * variance:
            return _Factor(False, a00, a10, a11, a20, a21, a22)
        a22 = sqrt(pivot)
    return _Factor(True, a00, a10, a11, a20, a21, a22)


@helper
def _square(innovation: Array, factor: _Factor) -> float:
    """``v' S^-1 v``, given the factor of S."""
    m = innovation.size
    w0 = innovation[0] / factor.a00
    w1 = (innovation[1] - factor.a10 * w0) / factor.a11 if m > 1 else 0.0
    w2 = (innovation[2] - factor.a20 * w0 - factor.a21 * w1) / factor.a22 if m > 2 else 0.0
    square: float = w0 * w0 + w1 * w1 + w2 * w2
    return square


@kernel
def normalised_square(innovation: Vector, predicted: Matrix, noise: Matrix) -> float:
    """Normalised innovation squared ``v' S^-1 v`` with ``S = H P H' + R``; -1 if S is singular."""
    factor = _factor(predicted, noise)
    return _square(innovation, factor) if factor.definite else -1.0


@kernel
def posterior(innovation: Vector, predicted: Matrix, noise: Matrix, residual: Vector, after: Matrix) -> float:
    """Residual and covariance of the prediction after an update, in the m components of the measurement.

    With ``S = H P H' + R`` they are ``v - H P H' S^-1 v`` and ``H P+ H' = H P H' - H P H' S^-1 H P H'``.

    Parameters
    ----------
    innovation : (m,) array
        v, the measurement minus its prediction; m is at most 3.
    predicted, noise : (m, m) arrays
        H P H' (covariance of the prediction) and R (covariance of the measurement noise).
    residual : (m,) array
        Overwritten with the residual after the update.
    after : (m, m) array
        Overwritten with H P+ H'.

    Returns
    -------
    float
        Normalised innovation squared ``v' S^-1 v``; -1 if S is singular, and then there is no update.
    """
    m = innovation.size
    factor = _factor(predicted, noise)
    if not factor.definite:
        for r in range(m):
            residual[r] = innovation[r]
            for c in range(m):
                after[r, c] = predicted[r, c]
        return -1.0
    square = _square(innovation, factor)
    a00, a10, a11, a20, a21, a22 = factor.a00, factor.a10, factor.a11, factor.a20, factor.a21, factor.a22
    v0, v1, v2 = innovation[0], innovation[1] if m > 1 else 0.0, innovation[2] if m > 2 else 0.0
    gains = np.zeros((3, 3))
    for r in range(m):  # gain of component r, and K S - P H'
        p0, p1, p2 = predicted[r, 0], predicted[r, 1] if m > 1 else 0.0, predicted[r, 2] if m > 2 else 0.0
        g0 = p0 / a00
        g1 = (p1 - a10 * g0) / a11
        g2 = (p2 - a20 * g0 - a21 * g1) / a22 / a22
        g1 = (g1 - a21 * g2) / a11
        g0 = (g0 - a10 * g1 - a20 * g2) / a00
        gains[r, 0], gains[r, 1], gains[r, 2] = g0, g1, g2
        residual[r] = innovation[r] - (g0 * v0 + g1 * v1 + g2 * v2) if square >= 0.0 else innovation[r]
        s0, s1, s2 = -p0, -p1, -p2
        for k in range(m):
            g = gains[r, k]
            s0 += g * (predicted[k, 0] + noise[k, 0])
            if m > 1:
                s1 += g * (predicted[k, 1] + noise[k, 1])
            if m > 2:
                s2 += g * (predicted[k, 2] + noise[k, 2])
        for c in range(r + 1):
            q0, q1, q2 = predicted[c, 0], predicted[c, 1] if m > 1 else 0.0, predicted[c, 2] if m > 2 else 0.0
            x = predicted[r, c] + (s0 * gains[c, 0] - g0 * q0)
            x += s1 * gains[c, 1] - g1 * q1
            after[r, c] = after[c, r] = x + (s2 * gains[c, 2] - g2 * q2)
    return square
