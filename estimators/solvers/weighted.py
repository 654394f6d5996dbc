"""The iterated Kalman filter with a weighting: each measurement is a window of one node, with new weights at each
iteration.

With the covariance P of the prediction, the innovation v at the present iterate, the noise R and the correction dx so
far, the two factors of this window are the measurement, ``v' R^-1 v``, and the prediction, ``dx' P^-1 dx``, which takes
the place of the motion. A `simnav.estimators.weightings.base.Weighting` sets the weights of both as in a window: R is
divided by the weight of the measurement, P by that of the prediction, and the measurement is linearised again, as in
`simnav.estimators.solvers.iterated`, until correction and weights have converged.

A measurement with a weight of one half or less is flagged. Unlike a window, the filter cannot change earlier weights
later.

Source: B. M. Bell and F. W. Cathey, *The iterated Kalman filter update as a Gauss-Newton method*, IEEE TAC 38(2), 1993;
for weights at each iteration, P. W. Holland and R. E. Welsch, *Robust regression using iteratively reweighted
least-squares*, 1977.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.algebra.whitening import whitening
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.weightings.base import Factors, Weighting
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements

from .kalman import FilterFunctions, KalmanEstimator

__all__ = ["WeightedKalmanEstimator"]

#: A measurement of no more than this weight is reported as faulty, and one of no more than this is left out.
FAULTY_WEIGHT, LEAST_WEIGHT = 0.5, 1e-4


class WeightedKalmanEstimator(KalmanEstimator):
    """The solver of the module.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        States, dynamics and measurement equations.
    weighting : Weighting
        Sets the weight of each measurement.
    limit : int
        Largest number of iterations of a measurement, at least 2.
    threshold : float
        Change of the correction at which it has converged, in sigmas before the measurement.
    """

    pieces = ("model", "weighting")
    refuses: ClassVar[Mapping[str, str]] = {
        "adaptation": "the weighting decides how much a measurement counts",
        "iteration": "it always iterates",
        "isolation": KalmanEstimator.refuses["isolation"],
        "smoother": "the weight of a prediction is not in the transition that a smoother goes back over",
    }

    def __init__(self, model: ModelChoice, weighting: Weighting, *, limit: int = 15, threshold: float = 0.05):
        super().__init__(model)
        if limit < 2:
            raise ValueError(f"limit is {limit}; a weighting needs at least 2 iterations")
        if not threshold > 0.0:
            raise ValueError(f"threshold is {threshold}; it must be positive")
        self.weighting, self.limit, self.threshold = weighting, limit, threshold

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        instruments = by_source(instruments, self._model_choice, self.label)
        super().reset(start, instruments)
        self.weighting.reset(instruments)
        self._index = {name: k for k, name in enumerate(instruments)}
        self._blank |= dict.fromkeys((f"weight.{name}" for name in self._names), np.nan)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        self._weights: dict[str, float] = {}
        self._doubted: list[tuple[str, float]] = []
        estimate = super().update(measurements)
        estimate.diagnostics = {**estimate.diagnostics, **self._weights, **self.weighting.diagnostics()}
        estimate.flagged = self._doubted
        return estimate

    def functions(self) -> FilterFunctions:
        """Every measurement is linearised, and weighted, again and again."""
        return super().functions().replaced(predict=self.predict, correct=self.correct, retract=self.retract)

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct state and covariance until correction and weights have converged; flag a small weight."""
        m, found = self._measurements[k], self._linearised
        assert found is not None
        factors = self._factors(m, found.noise)
        nis = self._iterate(m, factors, found.innovation, found.jacobian, found.noise)
        weight = self._weights[f"weight.{m.instrument}"] = float(factors.weight[0])
        if weight <= FAULTY_WEIGHT:
            self._doubted.append((m.instrument, m.time))
        return nis

    def retract(self, dynamics: Dynamics) -> None:
        """The state is corrected already."""

    def _iterate(self, m: Measurement, factors: Factors, innovation: Array, H: Array, noise: Array) -> float:
        """Correct the state; the normalised innovation squared at full weight, -1 where nothing was changed."""
        model, P, dx = self.model, self.covariance, self.dynamics.correction
        before, first = model.snapshot(), -1.0
        sigma, whitener = np.sqrt(np.diag(P)) + 1e-300, np.empty_like(P)
        whitening(P, whitener)
        dx[:] = 0.0
        jacobian, posterior = np.ascontiguousarray(H, dtype=np.float64), P
        for count in range(self.limit):
            settled = self._weigh(factors, innovation, whitener, count)
            weight, prior = max(float(factors.weight[0]), LEAST_WEIGHT), P / float(factors.motion_weight[0])
            cross, previous = prior @ jacobian.T, dx.copy()
            posterior, residual = prior.copy(), innovation + jacobian @ previous
            nis = joseph_update(posterior, cross, jacobian @ cross + noise / weight, residual, dx)
            model.restore(before)
            if nis < 0.0 or not np.isfinite(dx).all():
                return -1.0
            first = nis if count == 0 else first
            model.correct(dx)
            again = model.measure(m)
            if again is None or (settled and bool(np.all(np.abs(dx - previous) < self.threshold * sigma))):
                break
            innovation, jacobian = again.innovation, model.by_correction(again.jacobian, dx)
        P[:] = posterior
        model.to_corrected(P, dx)
        return first

    def _factors(self, m: Measurement, noise: Array) -> Factors:
        """The measurement and the prediction as factors of a window, in full weight."""
        d, one = len(noise), np.ones(1)
        full = np.eye(3)
        full[:d, :d] = noise
        return Factors(
            tuple(self._index), np.array([self._index[m.instrument]]), np.array([d]), np.array([m.time]),
            np.zeros((1, 3)), full[None], np.zeros((1, 3)), np.zeros(1), np.array([self.model.time]),
            np.zeros((1, self.model.size)), np.zeros(1), one, one.copy(), 0,
        )  # fmt: skip

    def _weigh(self, factors: Factors, innovation: Array, whitener: Array, iteration: int) -> bool:
        """Set the weights at the present iterate; return whether they are final."""
        factors.residual[0, : len(innovation)] = innovation
        root = np.linalg.cholesky(factors.noise[0])
        factors.whitened[0] = np.linalg.solve(root, factors.residual[0])
        factors.norm[0] = np.linalg.norm(factors.whitened[0])
        factors.motion_residual[0] = self.dynamics.correction
        factors.motion_norm[0] = np.linalg.norm(whitener @ self.dynamics.correction)
        factors.iteration = iteration
        return self.weighting.weigh(factors)
