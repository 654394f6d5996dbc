"""The inflation of a part of a covariance, as a kernel."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import Matrix, Vector

__all__ = ["ALL_STATES", "NO_STATES", "MotionStates", "inflate_motion"]


class MotionStates(NamedTuple):
    """Where the motion is in a state.

    Attributes
    ----------
    linear, linear_end : int
        First index of position and velocity, and the index after their last, or more where they are all that there is.
    attitude, attitude_end : int
        The same of the attitude.
    """

    linear: int
    linear_end: int
    attitude: int
    attitude_end: int


#: Position and velocity are all states; nothing is motion that may be wrong.
ALL_STATES, NO_STATES = MotionStates(0, 10**9, 0, 0), MotionStates(0, 0, 0, 0)


@kernel
def inflate_motion(covariance: Matrix, inflation: float, first: Vector, moving: MotionStates) -> None:
    """Inflate the covariance of the motion in place, with the correlations as they are.

    Parameters
    ----------
    covariance : (n, n) array
        Covariance P of the state's error, updated.
    inflation : float
        Factor on the variances, above 1.
    first : (n,) array
        Variances at the start of the run; those of the attitude are not inflated beyond them.
    moving : MotionStates
        Where they are in the state.
    """
    sigma = np.ones(covariance.shape[0])
    for i in range(moving.linear, min(moving.linear_end, covariance.shape[0])):
        sigma[i] = sqrt(inflation)
    for i in range(moving.attitude, moving.attitude_end):
        factor = first[i] / covariance[i, i]
        sigma[i] = 1.0 if factor < 1.0 else sqrt(inflation) if factor > inflation else sqrt(factor)
    for i in range(covariance.shape[0]):
        for j in range(covariance.shape[0]):
            covariance[i, j] *= sigma[i] * sigma[j]
