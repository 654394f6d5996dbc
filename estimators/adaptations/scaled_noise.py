"""The noise of a datasheet with other variances: its correlations stay."""

from __future__ import annotations

from math import sqrt

from simnav.compiled import kernel
from simnav.kernel_types import Matrix

__all__ = ["bound", "scale"]


@kernel
def scale(noise: Matrix, f0: float, f1: float, f2: float, product: Matrix) -> None:
    """Multiply an (m, m) covariance by factors on the variances of its components, up to three; fill in ``product``."""
    r0, r1, r2 = sqrt(f0), sqrt(f1), sqrt(f2)
    for i in range(noise.shape[0]):
        a = r0 if i == 0 else r1 if i == 1 else r2
        for j in range(noise.shape[0]):
            product[i, j] = noise[i, j] * a * (r0 if j == 0 else r1 if j == 1 else r2)


@kernel
def bound(estimate: Matrix, nominal: Matrix, low: float, high: float, bounded: Matrix) -> None:
    """Fill in the nominal covariance with the variances of an estimate, ``low`` to ``high`` times the nominal ones."""
    for i in range(nominal.shape[0]):
        bounded[i, i] = sqrt(min(max(estimate[i, i] / nominal[i, i], low), high))
    for i in range(nominal.shape[0]):
        for j in range(i):
            bounded[i, j] = bounded[j, i] = nominal[i, j] * bounded[i, i] * bounded[j, j]
    for i in range(nominal.shape[0]):
        bounded[i, i] *= nominal[i, i] * bounded[i, i]
