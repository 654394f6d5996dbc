"""The Rauch-Tung-Striebel smoother: the whole trajectory from all measurements, behind any Kalman filter.

Forward, the filter keeps at each time t_k at which it stopped the state and the covariance P_k as it left them, the
transition matrix Phi_k to t_{k+1}, the predicted covariance M_{k+1} there, and the correction d_{k+1} of the
measurements used there. Backward, with c_k what the smoother adds to the filter's state (and S_k its covariance),
c = 0 and S = P at the end,

- ``G_k = P_k Phi_k' M_{k+1}^-1``
- ``c_k = G_k (d_{k+1} + c_{k+1})``
- ``S_k = (P_k - G_k M_{k+1} G_k') + G_k S_{k+1} G_k'``

A filter with feedback starts each stretch with a prediction of zero error, so that the difference between the smoothed
and the predicted state, which the usual form propagates, is d + c here, in the tangent space of the filter's own
trajectory. Corrections at one time add up; what rotations lack of commuting is of second order. c_k is applied to the
state like any correction. In the bracket both terms are positive semi-definite, so S is.

The gain is solved for in units of the predicted sigmas, which keeps metres and radians per second apart.

Source: H. E. Rauch, F. Tung and C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal
3(8), 1965; the forward-backward smoothing of paper 004 (eqs. 24-25) is the same estimate in two-filter form, which is
its test here: as printed it would use every measurement twice.
"""

from __future__ import annotations

import numpy as np

from estimators.solvers.kalman import KalmanEstimator
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements, NavigationStates

__all__ = ["SmoothingEstimator", "smoother_gains"]

#: Gains are solved for this many at a time.
_BATCH = 512


def smoother_gains(covariance: Array, transition: Array, predicted: Array) -> Array:
    """Rauch-Tung-Striebel gains ``P Phi' M^-1``.

    Parameters
    ----------
    covariance, transition, predicted : (k, n, n) array
        P, Phi and M of k stretches.

    Returns
    -------
    (k, n, n) array
        States that are known without error get none.
    """
    sigma = np.sqrt(np.maximum(np.diagonal(predicted, axis1=1, axis2=2), 0.0))
    known = sigma == 0.0
    sigma[known] = 1.0
    correlation = predicted / sigma[:, :, None] / sigma[:, None, :]
    correlation[known, :] = 0.0
    correlation.swapaxes(1, 2)[known, :] = 0.0
    index = np.arange(sigma.shape[1])
    correlation[:, index, index] = 1.0
    right = transition @ covariance / sigma[:, :, None]
    try:
        solved = np.linalg.solve(correlation, right)
    except np.linalg.LinAlgError:
        solved = np.linalg.pinv(correlation, rcond=1e-13, hermitian=True) @ right
    gains: Array = (solved / sigma[:, :, None]).swapaxes(1, 2)
    return gains


class SmoothingEstimator(KalmanEstimator):
    """A Kalman filter that smooths after the last update; put it before the filter's class::

        class EkfRts(SmoothingEstimator, Ekf): ...

    It stores three (n, n) matrices a stop: 5 kB at 15 states, 30 MB for 6000 of them.

    Attributes
    ----------
    smoothed_covariance : (T, 9, 9) array
        Of the trajectory that `smooth` returned.
    """

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(start, instruments)
        self._states: list[list[Array]] = []
        self._covariances: list[Array] = []
        self._transitions: list[Array] = []
        self._predicted: list[Array] = []
        self._corrections: list[Array] = []
        self._here = np.zeros(self.model.size)
        self._ends: list[tuple[int, float]] = []

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements; the filter's own estimate."""
        estimate = super().update(measurements)
        self._ends.append((len(self._states), measurements.time))
        return estimate

    def _propagate(self, until: float) -> None:
        model = self.model
        begin = model.time
        if until <= begin:
            return
        self._states.append(model.snapshot())
        self._covariances.append(self.covariance.copy())
        super()._propagate(until)
        transition = np.eye(model.size)
        model.carry(transition, until - begin)
        self._transitions.append(transition)
        self._predicted.append(self.covariance.copy())
        self._corrections.append(self._here)
        self._here = np.zeros(model.size)

    def _correct(self, dx: Array) -> None:
        super()._correct(dx)
        self._here += dx

    def smooth(self) -> NavigationStates | None:
        """The smoothed trajectory at the ends of all steps; None before the first."""
        if not self._ends:
            return None
        model, last = self.model, len(self._states)
        now = model.snapshot()
        count = len(self._ends)
        times = np.array([t for _, t in self._ends])
        position, velocity, attitude = (
            np.full((count, 3), np.nan),
            np.full((count, 3), np.nan),
            np.full((count, 3), np.nan),
        )
        self.smoothed_covariance = np.full((count, 9, 9), np.nan)
        row = count - 1

        def keep(stop: int, state: list[Array], correction: Array, covariance: Array) -> None:
            nonlocal row
            while row >= 0 and self._ends[row][0] == stop:
                model.restore(state)
                model.correct(correction)
                out = model.estimate(covariance)
                for series, vector in ((position, out.position), (velocity, out.velocity), (attitude, out.attitude)):
                    if vector is not None:
                        series[row] = vector
                if out.covariance is not None:
                    self.smoothed_covariance[row] = out.covariance
                row -= 1

        c, s = np.zeros(model.size), self.covariance
        keep(last, now, c, s)
        ahead = self._here
        for end in range(last, 0, -_BATCH):
            begin = max(0, end - _BATCH)
            p, m = np.array(self._covariances[begin:end]), np.array(self._predicted[begin:end])
            gains = smoother_gains(p, np.array(self._transitions[begin:end]), m)
            p -= gains @ m @ gains.swapaxes(1, 2)
            for k in range(end - 1, begin - 1, -1):
                gain = gains[k - begin]
                c = gain @ (ahead + c)
                s = p[k - begin] + gain @ s @ gain.T
                s = 0.5 * (s + s.T)
                ahead = self._corrections[k]
                keep(k, self._states[k], c, s)
        model.restore(now)
        return NavigationStates(times, position, velocity, attitude)
