"""Sigma points on the manifold: how they are drawn, and the moments that propagate and predict take from them.

A point is a state near the model's own, given by its difference from it (``point = model retracted by error``, as in
`ErrorModel.correct`: position in metres, attitude by a rotation vector, ...). All points are one (k, n) array of such
errors. With P = L L' of the n-component error of the model's state X, the points are X retracted by ``e_j = +-s L_j``,
``s^2 = alpha^2 (n + kappa)``, and the weight of each is ``w = 1/(2 s^2)``. A function f of the state (the motion over
the time between two measurements, or what an instrument reads) is evaluated at all points, and with
``d_j = f(X_j) - f(X)`` in the chart about f(X),

- mean ``f(X) + d``, with ``d = w sum d_j``
- covariance ``w sum d_j d_j' + (beta - alpha^2) d d'``, plus the noise
- cross-covariance with the state ``w sum e_j d_j'``

This is the scaled unscented transform (S. J. Julier and J. K. Uhlmann, *Unscented filtering and nonlinear estimation*,
Proc. IEEE 92, 2004; E. A. Wan and R. van der Merwe, *The unscented Kalman filter for nonlinear estimation*, 2000),
rewritten: the centre point's weights, large and of opposite sign where alpha is small, have cancelled, so that nothing
is lost to rounding, and the covariance is positive semi-definite by its form where ``beta >= alpha^2``.

`propagate_through` and `predict_through` are the same source for kernels and for Python functions.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.cholesky import factorise
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array, Measurement

from .base import ErrorModel
from .filtering import Dynamics, ModelFunctions, Prediction, Readings, SigmaPoints
from .propagation import Samples

__all__ = ["PointModel", "draw_points", "predict_through", "propagate_through"]


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


@kernel
def add_moments(points: SigmaPoints, values: Matrix, mean: Vector, covariance: Matrix) -> None:
    """Mean and covariance of what a function is at the points.

    Parameters
    ----------
    points : SigmaPoints
        The points.
    values : (2 n, m) array
        The function at the points, minus what it is at the state.
    mean : (m,) array
        Overwritten with their mean.
    covariance : (m, m) array
        Their covariance is added to it.
    """
    k, m = values.shape
    squares = np.zeros((m, m))
    for i in range(m):
        mean[i] = 0.0
    for j in range(k):
        for i in range(m):
            x = values[j, i]
            mean[i] += x
            for c in range(m):
                squares[i, c] += x * values[j, c]
    for i in range(m):
        mean[i] *= points.weight
    for i in range(m):
        for c in range(m):
            covariance[i, c] += points.weight * squares[i, c] + points.excess * (mean[i] * mean[c])


@kernel
def correlate(points: SigmaPoints, values: Matrix, cross: Matrix) -> None:
    """Overwrite (n, m) with the covariance of the state's error and a function; for the values see `add_moments`."""
    (k, n), m = points.errors.shape, values.shape[1]
    for i in range(n):
        for c in range(m):
            cross[i, c] = 0.0
    for j in range(k):
        for i in range(n):
            x = points.errors[j, i]
            if x != 0.0:
                for c in range(m):
                    cross[i, c] += x * values[j, c]
    for i in range(n):
        for c in range(m):
            cross[i, c] *= points.weight


@helper
def propagate_through(
    move: Callable[[Dynamics, Samples, float], None],
    retract: Callable[[Dynamics], None],
    dynamics: Dynamics,
    samples: Samples,
    until: float,
) -> None:
    """Advance a state and its covariance through points.

    Parameters
    ----------
    move : callable
        Advances the state and the points to a time, and overwrites the covariance with that of the noise.
    retract : callable
        Adds the correction to the state.
    dynamics, samples, until
        As `simnav.estimators.solvers.filter_step.Filter.propagate` takes them.
    """
    points = dynamics.points
    draw_points(dynamics.covariance, points.spread, points.errors)
    move(dynamics, samples, until)
    add_moments(points, points.errors, dynamics.correction, dynamics.covariance)
    retract(dynamics)


@helper
def predict_through(
    linearise: Callable[[Dynamics, Readings, int, Prediction], bool],
    read: Callable[[Dynamics, Readings, int, Array], None],
    dynamics: Dynamics,
    readings: Readings,
    k: int,
    prediction: Prediction,
) -> bool:
    """Predict a reading from points that are drawn afresh.

    Parameters
    ----------
    linearise : callable
        Predicts the reading at the state alone: its innovation and nominal noise are used.
    read : callable
        Fills in what the instrument should read at the points, minus what it should read at the state.
    dynamics, readings, k, prediction
        As `simnav.estimators.solvers.filter_step.Filter.predict` takes them.

    Returns
    -------
    bool
        False where there is no such reading at the state.
    """
    if not linearise(dynamics, readings, k, prediction):
        return False
    points, d = dynamics.points, prediction.innovation.size
    draw_points(dynamics.covariance, points.spread, points.errors)
    differences, mean = np.empty((points.errors.shape[0], d)), np.empty(d)
    read(dynamics, readings, k, differences)
    for a in range(d):
        for b in range(d):
            prediction.predicted[a, b] = 0.0
    add_moments(points, differences, mean, prediction.predicted)
    correlate(points, differences, prediction.cross)
    for a in range(d):
        prediction.innovation[a] -= mean[a]
    return True


class PointModel(ErrorModel):
    """An `ErrorModel` that propagates and observes k points in addition to its own state."""

    def point_functions(self) -> ModelFunctions | None:
        """As `functions`, with moments from points."""
        return None

    @abstractmethod
    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state to a time, and k points through the same motion.

        Parameters
        ----------
        errors : (k, n) array
            Differences of the points from the state; overwritten with those from the propagated state.
        until : float
            Time to which state and points are propagated [s].

        Returns
        -------
        (n, n) array
            Covariance of the noise that the motion adds.
        """

    @abstractmethod
    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What an instrument should read at k points, minus what it should read at the state.

        Parameters
        ----------
        measurement : Measurement
            One that `measure` says something of.
        errors : (k, n) array
            Offsets of the points from the centre.

        Returns
        -------
        (k, m) array
            In the units of the innovation; angles in [-pi, pi].
        """
