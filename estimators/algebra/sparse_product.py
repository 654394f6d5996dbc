"""The product of a sparse matrix, whose non-zero elements are listed, and a dense one, eight columns at a time.

The sums of eight columns stay in registers while the elements of a row are gone through. The terms are added in the
order in which the elements are listed.
"""

from __future__ import annotations

from typing import TypeAlias

from simnav.compiled import kernel
from simnav.types import Array, Integers

__all__ = ["Eight", "add_eight", "eight_sums"]

Eight: TypeAlias = tuple[float, float, float, float, float, float, float, float]


@kernel()
def eight_sums(value: Array, column: Integers, i: int, count: int, M: Array, j: int, start: Eight) -> Eight:
    """Row i of the product, columns j to j + 7, added to ``start``.

    Parameters
    ----------
    value, column : (m, k) arrays
        The elements of each row that are not zero, and their columns.
    i, count : int
        The row, and the number of its elements.
    M : (k, w) array
        Dense matrix.
    j : int
        First of eight columns of M.
    start : tuple of float
        What the sums begin with.
    """
    s0, s1, s2, s3, s4, s5, s6, s7 = start
    for q in range(count):
        x, k = value[i, q], column[i, q]
        s0 += x * M[k, j]
        s1 += x * M[k, j + 1]
        s2 += x * M[k, j + 2]
        s3 += x * M[k, j + 3]
        s4 += x * M[k, j + 4]
        s5 += x * M[k, j + 5]
        s6 += x * M[k, j + 6]
        s7 += x * M[k, j + 7]
    return s0, s1, s2, s3, s4, s5, s6, s7


@kernel()
def add_eight(M: Array, i: int, j: int, s: Eight) -> None:
    """Add eight sums to row i of M, from column j on."""
    M[i, j] += s[0]
    M[i, j + 1] += s[1]
    M[i, j + 2] += s[2]
    M[i, j + 3] += s[3]
    M[i, j + 4] += s[4]
    M[i, j + 5] += s[5]
    M[i, j + 6] += s[6]
    M[i, j + 7] += s[7]
