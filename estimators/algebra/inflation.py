"""The inflation of a part of a covariance, as a kernel."""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import Matrix, Vector

__all__ = ["inflate_motion"]


@kernel
def inflate_motion(covariance: Matrix, inflation: float, first: Vector, moving: tuple[int, int, int, int]) -> None:
    """Inflate the covariance of the motion in place, with the correlations as they are.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the state's error, updated.
    inflation : float
        Factor on the variances, above 1.
    first : (n,) array
        Variances at the start of the run; those of the attitude are not inflated beyond them.
    moving : (int, int, int, int)
        First place of position and velocity, and the place after the last; the same of the attitude.
    """
    sigma = np.ones(covariance.shape[0])
    for i in range(moving[0], moving[1]):
        sigma[i] = sqrt(inflation)
    for i in range(moving[2], moving[3]):
        factor = first[i] / covariance[i, i]
        sigma[i] = 1.0 if factor < 1.0 else sqrt(inflation) if factor > inflation else sqrt(factor)
    for i in range(covariance.shape[0]):
        for j in range(covariance.shape[0]):
            covariance[i, j] *= sigma[i] * sigma[j]
