"""The update of the inertial state by one measurement, in few kernels.

With an adaptation there are two kernels, because it may change the noise between them. Without an adaptation there is a
single kernel.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.kernel_types import Matrix, Vector

from .measurements import observe_inertial
from .propagation import correct_inertial

__all__ = ["absorb_inertial", "assimilate_inertial", "innovate_inertial"]


@kernel
def innovate_inertial(
    aid: tuple[int, Vector, int, int],
    value: Vector,
    state: tuple[Vector, Vector, Matrix, Vector, Vector, Vector],
    covariance: Matrix,
    innovation: Vector,
    cross: Matrix,
    predicted: Matrix,
) -> bool:
    """Compute the innovation of a measurement, and the covariance of its prediction.

    Parameters
    ----------
    aid, value, state
        Instrument, measured value and state, as in `simnav.estimators.models.measurements.observe_inertial`.
    covariance : (n, n) array
        Covariance P of the state's error.
    innovation : (d,) array
        Overwritten with the measurement minus its prediction.
    cross : (n, d) array
        Overwritten with P H', with the Jacobian H of the prediction.
    predicted : (d, d) array
        Overwritten with H P H'.

    Returns
    -------
    bool
        False if there is no such measurement at this state.
    """
    jacobian = np.empty((innovation.size, covariance.shape[0]))
    if not observe_inertial(aid, value, state, innovation, jacobian):
        return False
    project(covariance, jacobian, cross, predicted)
    return True


@kernel
def absorb_inertial(
    covariance: Matrix,
    cross: Matrix,
    predicted: Matrix,
    noise: Matrix,
    innovation: Vector,
    state: tuple[Vector, Vector, Matrix, Vector, Vector, Vector],
    correction: Vector,
) -> float:
    """Correct a state and its covariance by an innovation, in place.

    Parameters
    ----------
    covariance, cross, predicted, innovation
        The arrays of `innovate_inertial`; the covariance is updated.
    noise : (d, d) array
        Covariance R of the measurement noise.
    state : tuple of arrays
        The state of `innovate_inertial`, corrected.
    correction : (n,) array
        Overwritten with what was added to the state.

    Returns
    -------
    float
        Normalised innovation squared; -1 if the innovation covariance is singular, and then nothing is changed.
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


@kernel
def assimilate_inertial(
    aid: tuple[int, Vector, int, int],
    value: Vector,
    state: tuple[Vector, Vector, Matrix, Vector, Vector, Vector],
    covariance: Matrix,
    noise: Matrix,
    correction: Vector,
) -> tuple[float, float]:
    """Do `innovate_inertial` and `absorb_inertial` in one kernel.

    Returns
    -------
    nis : float
        Normalised innovation squared; -1 if there is no such measurement at the state or the innovation covariance is
        singular, and then nothing is changed.
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
