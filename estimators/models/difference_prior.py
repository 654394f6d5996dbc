"""The prior of an inertial window as a normal distribution of differences: position, velocity and rotation vector.

Where the mean state is turned from the first node, the covariance of the attitude is turned by the left Jacobian of the
rotation (`simnav.geometry.rotation.left_jacobian`). `simnav.estimators.models.group_prior` has another distribution.
"""

from __future__ import annotations

from simnav.compiled import helper, kernel
from simnav.geometry.rotation import left_jacobian_coefficients, rotated
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

from .inertial_errors import ERROR
from .marginalisation import keep_prior

__all__ = ["differences_at_mean", "differences_at_node"]


@helper
def _turn_columns(M: Array, p0: float, p1: float, p2: float, a: float, b: float) -> None:
    """Turn the attitude's part of each column of a matrix."""
    p = ERROR.attitude
    for i in range(M.shape[1]):
        M[p, i], M[p + 1, i], M[p + 2, i] = rotated(p0, p1, p2, a, b, M[p, i], M[p + 1, i], M[p + 2, i])


@helper
def _turn(P: Matrix, p0: float, p1: float, p2: float) -> None:
    """Overwrite a covariance P with ``J P J'``, where J is the left Jacobian of a rotation."""
    a, b = left_jacobian_coefficients(p0 * p0 + p1 * p1 + p2 * p2)
    _turn_columns(P, p0, p1, p2, a, b)
    _turn_columns(P.T, p0, p1, p2, a, b)


@kernel(passed=True)
def differences_at_node(covariance: Matrix, shift: Vector, linear: Matrix, mean: Vector) -> None:
    """As `simnav.estimators.models.group_prior.at_node`."""
    p = ERROR.attitude
    keep_prior(covariance, shift, linear, mean)
    _turn(linear, -shift[p], -shift[p + 1], -shift[p + 2])


@kernel(passed=True)
def differences_at_mean(linear: Matrix, mean: Vector, covariance: Matrix, shift: Vector) -> None:
    """As `simnav.estimators.models.group_prior.at_mean`."""
    p = ERROR.attitude
    keep_prior(linear, mean, covariance, shift)
    _turn(covariance, mean[p], mean[p + 1], mean[p + 2])
