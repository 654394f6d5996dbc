"""Products with a dense matrix, eight columns at a time: of a sparse matrix with listed elements, and of a vector.

The sums of eight columns stay in one vector register while the terms are added, in the order in which the elements are
listed. Indices are unsigned: of a signed one the compiler has to ask whether it counts from the end, and then it does
not see that eight elements lie side by side.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import helper
from simnav.types import Array

__all__ = [
    "Places", "add_eight", "add_product", "eight_of", "eight_sums", "list_elements", "padded", "sparse_product",
]  # fmt: skip

#: An unsigned index or number of elements, and many.
Place: TypeAlias = int | np.uint64
Places: TypeAlias = NDArray[np.uint64]
_0, _1, _2, _3, _4, _5, _6, _7, _8 = (np.uint64(i) for i in range(9))


class Eight(NamedTuple):
    """Eight numbers in one vector register."""

    s0: float
    s1: float
    s2: float
    s3: float
    s4: float
    s5: float
    s6: float
    s7: float


NOTHING = Eight(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@helper
def padded(n: int) -> int:
    """The next multiple of eight."""
    return 8 * ((n + 7) // 8)


@helper
def list_elements(F: Array, value: Array, column: Places, count: Places) -> None:
    """List the elements of an (m, n) matrix that are not zero, their columns, and how many there are in each row."""
    for i in range(np.uint64(F.shape[0])):
        q = _0
        for k in range(np.uint64(F.shape[1])):
            value[i, q], column[i, q] = F[i, k], k
            q += np.uint64(F[i, k] != 0.0)
        count[i] = q


@helper
def eight_sums(value: Array, column: Places, i: Place, count: Place, M: Array, j: Place, s: Eight) -> Eight:
    """Row i of the product, columns j to j + 7, added to eight sums.

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
    s : Eight
        What the sums begin with.
    """
    s0, s1, s2, s3, s4, s5, s6, s7 = s
    for q in range(count):
        x, k = value[i, q], column[i, q]
        s0 += x * M[k, j]
        s1 += x * M[k, j + _1]
        s2 += x * M[k, j + _2]
        s3 += x * M[k, j + _3]
        s4 += x * M[k, j + _4]
        s5 += x * M[k, j + _5]
        s6 += x * M[k, j + _6]
        s7 += x * M[k, j + _7]
    return Eight(s0, s1, s2, s3, s4, s5, s6, s7)


@helper
def eight_of(row: Array, j: Place) -> Eight:
    """Eight elements of a row, from j on."""
    return Eight(row[j], row[j + _1], row[j + _2], row[j + _3], row[j + _4], row[j + _5], row[j + _6], row[j + _7])


@helper
def put_eight(row: Array, j: Place, s: Eight) -> None:
    """Overwrite eight elements of a row, from j on."""
    row[j], row[j + _1], row[j + _2], row[j + _3] = s.s0, s.s1, s.s2, s.s3
    row[j + _4], row[j + _5], row[j + _6], row[j + _7] = s.s4, s.s5, s.s6, s.s7


@helper
def add_eight(row: Array, j: Place, s: Eight) -> None:
    """Add eight sums to a row, from element j on."""
    t = eight_of(row, j)
    put_eight(
        row, j,
        Eight(t.s0 + s.s0, t.s1 + s.s1, t.s2 + s.s2, t.s3 + s.s3, t.s4 + s.s4, t.s5 + s.s5, t.s6 + s.s6, t.s7 + s.s7),
    )  # fmt: skip


@helper
def sparse_product(value: Array, column: Places, count: Places, M: Array, out: Array) -> None:
    """The product of a matrix in lists (`eight_sums`) and M; M and ``out`` have a multiple of eight columns."""
    for i in range(np.uint64(count.size)):
        for j in range(_0, np.uint64(M.shape[1]), _8):
            put_eight(out[i], j, eight_sums(value, column, i, count[i], M, j, NOTHING))


@helper
def _eight_columns(M: Array, x: Array, j: Place, total: Array) -> Eight:
    """Elements j to j + 7 of ``total + M' x``, row by row."""
    s0, s1, s2, s3, s4, s5, s6, s7 = eight_of(total, j)
    for k in range(np.uint64(x.size)):
        a = x[k]
        s0 += M[k, j] * a
        s1 += M[k, j + _1] * a
        s2 += M[k, j + _2] * a
        s3 += M[k, j + _3] * a
        s4 += M[k, j + _4] * a
        s5 += M[k, j + _5] * a
        s6 += M[k, j + _6] * a
        s7 += M[k, j + _7] * a
    return Eight(s0, s1, s2, s3, s4, s5, s6, s7)


@helper
def add_product(M: Array, x: Array, total: Array) -> None:
    """Compute ``total += M' x`` for an (n, n) matrix, row by row."""
    n = x.size
    if n < 8:
        for k in range(n):
            for j in range(n):
                total[j] += M[k, j] * x[k]
        return
    last = np.uint64(n - 8)
    end = _eight_columns(M, x, last, total)
    for j in range(_0, last, _8):
        put_eight(total, j, _eight_columns(M, x, j, total))
    put_eight(total, last, end)  # some elements a second time, with the same values
