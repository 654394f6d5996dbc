"""The Cholesky factor of a small covariance, its inverse, and what it solves, for all kernels that need one."""

from __future__ import annotations

from math import sqrt

from simnav.compiled import helper
from simnav.types import Array

__all__ = ["factorise", "invert_factor", "solve_factor"]


@helper
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


@helper
def solve_factor(L: Array, m: int, v: Array) -> None:
    """Overwrite the first m components of a vector with ``L^-1 v``.

    Parameters
    ----------
    L : (>= m, >= m) array
        As `factorise` leaves it. A component that has no pivot becomes zero.
    m : int
        Number of components.
    v : (>= m,) array
        Overwritten.
    """
    for i in range(m):
        x = v[i]
        for k in range(i):
            x -= L[i, k] * v[k]
        v[i] = x / L[i, i] if L[i, i] > 0.0 else 0.0


@helper
def invert_factor(L: Array, m: int, inverse: Array) -> None:
    """The inverse of a Cholesky factor.

    Parameters
    ----------
    L : (>= m, >= m) array
        As `factorise` leaves it.
    m : int
        Number of components.
    inverse : (m, m) array
        Overwritten: lower triangular, with a row of zeros for a component that has no pivot.
    """
    for i in range(m):
        for j in range(m):
            inverse[i, j] = 0.0
        if L[i, i] == 0.0:
            continue
        for j in range(i):
            x = 0.0
            for k in range(j, i):
                x -= L[i, k] * inverse[k, j]
            inverse[i, j] = x / L[i, i]
        inverse[i, i] = 1.0 / L[i, i]
