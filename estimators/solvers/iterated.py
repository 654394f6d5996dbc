"""The iterated extended Kalman filter: each measurement is linearised again at the corrected state.

The update is Gauss-Newton on the maximum a posteriori problem of one measurement. With the state before the
measurement as x0, the correction dx_i so far (dx_0 = 0), and innovation r_i and Jacobian H_i at x0 corrected by dx_i::

    dx_{i+1} = K_i (r_i + H_i J_i dx_i),    K_i = P G_i' (G_i P G_i' + R)^-1,    G_i = H_i J_i

P is the covariance before the measurement, R the covariance of its noise and K the gain. J is the derivative of the
error at the corrected state with respect to the correction: the identity, except the left Jacobian of SO(3) for the
attitude. The iteration ends when dx changes by less than ``threshold`` sigma in every component, or after ``limit``
linearisations. The covariance is updated with the last linearisation and transformed to the corrected state by J. An
adaptation receives the first innovation, and its noise is used in all iterations.

Source: A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, section 8.3; B. M. Bell and F. W. Cathey,
*The iterated Kalman filter update as a Gauss-Newton method*, IEEE TAC 38(2), 1993; on manifolds: G. Bourmaud et al.,
*From intrinsic optimization to iterated extended Kalman filtering on Lie groups*, J. Math. Imaging and Vision 55, 2016.
"""

from __future__ import annotations

from math import radians
from typing import NamedTuple

import numpy as np

from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.filtering import Prediction
from simnav.types import Array, Measurement

__all__ = ["Iteration", "absorb_iterated", "poor_heading"]


class Iteration(NamedTuple):
    """The settings of repeated linearisation of a measurement.

    Attributes
    ----------
    above_deg : float
        Measurements are iterated while the standard deviation of the heading is above this [deg]; 0: always.
    limit : int
        Largest number of linearisations of one measurement; 1 is the EKF.
    threshold : float
        Change of the correction at which it has converged, in sigmas before the measurement.
    """

    above_deg: float = 0.0
    limit: int = 10
    threshold: float = 1e-3

    def check(self) -> Iteration:
        """Return the settings; ValueError if a value is out of range."""
        if not self.above_deg >= 0.0:
            raise ValueError(f"the iteration begins above a heading sigma of 0 deg or more, not {self.above_deg}")
        if self.limit < 1:
            raise ValueError(f"limit is {self.limit}; at least 1 linearisation is needed")
        if not self.threshold > 0.0:
            raise ValueError(f"threshold is {self.threshold}; it must be positive")
        return self

    def applies(self, model: ErrorModel, covariance: Array) -> bool:
        """Whether measurements are iterated at this (n, n) covariance of the model's error."""
        if self.above_deg == 0.0:
            return True
        if model.attitude_at is None:
            return False
        heading = model.attitude_at + 2
        return float(covariance[heading, heading]) > radians(self.above_deg) ** 2


def poor_heading(iterate_above_deg: float | None = None) -> Iteration | None:
    """Iteration for a start from a poor heading.

    Parameters
    ----------
    iterate_above_deg : float, optional
        While the standard deviation of the heading is above this [deg], each measurement is linearised repeatedly until
        the correction converges, as in ``iekf``. None: never; 0: always.
    """
    return None if iterate_above_deg is None else Iteration(iterate_above_deg)


def absorb_iterated(
    model: ErrorModel,
    measurement: Measurement,
    prediction: Prediction,
    covariance: Array,
    correction: Array,
    iteration: Iteration,
) -> tuple[float, int]:
    """Correct a state and its covariance by a measurement (equations in the module).

    Parameters
    ----------
    model : ErrorModel
        The model whose state is corrected.
    measurement : Measurement
        The measurement to be used.
    prediction : Prediction
        The measurement linearised at the state, with the noise that is used.
    covariance : (n, n) array
        Covariance of the model's error, updated.
    correction : (n,) array
        Overwritten with the correction of the state.
    iteration : Iteration
        Limits of the iteration.

    Returns
    -------
    nis : float
        Normalised innovation squared of the first linearisation; -1 if the covariance of an innovation is singular, and
        then nothing is changed.
    count : int
        Number of linearisations.
    """
    residual, cross, predicted = prediction.innovation, prediction.cross, prediction.predicted
    before, first_nis = model.snapshot(), -1.0
    sigma = np.sqrt(np.diag(covariance)) + 1e-300
    previous = np.zeros(model.size)
    for count in range(1, iteration.limit + 1):
        posterior = covariance.copy()
        nis = joseph_update(posterior, cross, predicted + prediction.noise, residual, correction)
        if nis < 0.0 or not np.isfinite(correction).all():
            model.restore(before)
            return -1.0, count
        if count == 1:
            first_nis = nis
        converged = bool(np.all(np.abs(correction - previous) < iteration.threshold * sigma))
        model.restore(before)
        model.correct(correction)
        if converged or count == iteration.limit:
            break
        again = model.measure(measurement)
        if again is None:
            break
        previous = correction.copy()
        G = model.by_correction(again.jacobian, correction)
        cross = covariance @ G.T
        predicted = G @ cross
        residual = again.innovation + G @ correction
    covariance[:] = posterior
    model.to_corrected(covariance, correction)
    return first_nis, count
