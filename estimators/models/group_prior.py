"""The prior of an inertial window as a normal distribution on the group SE_2(3) of attitude, velocity and position.

What nodes that left a window have said is a mean state Y with a covariance. The first node X that stays moves away from
Y with later measurements, and so the prior is to be linearised at X. If the *differences* of X and Y are taken as
normal, a window gains information that nothing has measured: beside a DVL alone a turn of the whole track changes no
reading, but it changes the differences of velocity by the turn times the velocity, and that depends on where it is
linearised. Here the right-invariant error ``xi = log(Y X^-1)`` is normal, which such a turn changes by a constant.

With the shift ``(p, v, phi)`` of Y from X (differences of position and velocity, rotation vector), the left Jacobian J
of SO(3) and the step ``(dp, dv, dphi)`` of X, the linearised prior has

- the mean ``(J(phi)^-1 p, J(phi)^-1 v, phi)``;
- the covariance ``N P N'``, where P is that of the differences at Y. N has ``J(-phi)`` on the diagonal, and turns an
  error e of the attitude into ``v x e / 2 - (phi x (v x e) + v x (phi x e)) / 12 - (phi v) (phi x e) / 24`` of the
  velocity, and likewise of the position with p, to second order in phi. (N is ``T(X)^-1 J_r(xi) T(Y)``, where T leads
  from differences to xi, and J_r is the right Jacobian of SE_2(3).)

`at_mean` is the inverse of `at_node`, so that what a node leaves behind is at first exactly what was eliminated.

Sources: A. Barrau and S. Bonnabel, *The invariant extended Kalman filter as a stable observer*, IEEE TAC 62(4), 2017;
T. D. Barfoot, *State Estimation for Robotics*, 2nd ed. 2024, section 8.1 (Jacobians); G. P. Huang, A. I. Mourikis and
S. I. Roumeliotis, *Observability-based rules for designing consistent EKF SLAM estimators*, Int. J. of Robotics
Research 29(5), 2010 (information that nothing has measured).
"""

from __future__ import annotations

from math import cos, sin, sqrt

from simnav.compiled import helper, kernel
from simnav.geometry.rotation import cross, left_jacobian_coefficients, rotated
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

from .inertial_errors import ERROR
from .marginalisation import keep_prior

__all__ = ["at_mean", "at_node"]


@helper
def _inverse_coefficients(angle2: float) -> tuple[float, float]:
    """As `left_jacobian_coefficients`, of its inverse."""
    if angle2 < 1e-3:
        return -0.5, 1.0 / 12.0 + angle2 / 720.0
    half = 0.5 * sqrt(angle2)
    return -0.5, (1.0 - half * cos(half) / sin(half)) / angle2


@helper
def _square(shift: Vector) -> float:
    """The square of the angle of a shift's rotation [rad^2]."""
    p = ERROR.attitude
    square: float = shift[p] * shift[p] + shift[p + 1] * shift[p + 1] + shift[p + 2] * shift[p + 2]
    return square


@helper
def _turn_motion(mean: Vector, a: float, b: float, turned: Vector) -> None:
    """Apply `rotated` by the rotation of a mean to its position and velocity."""
    p = ERROR.attitude
    for k in range(0, p, 3):
        turned[k], turned[k + 1], turned[k + 2] = rotated(
            mean[p], mean[p + 1], mean[p + 2], a, b, mean[k], mean[k + 1], mean[k + 2]
        )


@helper
def _of_attitude(shift: Vector, k: int, e0: float, e1: float, e2: float) -> tuple[float, float, float]:
    """What an error of the attitude makes of velocity or position, whose place is k (second item of the module)."""
    p = ERROR.attitude
    f0, f1, f2 = shift[p], shift[p + 1], shift[p + 2]
    v0, v1, v2 = shift[k], shift[k + 1], shift[k + 2]
    a0, a1, a2 = cross(v0, v1, v2, e0, e1, e2)
    b0, b1, b2 = cross(f0, f1, f2, a0, a1, a2)
    c0, c1, c2 = cross(f0, f1, f2, e0, e1, e2)
    d0, d1, d2 = cross(v0, v1, v2, c0, c1, c2)
    c, t = (f0 * v0 + f1 * v1 + f2 * v2) / 24.0, 1.0 / 12.0
    return (
        0.5 * a0 - t * (b0 + d0) - c * c0,
        0.5 * a1 - t * (b1 + d1) - c * c1,
        0.5 * a2 - t * (b2 + d2) - c * c2,
    )


@helper
def _columns_to_node(M: Array, shift: Vector, a: float, b: float) -> None:
    """Multiply the columns of a matrix by N; a and b are the coefficients of J."""
    p = ERROR.attitude
    f0, f1, f2 = -shift[p], -shift[p + 1], -shift[p + 2]
    for i in range(M.shape[1]):
        for k in range(0, p, 3):
            x0, x1, x2 = _of_attitude(shift, k, M[p, i], M[p + 1, i], M[p + 2, i])
            y0, y1, y2 = rotated(f0, f1, f2, a, b, M[k, i], M[k + 1, i], M[k + 2, i])
            M[k, i], M[k + 1, i], M[k + 2, i] = x0 + y0, x1 + y1, x2 + y2
        M[p, i], M[p + 1, i], M[p + 2, i] = rotated(f0, f1, f2, a, b, M[p, i], M[p + 1, i], M[p + 2, i])


@helper
def _columns_to_mean(M: Array, shift: Vector, a: float, b: float) -> None:
    """Multiply the columns of a matrix by the inverse of N; a and b are the coefficients of the inverse of J."""
    p = ERROR.attitude
    f0, f1, f2 = -shift[p], -shift[p + 1], -shift[p + 2]
    for i in range(M.shape[1]):
        M[p, i], M[p + 1, i], M[p + 2, i] = rotated(f0, f1, f2, a, b, M[p, i], M[p + 1, i], M[p + 2, i])
        for k in range(0, p, 3):
            x0, x1, x2 = _of_attitude(shift, k, M[p, i], M[p + 1, i], M[p + 2, i])
            M[k, i], M[k + 1, i], M[k + 2, i] = rotated(
                f0, f1, f2, a, b, M[k, i] - x0, M[k + 1, i] - x1, M[k + 2, i] - x2
            )


@kernel(passed=True)
def at_node(covariance: Matrix, shift: Vector, linear: Matrix, mean: Vector) -> None:
    """Linearise a prior at a node.

    Parameters
    ----------
    covariance : (n, n) array
        Of the differences from the mean state, at the mean state.
    shift : (n,) array
        Of the mean state from the node; its rotation is below a whole turn.
    linear : (n, n) array
        Overwritten: the covariance at the node.
    mean : (n,) array
        Overwritten: the mean as a step of the node.
    """
    keep_prior(covariance, shift, linear, mean)
    angle2 = _square(shift)
    if angle2 > 0.0:
        a, b = left_jacobian_coefficients(angle2)
        _columns_to_node(linear, shift, a, b)
        _columns_to_node(linear.T, shift, a, b)
        a, b = _inverse_coefficients(angle2)
        _turn_motion(shift, a, b, mean)


@kernel(passed=True)
def at_mean(linear: Matrix, mean: Vector, covariance: Matrix, shift: Vector) -> None:
    """The inverse of `at_node`: the prior whose linearisation at a node is given; the last two are overwritten."""
    keep_prior(linear, mean, covariance, shift)
    angle2 = _square(mean)
    if angle2 > 0.0:
        a, b = left_jacobian_coefficients(angle2)
        _turn_motion(mean, a, b, shift)
        a, b = _inverse_coefficients(angle2)
        _columns_to_mean(covariance, shift, a, b)
        _columns_to_mean(covariance.T, shift, a, b)
