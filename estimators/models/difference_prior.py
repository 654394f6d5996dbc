"""The prior of an inertial window as a normal distribution of differences: position, velocity and rotation vector.

Where the mean state is turned from the first node, the covariance of the attitude is turned by the left Jacobian of the
rotation (`simnav.geometry.rotation.left_jacobian`). `simnav.estimators.models.group_prior` has another distribution.
"""

from __future__ import annotations

from simnav.compiled import helper, kernel
from simnav.geometry.rotation import rotated, rotation_coefficients
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

from .inertial_errors import ERROR

__all__ = ["differences_at_mean", "differences_at_node"]


@helper
def _turn_columns(M: Array, p0: float, p1: float, p2: float, a: float, b: float) -> None:
    """Turn the attitude's part of each column of a matrix."""
    p = ERROR.attitude
    for i in range(M.shape[1]):
        M[p, i], M[p + 1, i], M[p + 2, i] = rotated(p0, p1, p2, a, b, M[p, i], M[p + 1, i], M[p + 2, i])


@helper
def _turn(P: Matrix, p0: float, p1: float, p2: float, out: Matrix) -> None:
    """``J P J'`` with the left Jacobian J of a rotation."""
    angle2 = p0 * p0 + p1 * p1 + p2 * p2
    # `rotated` with the coefficients of the left Jacobian
    sine, a = rotation_coefficients(angle2)
    b = 1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 / 5040.0) if angle2 < 1e-3 else (1.0 - sine) / angle2
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            out[i, j] = P[i, j]
    _turn_columns(out, p0, p1, p2, a, b)
    _turn_columns(out.T, p0, p1, p2, a, b)


@kernel(passed=True)
def differences_at_node(covariance: Matrix, shift: Vector, linear: Matrix, mean: Vector) -> None:
    """As `simnav.estimators.models.group_prior.at_node`."""
    p = ERROR.attitude
    _turn(covariance, -shift[p], -shift[p + 1], -shift[p + 2], linear)
    for i in range(shift.size):
        mean[i] = shift[i]


@kernel(passed=True)
def differences_at_mean(linear: Matrix, mean: Vector, covariance: Matrix, shift: Vector) -> None:
    """As `simnav.estimators.models.group_prior.at_mean`."""
    p = ERROR.attitude
    _turn(linear, mean[p], mean[p + 1], mean[p + 2], covariance)
    for i in range(mean.size):
        shift[i] = mean[i]
