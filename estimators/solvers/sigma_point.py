"""Sigma-point Kalman filters on the manifold: unscented and cubature, one solver.

The transform, and what it calls alpha, beta and kappa, stand in `simnav.estimators.models.points`. The third-degree
cubature filter (I. Arasaratnam and S. Haykin, *Cubature Kalman filters*, IEEE Trans. Automatic Control 54,
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
from dataclasses import replace
from math import sqrt
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.models.filtering import Dynamics, ModelFunctions, Prediction, Readings, SigmaPoints
from simnav.estimators.models.points import PointModel, predict_through, propagate_through
from simnav.estimators.models.propagation import Samples
from simnav.types import Array

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["SigmaPointEstimator"]


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
    linearises = False
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

    def functions(self) -> FilterFunctions:
        """Motion and predictions come from points."""
        return super().functions().replaced()

    def _kernels(self) -> ModelFunctions | None:
        """The equations of the model as kernels that move points."""
        return self.model.point_functions()

    def _dynamics(self) -> Dynamics:
        """With points."""
        n = self.model.size
        if not self.kappa > -n:
            raise ValueError(f"kappa is above minus the number of states, {n}, not {self.kappa}")
        spread = self.alpha * sqrt(n + self.kappa)
        points = SigmaPoints(spread, 0.5 / spread**2, self.beta - self.alpha**2, np.empty((2 * n, n)))
        return replace(super()._dynamics(), points=points)

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the state and the covariance through the points."""
        if until > self.model.time:
            propagate_through(self._move, self.retract, dynamics, samples, until)

    def predict(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Innovation, its covariance and its cross-covariance with the state, from points drawn afresh."""
        return predict_through(super().predict, self._read, dynamics, readings, k, prediction)

    def _move(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance state and points; the covariance becomes that of the noise."""
        dynamics.covariance[:] = self.model.propagate_points(dynamics.points.errors, until)

    def _read(self, dynamics: Dynamics, readings: Readings, k: int, differences: Array) -> None:
        """What the instrument of a measurement should read at the points, minus what it should read at the state."""
        differences[:] = self.model.observe_points(self._measurements[k], dynamics.points.errors)
