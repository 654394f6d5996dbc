"""The Cholesky factor of a small covariance, in place, for all kernels that need one."""

from __future__ import annotations

from math import sqrt

from simnav.compiled import kernel
from simnav.types import Array

__all__ = ["factorise"]


@kernel()
def factorise(L: Array, m: int, least: float, pivot: Array) -> bool:
    """Overwrite the lower triangle of a covariance with its Cholesky factor. The upper triangle is not changed.

    Parameters
    ----------
    L : (>= m, >= m) array
        The covariance; overwritten with the factor. A component that depends linearly on earlier ones gets a column of
        zeros.
    m : int
        Number of components of the covariance.
    least : float
        A pivot that is not larger than this fraction of its variance counts as zero.
    pivot : (>= m,) array
        Overwritten with the pivots: the squares of the factor's diagonal.

    Returns
    -------
    bool
        Whether all pivots are above zero: the covariance is positive definite.
    """
    definite = True
    for i in range(m):
        variance = L[i, i]
        for j in range(i + 1):
            x = L[i, j]
            for k in range(j):
                x -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = x / L[j, j] if L[j, j] > 0.0 else 0.0
            elif x > least * variance:
                L[i, i], pivot[i] = sqrt(x), x
            else:
                L[i, i], pivot[i] = 0.0, 0.0
                definite = False
    return definite
