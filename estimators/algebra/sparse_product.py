"""The product of a sparse matrix, whose non-zero elements are listed, and a dense one, eight columns at a time.

The sums of eight columns stay in one vector register while the elements of a row are gone through. The terms are added
in the order in which the elements are listed. For this the dense matrix has a multiple of eight columns (`padded`), and
indices are unsigned: of a signed one the compiler has to ask whether it counts from the end, and then it does not see
that eight elements lie side by side.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.types import Array

__all__ = [
    "NOTHING", "Places", "add_eight", "eight_of", "eight_sums", "list_elements", "padded", "put_eight",
    "sparse_product",
]  # fmt: skip

Eight: TypeAlias = tuple[float, float, float, float, float, float, float, float]
#: An unsigned index or number of elements, and many.
Place: TypeAlias = int | np.uint64
Places: TypeAlias = NDArray[np.uint64]
_0, _1, _2, _3, _4, _5, _6, _7, _8 = (np.uint64(i) for i in range(9))
NOTHING = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0


@kernel()
def padded(n: int) -> int:
    """The next multiple of eight."""
    return 8 * ((n + 7) // 8)


@kernel()
def list_elements(F: Array, value: Array, column: Places, count: Places) -> None:
    """List the elements of an (m, n) matrix that are not zero, their columns, and how many there are in each row."""
    for i in range(np.uint64(F.shape[0])):
        q = _0
        for k in range(np.uint64(F.shape[1])):
            value[i, q], column[i, q] = F[i, k], k
            q += np.uint64(F[i, k] != 0.0)
        count[i] = q


@kernel()
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
    s : tuple of float
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
    return s0, s1, s2, s3, s4, s5, s6, s7


@kernel()
def eight_of(M: Array, i: Place, j: Place) -> Eight:
    """Eight elements of row i of M, from column j on."""
    return (
        M[i, j], M[i, j + _1], M[i, j + _2], M[i, j + _3], M[i, j + _4], M[i, j + _5], M[i, j + _6], M[i, j + _7]
    )  # fmt: skip


@kernel()
def put_eight(M: Array, i: Place, j: Place, s: Eight) -> None:
    """Overwrite eight elements of row i of M, from column j on."""
    M[i, j], M[i, j + _1], M[i, j + _2], M[i, j + _3] = s[0], s[1], s[2], s[3]
    M[i, j + _4], M[i, j + _5], M[i, j + _6], M[i, j + _7] = s[4], s[5], s[6], s[7]


@kernel()
def add_eight(M: Array, i: Place, j: Place, s: Eight) -> None:
    """Add eight sums to row i of M, from column j on."""
    t = eight_of(M, i, j)
    put_eight(
        M, i, j,
        (t[0] + s[0], t[1] + s[1], t[2] + s[2], t[3] + s[3], t[4] + s[4], t[5] + s[5], t[6] + s[6], t[7] + s[7]),
    )  # fmt: skip


@kernel()
def sparse_product(value: Array, column: Places, count: Places, M: Array, out: Array) -> None:
    """The product of a matrix in lists (`eight_sums`) and M; M and ``out`` have a multiple of eight columns."""
    for i in range(np.uint64(count.size)):
        for j in range(_0, np.uint64(M.shape[1]), _8):
            put_eight(out, i, j, eight_sums(value, column, i, count[i], M, j, NOTHING))
