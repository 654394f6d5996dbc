"""The iterated extended Kalman filter: each measurement is linearised again at what it makes of the state.

The update is Gauss-Newton on the maximum a posteriori problem of one measurement. With the state before the
measurement as x0, the correction dx_i so far (dx_0 = 0), and innovation r_i and Jacobian H_i at x0 corrected by dx_i::

    dx_{i+1} = K_i (r_i + H_i J_i dx_i),    K_i = P G_i' (G_i P G_i' + R)^-1,    G_i = H_i J_i

J is the derivative of the error at the corrected state by the correction: the identity, but the left Jacobian of
SO(3) for the attitude. The iteration ends when dx changes by less than ``threshold`` sigma in every component, or after
``limit`` linearisations. The covariance is updated with the last one and brought to the corrected state by J. An
adaptation sees the first innovation, and what it decides holds for all.

Source: A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, section 8.3; B. M. Bell and F. W. Cathey,
*The iterated Kalman filter update as a Gauss-Newton method*, IEEE TAC 38(2), 1993; on manifolds: G. Bourmaud et al.,
*From intrinsic optimization to iterated extended Kalman filtering on Lie groups*, J. Math. Imaging and Vision 55, 2016.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.solvers.joseph import joseph_update
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.rotation import left_jacobian
from simnav.types import Array, Measurement

__all__ = ["IteratedKalmanEstimator"]


class IteratedKalmanEstimator(KalmanEstimator):
    """The solver of the module; the diagnostic ``iterations`` is the most linearisations that a measurement took.

    Parameters
    ----------
    model : ErrorModel
        With its attitude error, if it has one, at 6 to 8.
    adaptation : Adaptation, optional
    limit : int
        Most linearisations of one measurement; 1 is the EKF.
    threshold : float
        Change of the correction at which it has converged, in sigmas before the measurement.
    attitude : bool
        Whether the model's error has an attitude.
    """

    def __init__(
        self,
        model: ErrorModel,
        adaptation: Adaptation | None = None,
        limit: int = 10,
        threshold: float = 1e-3,
        attitude: bool = True,
    ):
        super().__init__(model, adaptation)
        if limit < 1:
            raise ValueError(f"limit is {limit}; at least 1 linearisation is needed")
        if not threshold > 0.0:
            raise ValueError(f"threshold is {threshold}; it must be positive")
        self.limit, self.threshold, self.attitude = limit, threshold, attitude

    def _take(self, m: Measurement, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]) -> None:
        """Correct the state by one measurement."""
        model, P = self.model, self.covariance
        linearised = model.measure(m)
        if linearised is None:
            self._admission.skipped += 1
            return
        before = model.snapshot()
        first, jacobian, noise = linearised
        cross = P @ jacobian.T
        predicted = jacobian @ cross
        chosen = self.adaptation.adapt(Innovation(m, first, predicted, noise, P, cross))
        if chosen is None:
            flagged.append((m.instrument, m.time))
            return
        if self.adaptation.inflation != 1.0:
            P *= self.adaptation.inflation
            cross, predicted = cross * self.adaptation.inflation, predicted * self.adaptation.inflation
        sigma = np.sqrt(np.diag(P)) + 1e-300
        residual, correction, previous = first, self._correction, np.zeros(model.size)
        first_nis = -1.0
        for count in range(1, self.limit + 1):
            posterior = P.copy()
            nis = joseph_update(posterior, cross, predicted + chosen, residual, correction)
            if nis < 0.0 or not np.isfinite(correction).all():
                model.restore(before)
                self._admission.skipped += 1
                return
            if count == 1:
                first_nis = nis
            converged = bool(np.all(np.abs(correction - previous) < self.threshold * sigma))
            model.restore(before)
            model.correct(correction)
            if converged or count == self.limit:
                break
            again = model.measure(m)
            if again is None:
                break
            previous = correction.copy()
            G = again.jacobian.copy()
            if self.attitude:
                G[:, 6:9] = G[:, 6:9] @ left_jacobian(correction[6:9])
            cross = P @ G.T
            predicted = G @ cross
            residual = again.innovation + G @ correction
        P[:] = posterior
        if self.attitude:
            J = left_jacobian(correction[6:9])
            P[6:9] = J @ P[6:9]
            P[:, 6:9] = P[:, 6:9] @ J.T
        diagnostics["iterations"] = max(float(count), float(diagnostics.get("iterations", 0.0)))
        diagnostics[f"innovation.{m.instrument}"] = sqrt(float(first @ first))
        diagnostics[f"nis.{m.instrument}"] = first_nis
