"""Sigma-point Kalman filters on the manifold: unscented and cubature, one solver.

With P = L L' of the n-component error of the model's state X, the points are X retracted by ``e_j = +-s L_j``
(position in metres, attitude by a rotation vector, ...), ``s^2 = alpha^2 (n + kappa)``, and the weight of each is
``w = 1/(2 s^2)``. A function f of the state (the motion over the time between two measurements, or what an instrument
reads) is evaluated at all points, and with ``d_j = f(X_j) - f(X)`` in the chart about f(X),

- mean ``f(X) + d``, with ``d = w sum d_j``
- covariance ``w sum d_j d_j' + (beta - alpha^2) d d'``, plus the noise
- cross-covariance with the state ``w sum e_j d_j'``

This is the scaled unscented transform (S. J. Julier and J. K. Uhlmann, *Unscented filtering and nonlinear estimation*,
Proc. IEEE 92, 2004; E. A. Wan and R. van der Merwe, *The unscented Kalman filter for nonlinear estimation*, 2000),
rewritten: the centre point's weights, large and of opposite sign where alpha is small, have cancelled, so that nothing
is lost to rounding, and the covariance is positive semi-definite by its form where ``beta >= alpha^2``. The
third-degree cubature filter (I. Arasaratnam and S. Haykin, *Cubature Kalman filters*, IEEE Trans. Automatic Control 54,
2009) has alpha = 1, beta = 0, kappa = 0: there the covariance is a mean of squares about the mean.

Choices (Guo et al. (2026) compare with a UKF and give neither points nor weights):

- The mean is taken about the propagated centre, in one step, not by iteration on the manifold: the form above needs the
  centre, and the step is exact but for the attitude, where what is left out is of third order in its uncertainty.
- Points are drawn twice a measurement, before the motion and again before the measurement: points that went through the
  motion lack the process noise, and the innovation's covariance would lack H Q H'.
- They are drawn once between measurements, not at every IMU sample: the motion of minutes is nearly linear in its
  errors, and the RMSE is the same.
- The update of the covariance is Joseph's (`simnav.estimators.algebra.joseph.joseph_update`), and the square root
  accepts a semi-definite matrix, so that a state known exactly does no harm.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import ClassVar

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.algebra.cholesky import factorise
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.points import PointModel
from simnav.estimators.models.propagation import Samples
from simnav.kernel_types import Matrix
from simnav.types import Array, InitialState, Instruments

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["SigmaPointEstimator", "draw_points"]


@kernel
def draw_points(covariance: Matrix, spread: float, points: Matrix) -> None:
    """Rows ``+spread L_j``, then ``-spread L_j``, of the columns of the Cholesky factor of a covariance.

    Parameters
    ----------
    covariance : (n, n) array
        Positive semi-definite; a pivot of zero, or below it by rounding, gives a column of zeros.
    spread : float
        Distance of the points from the mean, in columns of the square root.
    points : (2 n, n) array
        Overwritten with the points, one in each row.
    """
    n = covariance.shape[0]
    L = covariance.copy()
    factorise(L, n, 1e-14, np.empty(n))
    for j in range(n):
        for i in range(n):
            points[j, i] = L[i, j] * spread if i >= j else 0.0
            points[n + j, i] = -points[j, i]


class SigmaPointEstimator(KalmanEstimator):
    """A `KalmanEstimator` whose moments come from sigma points; a subclass says of which model, and registers.

    Parameters
    ----------
    model : PointModel
        States, dynamics and measurement equations, for sigma points.
    adaptation : Adaptation, optional
        Chooses the noise of each measurement; default: the datasheet's.
    alpha : float
        Scale of the sigma points, above 0: their distance from the mean is ``alpha sqrt(n + kappa)`` sigma for n
        states. With a small value the filter is like an EKF.
    beta : float
        Knowledge of the fourth moments of the distribution; 2 is optimal for a Gaussian.
    kappa : float
        Second scale of the sigma points, above -n; it is added to the number of states n.
    """

    pieces = ("model", "adaptation")
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "iteration": "it linearises no measurement",
        "smoother": "it has no transition matrix, only the points that went through the motion",
    }
    model: PointModel

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class: a model is to move points."""
        if keyword == "model" and not issubclass(made, PointModel):
            return "it moves no sigma points; InertialPoints and ShipPoints do"
        return super().misfit(keyword, made)

    def __init__(
        self,
        model: PointModel,
        adaptation: Adaptation | None = None,
        *,
        alpha: float = 0.5,
        beta: float = 2.0,
        kappa: float = 0.0,
    ):
        if not 0.0 < alpha < np.inf:
            raise ValueError(f"alpha is the scale of the sigma points: a number above 0, not {alpha}")
        super().__init__(model, adaptation)
        self.alpha, self.beta, self.kappa = alpha, beta, kappa

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(start, instruments)
        n = self.model.size
        if not self.kappa > -n:
            raise ValueError(f"kappa is above minus the number of states, {n}, not {self.kappa}")
        self._spread = self.alpha * sqrt(n + self.kappa)
        self._weight = 0.5 / self._spread**2
        self._excess = self.beta - self.alpha**2
        self._points = np.empty((2 * n, n))

    def _moments(self, values: Array) -> tuple[Array, Array]:
        """Mean and covariance of (2 n, m) differences from the centre."""
        mean = self._weight * values.sum(axis=0)
        covariance = self._weight * (values.T @ values)
        covariance += self._excess * (mean[:, None] * mean)
        return mean, covariance

    def functions(self) -> FilterFunctions:
        """Motion and predictions come from points."""
        return super().functions().replaced(propagate=self.propagate, predict=self.predict)

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the state and the covariance through the points."""
        if until <= self.model.time:
            return
        points = self._points
        draw_points.unchecked(self.covariance, self._spread, points)
        noise = self.model.propagate_points(points, until)
        mean, self.covariance[:] = self._moments(points)
        self.covariance += noise
        self.model.correct(mean)

    def predict(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Innovation, its covariance and its cross-covariance with the state, from points drawn afresh."""
        m = self._measurements[k]
        linearised = self.model.measure(m)
        if linearised is None:
            return False
        points = self._points
        draw_points.unchecked(self.covariance, self._spread, points)
        values = self.model.observe_points(m, points)
        mean, prediction.predicted[:] = self._moments(values)
        prediction.innovation[:], prediction.nominal[:] = linearised.innovation - mean, linearised.noise
        prediction.cross[:] = self._weight * (points.T @ values)
        return True
