"""One measurement of the inertial state in one kernel: observed, weighed and corrected for.

What a Kalman filter does with a measurement whose noise nobody doubts; the same kernels as where somebody does, without
the way through Python between them.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from estimators.models.measurements import observe_inertial
from estimators.models.propagation import correct_inertial
from estimators.solvers.joseph import joseph_update, project
from simnav.compiled import kernel

__all__ = ["update_inertial"]


@kernel(
    "UniTuple(f8, 2)(i8, f8[::1], i8, i8, f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[::1], f8[::1], "
    "f8[:, ::1], f8[:, ::1], f8[::1])"
)
def update_inertial(  # type: ignore[no-untyped-def]
    code, arm, bias_at, scale_at, value, position, velocity, dcm, rate, bias, calibration, noise, covariance, correction
):
    """Correct a state and its covariance by one measurement, in place.

    Parameters
    ----------
    code, arm, bias_at, scale_at, value, position, velocity, dcm, rate, bias, calibration
        As of `estimators.models.measurements.observe_inertial`.
    noise : (d, d) array
        R.
    covariance : (n, n) array
        P.
    correction : (n,) array
        Overwritten with what was added to the state.

    Returns
    -------
    nis : float
        Normalised innovation squared; -1 where the measurement says nothing or its covariance is singular, and nothing
        is changed.
    size : float
        Norm of the innovation.
    """
    n, d = covariance.shape[0], noise.shape[0]
    innovation, jacobian = np.empty(d), np.empty((d, n))
    if not observe_inertial(
        code, arm, bias_at, scale_at, value, position, velocity, dcm, rate, bias, calibration, innovation, jacobian
    ):
        return -1.0, 0.0
    cross, spread = np.empty((n, d)), np.empty((d, d))
    project(covariance, jacobian, cross, spread)
    size = 0.0
    for i in range(d):
        size += innovation[i] * innovation[i]
        for k in range(d):
            spread[i, k] += noise[i, k]
    nis = joseph_update(covariance, cross, spread, innovation, correction)
    if nis >= 0.0:
        correct_inertial(position, velocity, dcm, bias, calibration, correction)
    return nis, sqrt(size)
