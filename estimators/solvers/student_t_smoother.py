"""A smoother for measurement noise with heavy tails: the smoothed trajectory decides the weight of each measurement.

A filter must decide on a gross error at once. A smoother can also use later measurements: if fixes jump for two minutes
and come back, the later fixes show that the jump was wrong. After the filter, this smoother estimates the whole
trajectory repeatedly, each time with the noise ``R / w`` of each measurement of m components. w follows from the
residual e to the last smoothed trajectory, its covariance P, and the Jacobian H::

    w = (dof + m) / (dof + tr(R^-1 (e e' + H P H')))

This is expectation-maximisation for noise of Student's t distribution: it converges to a maximum of the posterior
density, the nearest one to where it began, the filter's own trajectory.

The turns are linear, in the tangent space of the trajectory that the filter left: with delta the error to be added to
the filter's state before the corrections of a stop, d their sum and p those before a measurement of innovation v,

- ``v + H p = H delta + noise`` of the covariance R / w
- ``delta_{k+1} = Phi (delta_k - d_k) + process noise``, of the covariance ``M - Phi P Phi'``

which is a Kalman filter and a Rauch-Tung-Striebel pass, and with all weights 1 and a plain filter in front the smoother
of `simnav.estimators.solvers.smoother`. The model is not run again.

Source: A. Y. Aravkin, J. V. Burke and G. Pillonetto, *Robust and trend-following Student's t Kalman smoothers*, SIAM
J. Control and Optimization 52(5), 2014; R. Piche, S. Sarkka and J. Hartikainen, *Recursive outlier-robust filtering and
smoothing for nonlinear systems using the multivariate Student-t distribution*, MLSP 2012.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.student_t import normalised_trace
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.types import Array, Datasheet

from .smoother import Entries, SmoothedStop, Smoother, smoother_gains

__all__ = ["StudentTSmoother"]

#: The turns end where no weight changes by more than this.
_SETTLED = 0.01


class _Used(NamedTuple):
    """A measurement in the tangent space of the filter's trajectory: stop, ``v + H p``, H and R."""

    stop: int
    known: Array
    jacobian: Array
    noise: Array


class _Measurements(NamedTuple):
    """All j measurements, in order of time, in the tangent space of the filter's trajectory.

    Attributes
    ----------
    sizes : (j,) int array
        Numbers of components; the other arrays are padded to the largest.
    jacobians, known, noises : (j, 3, n), (j, 3), (j, 3, 3) array
        H, ``v + H p`` and R.
    weights : (j,) array
        The weights that divide R.
    """

    sizes: IntegerVector
    jacobians: Stack
    known: Matrix
    noises: Stack
    weights: Vector


class _Filtered(NamedTuple):
    """What a pass of the filter leaves behind at k + 1 stops.

    Attributes
    ----------
    before, predicted : (k + 1, n), (k + 1, n, n) array
        delta before the corrections of a stop, and its covariance.
    after, covariance : (k + 1, n), (k + 1, n, n) array
        delta after them, minus d, and its covariance.
    """

    before: Matrix
    predicted: Stack
    after: Matrix
    covariance: Stack


@kernel
def _forward(
    transition: Stack,
    process: Stack,
    moved: Matrix,
    first: IntegerVector,
    used: _Measurements,
    filtered: _Filtered,
) -> None:
    """Kalman filter over the stops; overwrites ``filtered`` but for the first stop.

    Parameters
    ----------
    transition, process : (k, n, n) array
        Phi and process noise of the intervals.
    moved : (k + 1, n) array
        d: what the filter added to its state at each stop.
    first : (k + 2,) array of int
        Index of the first measurement of each stop.
    used : _Measurements
        The measurements.
    filtered : _Filtered
        Overwritten.
    """
    before, after, covariance = filtered.before, filtered.after, filtered.covariance
    stops, n = moved.shape
    correction = np.empty(n)
    for k in range(1, stops):
        phi = transition[k - 1]
        before[k] = np.dot(phi, after[k - 1])
        P = np.dot(np.dot(phi, covariance[k - 1]), phi.T) + process[k - 1]
        for r in range(n):
            for c in range(r):
                P[r, c] = P[c, r] = 0.5 * (P[r, c] + P[c, r])
        filtered.predicted[k] = P
        x = before[k].copy()
        for j in range(first[k], first[k + 1]):
            m = used.sizes[j]
            H = used.jacobians[j, :m].copy()
            cross, spread, residual = np.empty((n, m)), np.empty((m, m)), np.empty(m)
            project(P, H, cross, spread)
            for i in range(m):
                residual[i] = used.known[j, i]
                for c in range(n):
                    residual[i] -= H[i, c] * x[c]
                for c in range(m):
                    spread[i, c] += used.noises[j, i, c] / used.weights[j]
            if joseph_update(P, cross, spread, residual, correction) >= 0.0:
                for c in range(n):
                    x[c] += correction[c]
        covariance[k] = P
        for c in range(n):
            after[k, c] = x[c] - moved[k, c]


class StudentTSmoother(Smoother):
    """The smoother of the module, a piece of `KalmanEstimator`.

    It stores the measurements, and at the end six (n, n) matrices a stop.

    Parameters
    ----------
    dof : float
        Degrees of freedom of the measurement noise, above 0; infinite: Gaussian, all weights are 1.
    passes : int
        Largest number of passes over the trajectory; at least 1.

    Attributes
    ----------
    weights : dict of int to list of float
        After `smooth`: the weights of the measurements at each stop, in the order of their use.
    """

    stepwise = True
    looks_back = False
    weights: dict[int, list[float]]

    def __init__(self, dof: float = 6.0, passes: int = 20):
        if not dof > 0.0:
            raise ValueError(f"dof = {dof:g}: it must be above 0")
        if passes < 1:
            raise ValueError(f"passes = {passes}: it must be at least 1")
        self.dof, self.passes = dof, passes

    def begin(self, model: ErrorModel, observed: Sequence[Datasheet]) -> None:
        """Begin a run."""
        super().begin(model, observed)
        self._used = Entries[_Used]()

    def use(self, correction: Array, linearised: Linearised | None, noise: Array | None) -> None:
        """Note a measurement with its nominal noise, and the correction that it made."""
        assert linearised is not None
        innovation, jacobian, nominal = linearised
        known = innovation + jacobian @ self._here
        self._used.append(_Used(self.stops, known, jacobian.copy(), np.array(nominal)))
        super().use(correction, linearised, noise)

    def _backward(self, model: ErrorModel, covariance: Array) -> Iterator[SmoothedStop]:
        matrices = [s.matrices() for s in self._intervals]
        p, phi, m = (np.concatenate(parts) for parts in zip(*matrices, strict=True))
        process = m - phi @ p @ phi.swapaxes(1, 2)
        # `FilteredIntervals.correction` is that at the beginning of an interval; those of the last stop are still here.
        moved = np.concatenate([*(s.correction[: s.count] for s in self._intervals), self._here[None]])
        first = p[0] if len(p) else covariance
        shift, spread = self._smoothed(
            np.ascontiguousarray(phi), 0.5 * (process + process.swapaxes(1, 2)), moved, first
        )
        states = [state for s in self._intervals for state in s.states] + [model.snapshot()]
        for stop in range(len(states) - 1, -1, -1):
            yield SmoothedStop(stop, states[stop], shift[stop], spread[stop])

    def _smoothed(self, phi: Array, process: Array, moved: Array, first: Array) -> tuple[Array, Array]:
        """What is to be added to the filter's state at each stop, and its covariance; sets ``weights``."""
        stops, n = moved.shape
        # Measurements of the first stop stay as the filter used them: what it knew before them is not kept.
        used = [u for u in self._used if u.stop > 0]
        of_stop = np.array([u.stop for u in used], dtype=np.int64)
        begin = np.searchsorted(of_stop, np.arange(stops + 1)).astype(np.int64)
        sizes = np.array([len(u.known) for u in used], dtype=np.int64)
        jacobians, known, noises = np.zeros((len(used), 3, n)), np.zeros((len(used), 3)), np.zeros((len(used), 3, 3))
        for j, u in enumerate(used):
            d = sizes[j]
            jacobians[j, :d], known[j, :d], noises[j, :d, :d] = u.jacobian, u.known, u.noise
        weights = np.ones(len(used))
        before, after = np.zeros((2, stops, n))
        predicted, covariance = np.zeros((2, stops, n, n))
        predicted[0] = covariance[0] = first
        filtered = _Filtered(before, predicted, after, covariance)
        for _ in range(self.passes):
            measurements = _Measurements(sizes, jacobians, known, noises, weights)
            _forward(phi, process, moved, begin, measurements, filtered)
            shift, spread = _smooth_back(phi, moved, filtered)
            new = np.ones(len(used))
            if np.isfinite(self.dof):
                at = shift[of_stop] + moved[of_stop]  # before the corrections of the stop
                residual = known - np.einsum("jin,jn->ji", jacobians, at)
                seen = np.einsum("jin,jnk,jlk->jil", jacobians, spread[of_stop], jacobians, optimize=True)
                for j, d in enumerate(sizes.tolist()):
                    noise, e, a = (
                        np.ascontiguousarray(x) for x in (noises[j, :d, :d], residual[j, :d], seen[j, :d, :d])
                    )
                    trace = normalised_trace(noise, e, a)
                    if trace >= 0.0:
                        new[j] = (self.dof + d) / (self.dof + trace)
            change = float(np.abs(new - weights).max(initial=0.0))
            weights = new
            if change < _SETTLED:
                break
        self.weights = {}
        for u, weight in zip(used, weights.tolist(), strict=True):
            self.weights.setdefault(u.stop, []).append(weight)
        return shift, spread


def _smooth_back(phi: Array, moved: Array, filtered: _Filtered) -> tuple[Array, Array]:
    """The Rauch-Tung-Striebel pass: delta after the corrections of each stop, and its covariance."""
    before, predicted, covariance = filtered.before, filtered.predicted, filtered.covariance
    shift, spread = filtered.after.copy(), covariance.copy()
    if len(phi) == 0:
        return shift, spread
    gains = smoother_gains(covariance[:-1], phi, predicted[1:])
    lost = covariance[:-1] - gains @ predicted[1:] @ gains.swapaxes(1, 2)
    for k in range(len(phi) - 1, -1, -1):
        gain = gains[k]
        shift[k] += gain @ (shift[k + 1] + moved[k + 1] - before[k + 1])
        s = lost[k] + gain @ spread[k + 1] @ gain.T
        spread[k] = 0.5 * (s + s.T)
    return shift, spread
