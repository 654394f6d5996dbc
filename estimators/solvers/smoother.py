"""The Rauch-Tung-Striebel smoother: the whole trajectory from all measurements, behind any Kalman filter.

In the forward pass the filter stops at the times t_k of measurements and step ends. It stores the state and covariance
P_k after the measurements there, the transition matrix Phi_k to t_{k+1}, the predicted covariance M_{k+1}, and the sum
d_{k+1} of the corrections by the measurements. In the backward pass, c_k is the correction that the smoother adds to
the filter's state and S_k is the smoothed covariance, with c = 0 and S = P at the end:

- ``G_k = P_k Phi_k' M_{k+1}^-1``
- ``c_k = G_k (d_{k+1} + c_{k+1})``
- ``S_k = (P_k - G_k M_{k+1} G_k') + G_k S_{k+1} G_k'``

A filter with feedback starts each interval with a predicted error of zero. So the difference between the smoothed and
the predicted state, which the usual form propagates, is d + c here, in the tangent space of the filter's own
trajectory. Corrections at one time are added; that rotations do not commute is a second-order effect. c_k is applied to
the state like any correction. Both terms of S are positive semi-definite, so S is.

The gain is computed in units of the predicted sigmas, because the states have different units.

Source: H. E. Rauch, F. Tung and C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal
3(8), 1965. The forward-backward smoothing of the AUV
smoothing paper (2022, doi:10.1177/01423312221109880, eqs. 24-25) is the same estimate in two-filter form
(`simnav.estimators.solvers.two_filter`), which is its test.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, NamedTuple, TypeVar

import numpy as np

from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.types import Array, Datasheet, NavigationStates

from .looking_back import smoothed_rows

__all__ = ["Entries", "FilteredIntervals", "SmoothedStop", "Smoother", "scale_of", "smoother_gains"]

#: FilteredIntervals are stored, and gains are solved for, this many at a time.
_BATCH = 64
#: Gains in units of sigmas from which on the correlations are looked at, and the smallest eigenvalue of these that is
#: not rounding.
_LARGE, _RANK = 1e3, 1e-11


def scale_of(covariance: Array) -> Array:
    """(k, n) sigmas of (k, n, n) covariances; 1 for a state that is known without error."""
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    sigma[sigma == 0.0] = 1.0
    return sigma


def smoother_gains(covariance: Array, transition: Array, predicted: Array) -> Array:
    """Rauch-Tung-Striebel gains ``P Phi' M^-1``.

    Parameters
    ----------
    covariance, transition, predicted : (k, n, n) array
        P, Phi and M of k intervals.

    Returns
    -------
    (k, n, n) array
        States that are known without error get none.
    """
    sigma = scale_of(predicted)
    known = np.diagonal(predicted, axis1=1, axis2=2) <= 0.0
    correlation = predicted / sigma[:, :, None] / sigma[:, None, :]
    correlation[known, :] = 0.0
    correlation.swapaxes(1, 2)[known, :] = 0.0
    index = np.arange(sigma.shape[1])
    correlation[:, index, index] = 1.0
    right = transition @ covariance / sigma[:, :, None]
    try:
        solved: Array = np.asarray(np.linalg.solve(correlation, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        solved = np.asarray(np.linalg.pinv(correlation, rcond=1e-13, hermitian=True) @ right)
    _repair(solved, correlation, right, scale_of(covariance))
    gains: Array = (solved / sigma[:, :, None]).swapaxes(1, 2)
    return gains


def _repair(solved: Array, correlation: Array, right: Array, sigma: Array) -> None:
    """Solve again, in place, where the correlations are singular up to rounding and the solution is none.

    ``G M G'`` is at most P, so that a row g of the gain in units of sigmas has ``g C g' <= 1`` with the correlations C,
    and is large only where C is nearly singular. A state that follows from others, such as an error that only fades,
    makes C singular; then `numpy.linalg.solve` may give numbers of any size.
    """
    rows = solved / sigma[:, None, :]
    suspect = np.flatnonzero(np.abs(rows).max(axis=(1, 2), initial=0.0) > _LARGE)
    if len(suspect):
        wrong = suspect[np.linalg.eigvalsh(correlation[suspect])[:, 0] < _RANK]
        solved[wrong] = np.linalg.pinv(correlation[wrong], rcond=_RANK, hermitian=True) @ right[wrong]


Entry = TypeVar("Entry")


class Entries(list[Entry]):
    """A list of what is never changed once it is in it. A copy shares it, so that a copy of a long run takes little."""

    def __deepcopy__(self, memo: object) -> Entries[Entry]:
        return Entries(self)


class FilteredIntervals:
    """What the forward pass leaves of some successive intervals between stops.

    Attributes
    ----------
    count : int
        Number of intervals, at most `_BATCH`.
    states : list
        Snapshots of the model at the beginnings of the intervals.
    covariance, transition, predicted : (k, n, n) array
        P at the beginning, Phi, and M at the end.
    correction : (k, n) array
        Sum of the corrections at the beginning.
    """

    __slots__ = ("correction", "count", "covariance", "predicted", "states", "transition")

    def __init__(self, size: int):
        self.count = 0
        self.states = Entries[list[Array]]()
        self.covariance = np.empty((_BATCH, size, size))
        self.transition, self.predicted = np.empty_like(self.covariance), np.empty_like(self.covariance)
        self.correction = np.empty((_BATCH, size))

    def __deepcopy__(self, memo: object) -> FilteredIntervals:
        if self.count == _BATCH:  # it is full, and is not changed any more
            return self
        copied = FilteredIntervals.__new__(FilteredIntervals)
        copied.count, copied.states = self.count, Entries(self.states)
        copied.covariance, copied.transition = self.covariance.copy(), self.transition.copy()
        copied.predicted, copied.correction = self.predicted.copy(), self.correction.copy()
        return copied

    def matrices(self) -> tuple[Array, Array, Array]:
        """P, Phi and M of the intervals recorded so far."""
        return self.covariance[: self.count], self.transition[: self.count], self.predicted[: self.count]


class SmoothedStop(NamedTuple):
    """What the backward pass gives at a stop, for n states.

    Attributes
    ----------
    stop : int
        Its index.
    state : list of array
        Snapshot of the model, as the filter left it.
    correction : (n,) array
        c, which is added to this state.
    covariance : (n, n) array
        S, of the corrected state's error.
    """

    stop: int
    state: list[Array]
    correction: Array
    covariance: Array


class Smoother:
    """The smoother of the module, a piece of `KalmanEstimator`. It records the forward pass, then runs backward.

    It stores three (n, n) matrices for each stop: 5 kB at 15 states, 30 MB for 6000 stops.

    Attributes
    ----------
    stepwise : bool
        True if the smoother needs the Jacobian and the noise of each measurement. The filter then linearises and
        corrects in separate steps.
    smoothed_covariance : (T, 9, 9) array
        Covariances of the trajectory that `smooth` returned.
    """

    stepwise: ClassVar[bool] = False
    #: Whether its estimate is the Rauch-Tung-Striebel one, so that `earlier` gives its estimates of earlier times.
    looks_back: ClassVar[bool] = True
    smoothed_covariance: Array

    def begin(self, model: ErrorModel, observed: Sequence[Datasheet]) -> None:
        """Begin a run, with the instruments that the model observes."""
        self._intervals = [FilteredIntervals(model.size)]
        self._here = np.zeros(model.size)
        self._identity = np.eye(model.size)
        self._ends = Entries[tuple[int, float]]()
        self._gains: dict[int, Array] = {}

    @property
    def stops(self) -> int:
        """Number of recorded intervals, which is the index of the present stop."""
        return (len(self._intervals) - 1) * _BATCH + self._intervals[-1].count

    def depart(self, model: ErrorModel, covariance: Array) -> None:
        """Record the state and its covariance before a propagation."""
        into = self._intervals[-1]
        if into.count == _BATCH:
            into = FilteredIntervals(model.size)
            self._intervals.append(into)
        into.states.append(model.snapshot())
        into.covariance[into.count] = covariance

    def arrive(self, model: ErrorModel, covariance: Array, elapsed: float) -> None:
        """Record the transition matrix and the predicted covariance after a propagation."""
        into = self._intervals[-1]
        k = into.count
        into.transition[k] = self._identity
        model.carry(into.transition[k], elapsed)
        into.predicted[k] = covariance
        into.correction[k] = self._here
        into.count = k + 1
        self._here[:] = 0.0

    def use(self, correction: Array, linearised: Linearised | None, noise: Array | None) -> None:
        """Record the correction by a measurement; a ``stepwise`` smoother also receives its Jacobian and noise."""
        self._here += correction

    def end_step(self, time: float) -> None:
        """Record that a step ends at the present stop."""
        self._ends.append((self.stops, time))

    def _backward(self, model: ErrorModel, covariance: Array) -> Iterator[SmoothedStop]:
        """The stops, from last to first; subclasses may override it."""
        c, s = np.zeros(model.size), covariance
        yield SmoothedStop(self.stops, model.snapshot(), c, s)
        ahead, stop = self._here, self.stops
        for intervals in reversed(self._intervals):
            p, phi, m = intervals.matrices()
            gains = smoother_gains(p, phi, m)
            lost = p - gains @ m @ gains.swapaxes(1, 2)
            for k in range(intervals.count - 1, -1, -1):
                gain = gains[k]
                c = gain @ (ahead + c)
                s = lost[k] + gain @ s @ gain.T
                s = 0.5 * (s + s.T)
                ahead = intervals.correction[k]
                stop -= 1
                yield SmoothedStop(stop, intervals.states[k], c, s)

    def earlier(self, model: ErrorModel, lags: Sequence[float]) -> Array | None:
        """Smoothed states of earlier times, from the measurements so far (`simnav.estimator.Estimator.earlier`).

        Parameters
        ----------
        model : ErrorModel
            The model at the end of the last step. It is in the same state afterwards.
        lags : sequence of float
            Times before the end of the step [s].

        Returns
        -------
        (k, 9) array or None
            None for a smoother whose estimate is another one than this class's.
        """
        if not self.looks_back:
            return None
        return smoothed_rows(model, lags, self._ends, lambda first: self._corrections(model, first))

    def _corrections(self, model: ErrorModel, first: int) -> tuple[list[list[Array]], list[Array]]:
        """States of the filter at the stops from ``first`` to the present one, and what the smoother adds to them."""
        for stop in [s for s in self._gains if s < first]:
            del self._gains[stop]
        states, c, ahead = [model.snapshot()], np.zeros(model.size), self._here
        found = [c]
        for stop in range(self.stops - 1, first - 1, -1):
            intervals, k = self._intervals[stop // _BATCH], stop % _BATCH
            if stop not in self._gains:
                one = slice(k, k + 1)
                self._gains[stop] = smoother_gains(
                    intervals.covariance[one], intervals.transition[one], intervals.predicted[one]
                )[0]
            c = self._gains[stop] @ (ahead + c)
            ahead = intervals.correction[k]
            states.append(intervals.states[k])
            found.append(c)
        return states[::-1], found[::-1]

    def smooth(self, model: ErrorModel, covariance: Array) -> NavigationStates | None:
        """The smoothed trajectory at the ends of all steps; None before the first.

        Parameters
        ----------
        model : ErrorModel
            The model at the end of the run. It is in the same state afterwards.
        covariance : (n, n) array
            Covariance of the model's error at the end of the run.
        """
        if not self._ends:
            return None
        count = len(self._ends)
        position, velocity, attitude = np.full((3, count, 3), np.nan)
        self.smoothed_covariance = np.full((count, 9, 9), np.nan)
        now, row = model.snapshot(), count - 1
        for smoothed in self._backward(model, covariance):
            if row < 0 or self._ends[row][0] != smoothed.stop:
                continue
            model.restore(smoothed.state)
            model.correct(smoothed.correction)
            out = model.estimate(smoothed.covariance)
            while row >= 0 and self._ends[row][0] == smoothed.stop:  # a step may hold no time at all
                for series, vector in ((position, out.position), (velocity, out.velocity), (attitude, out.attitude)):
                    if vector is not None:
                        series[row] = vector
                if out.covariance is not None:
                    self.smoothed_covariance[row] = out.covariance
                row -= 1
        model.restore(now)
        return NavigationStates(np.array([t for _, t in self._ends]), position, velocity, attitude)
