"""The two-filter smoother: a filter forward, a filter backward, both combined; behind any Kalman filter.

At each time the forward filter's posterior (covariance Pf) and the backward filter's prediction (Pb), which has seen
the measurements after that time and no other, are independent, and so

- ``P^-1 = Pf^-1 + Pb^-1``
- ``P^-1 x = Pf^-1 xf + Pb^-1 xb``

which are eqs. 24-25 of the AUV smoothing paper (*Post-processing algorithm based on factor graph optimization for AUV
integrated navigation*, 2022, doi:10.1177/01423312221109880). The backward filter starts without information, so Pb^-1
is singular until enough has been measured; it is never inverted. As printed, step 3 of the paper starts the backward
pass with the forward result. Every measurement then counts twice, and the standard deviations are too small by up to
sqrt(2). ``seed_backward`` does this.

Both filters share one linearisation, the forward filter's: what it saw of each measurement (innovation, H, R) and of
each interval (Phi, and Q as what M has beyond Phi P Phi'). So the result equals the Rauch-Tung-Striebel smoother's
(`simnav.estimators.solvers.smoother`) to rounding. The backward filter's state is delta, truth minus the forward
filter's estimate, known as ``U delta = z + noise`` of unit covariance: the square root of its information, which need
not be regular and loses no digits. Backward,

- over a correction d of the forward filter, ``z += U d``: the estimate before it differs by d
- a measurement adds the rows ``L^-1 H delta = L^-1 r``, with R = L L'
- over an interval, ``delta_{k+1} = Phi delta_k + G w`` with Q = G G' and w of unit covariance is put in, and w taken
  out by an orthogonal triangularisation of ``[I, 0 | 0; U G, U Phi | z]``. In terms of the information Y = U'U that is
  ``Phi' (Y - Y G (I + G'Y G)^-1 G'Y) Phi``, which is ``Phi' (Y^-1 + Q)^-1 Phi`` where there is an inverse.

Combining is using ``U delta = z`` as one more measurement of the forward posterior.

Sources: D. C. Fraser and J. E. Potter, "The optimum linear smoother as a combination of two optimum linear filters",
IEEE Trans. Automatic Control 14(4), 1969; G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*,
1977, chapters V and X, for the square roots.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from simnav.estimator import UnsuitableScenario
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.types import Array, Datasheet

from .smoother import Entries, FilteredIntervals, SmoothedStop, Smoother, scale_of

__all__ = ["TwoFilterSmoother"]


class _Used(NamedTuple):
    """A measurement that the forward filter used: its stop, L^-1 r, L^-1 H, and the correction it made."""

    stop: int
    residual: Array
    jacobian: Array
    correction: Array


class TwoFilterSmoother(Smoother):
    """The smoother of the module, a piece of `KalmanEstimator`.

    It costs more than `Smoother`, and stores the measurements beside; it is there to check that one.

    Parameters
    ----------
    seed_backward : bool
        Start the backward filter with the forward result, as the post-processing paper prints it, instead of with
        nothing. Uses all data twice: optimistic.
    """

    stepwise = True

    def __init__(self, seed_backward: bool = False):
        self.seed_backward = seed_backward

    def begin(self, model: ErrorModel, observed: Sequence[Datasheet]) -> None:
        """Begin a run; UnsuitableScenario where an instrument is said to be without noise."""
        exact = [s.name for s in observed if not np.all(s.sigma > 0.0)]
        if exact:
            raise UnsuitableScenario(f"a filter that runs backward needs sigmas above 0; {exact[0]}'s are not")
        super().begin(model, observed)
        self._seen = Entries[_Used]()

    def use(self, correction: Array, linearised: Linearised | None, noise: Array | None) -> None:
        """Note a measurement, whitened, and the correction that it made."""
        super().use(correction, linearised, noise)
        assert linearised is not None
        assert noise is not None
        residual, jacobian, _ = linearised
        white = np.linalg.solve(np.linalg.cholesky(noise), np.column_stack([jacobian, residual]))
        self._seen.append(_Used(self.stops, white[:, -1], white[:, :-1], correction.copy()))

    def _backward(self, model: ErrorModel, covariance: Array) -> Iterator[SmoothedStop]:
        n, stop = model.size, self.stops
        root, known = np.zeros((0, n)), np.zeros(0)  # U and z, just after the measurements of the stop
        if self.seed_backward:
            root, known = _information_root(covariance), np.zeros(n)
        yield SmoothedStop(stop, model.snapshot(), *_combine(covariance, root, known))
        array, seen = np.zeros((0, 0)), self._seen.copy()
        for intervals in reversed(self._intervals):
            noise = _noise_roots(intervals)
            for k in range(intervals.count - 1, -1, -1):
                while seen and seen[-1].stop == stop:
                    used = seen.pop()
                    known = np.concatenate([known + root @ used.correction, used.residual])
                    root = np.vstack([root, used.jacobian])
                rows = n + len(root)
                if array.shape[0] != rows:
                    array = np.zeros((rows, 2 * n + 1))
                array[:n] = 0.0
                array[range(n), range(n)] = 1.0
                array[n:, :n] = root @ noise[k]
                array[n:, n : 2 * n] = root @ intervals.transition[k]
                array[n:, 2 * n] = known
                triangle = np.asarray(np.linalg.qr(array, mode="r"))
                root, known = triangle[n : 2 * n, n : 2 * n], triangle[n : 2 * n, 2 * n]
                stop -= 1
                yield SmoothedStop(stop, intervals.states[k], *_combine(intervals.covariance[k], root, known))


def _noise_roots(intervals: FilteredIntervals) -> Array:
    """(k, n, n) array: G with Q = M - Phi P Phi' = G G', each in units of the predicted sigmas."""
    p, phi, m = intervals.matrices()
    scale = scale_of(m)
    noise = (m - phi @ p @ phi.swapaxes(1, 2)) / scale[:, :, None] / scale[:, None, :]
    values, vectors = np.linalg.eigh(0.5 * (noise + noise.swapaxes(1, 2)))
    roots: Array = scale[:, :, None] * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return roots


def _information_root(covariance: Array) -> Array:
    """(n, n) array: U with P^-1 = U'U; nothing for what is known without error."""
    scale = scale_of(covariance[None])[0]
    values, vectors = np.linalg.eigh(covariance / scale[:, None] / scale)
    inverse = np.zeros_like(values)
    inverse[values > 1e-15] = values[values > 1e-15] ** -0.5
    root: Array = inverse[:, None] * vectors.T / scale
    return root


def _combine(covariance: Array, root: Array, known: Array) -> tuple[Array, Array]:
    """What the smoother adds to the forward state, and its covariance: ``U delta = z`` used as a measurement."""
    combined, correction = covariance.copy(), np.zeros(len(covariance))
    if len(root):
        cross = np.ascontiguousarray(covariance @ root.T)
        joseph_update(combined, cross, root @ cross + np.eye(len(root)), np.ascontiguousarray(known), correction)
    return correction, combined
