"""One measurement of the inertial state in few kernels: observed, weighed and corrected for.

With an adaptation there are two kernels, because it may change the noise between them; without one there is a single
kernel.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.estimators.models.measurements import AID, STATE, Aid, State, observe_inertial
from simnav.estimators.models.propagation import correct_inertial
from simnav.types import Array

__all__ = ["absorb_inertial", "assimilate_inertial", "innovate_inertial"]


@kernel(f"b1({AID}, f8[::1], {STATE}, f8[:, ::1], f8[::1], f8[:, ::1], f8[:, ::1])")
def innovate_inertial(
    aid: Aid, value: Array, state: State, covariance: Array, innovation: Array, cross: Array, predicted: Array
) -> bool:
    """Innovation of a measurement, and what the covariance says of it.

    Parameters
    ----------
    aid, value, state
        As of `simnav.estimators.models.measurements.observe_inertial`.
    covariance : (n, n) array
        P.
    innovation : (d,) array
        Overwritten.
    cross : (n, d) array
        Overwritten with P H'.
    predicted : (d, d) array
        Overwritten with H P H'.

    Returns
    -------
    bool
        False where the measurement says nothing.
    """
    jacobian = np.empty((innovation.size, covariance.shape[0]))
    if not observe_inertial(aid, value, state, innovation, jacobian):
        return False
    project(covariance, jacobian, cross, predicted)
    return True


@kernel(f"f8(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], {STATE}, f8[::1])")
def absorb_inertial(
    covariance: Array, cross: Array, predicted: Array, noise: Array, innovation: Array, state: State, correction: Array
) -> float:
    """Correct a state and its covariance by an innovation, in place.

    Parameters
    ----------
    covariance, cross, predicted, innovation
        As of `innovate_inertial`.
    noise : (d, d) array
        R.
    state : tuple of arrays
        As of `innovate_inertial`; corrected.
    correction : (n,) array
        Overwritten with what was added to the state.

    Returns
    -------
    float
        Normalised innovation squared; -1 where its covariance is singular, and nothing is changed.
    """
    d = innovation.size
    spread = np.empty((d, d))
    for i in range(d):
        for k in range(d):
            spread[i, k] = predicted[i, k] + noise[i, k]
    nis = joseph_update(covariance, cross, spread, innovation, correction)
    if nis >= 0.0:
        position, velocity, dcm, _, bias, calibration = state
        correct_inertial(position, velocity, dcm, bias, calibration, correction)
    return nis


@kernel(f"UniTuple(f8, 2)({AID}, f8[::1], {STATE}, f8[:, ::1], f8[:, ::1], f8[::1])")
def assimilate_inertial(
    aid: Aid, value: Array, state: State, covariance: Array, noise: Array, correction: Array
) -> tuple[float, float]:
    """`innovate_inertial` and `absorb_inertial` in one.

    Returns
    -------
    nis : float
        Normalised innovation squared; -1 where the measurement says nothing or its covariance is singular, and nothing
        is changed.
    size : float
        Norm of the innovation.
    """
    n, d = covariance.shape[0], noise.shape[0]
    innovation, cross, predicted = np.empty(d), np.empty((n, d)), np.empty((d, d))
    if not innovate_inertial(aid, value, state, covariance, innovation, cross, predicted):
        return -1.0, 0.0
    size = 0.0
    for i in range(d):
        size += innovation[i] * innovation[i]
    nis = absorb_inertial(covariance, cross, predicted, noise, innovation, state, correction)
    return nis, sqrt(size)
