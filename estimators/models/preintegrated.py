"""Motion factors of the inertial model: shifts of nodes through preintegrated motion.

Between two nodes the front integrated the IMU samples from the state x' to y', and computed the transition matrix F.
From another node x, with the shift ``s = x - x'`` (rotation phi, biases b), the same samples lead to ``f(x) = y' + F s
+ c``. c is the effect of the rotation of the increments beyond the first order. With ``E = exp(phi x)`` and the vectors
u_p, u_v of the double and single integral of the specific force in north-east-down, which are part of F (its block of
the attitude is ``-[u x]``),

- ``c_p = (E - 1 - phi x) u_p + (E - 1) F_pb b``, and c_v likewise with u_v and F_vb; the derivative by the attitude
  is ``-[E (u_p + F_pb b) x]``
- attitude: the rotation vector of ``exp(F_phi,phi phi) exp(F_phi,b b)``

F and its bias columns turn with the node (``F_pb = C B`` with B in body axes): these are the body-frame increments and
bias Jacobians of preintegration (Forster et al. 2017, eqs. 38-44; eqs. 8-10 of Mao, Wang and Fu 2025, but with gravity
outside of the integral). Curvature and rotation of the Earth are in y' and in F, to first order in the shift.
"""

from __future__ import annotations

from math import atan2, cos, sqrt

from simnav.compiled import helper, kernel
from simnav.geometry.rotation import cross, rotated, rotation_coefficients
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

from .inertial_errors import ERROR

__all__ = ["add_shift", "move_shift", "relative_shift"]

#: Rotations below this are composed by a series [rad].
SERIES_ANGLE = 0.014


@helper
def _compose(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> tuple[float, float, float]:
    """Rotation vector of ``exp(a x) exp(b x)``.

    A series of third order (Baker, Campbell, Hausdorff) below `SERIES_ANGLE`, where it is good to 2e-9 rad; the product
    of the quaternions above it.
    """
    a, b = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2
    x0, x1, x2 = cross(a0, a1, a2, b0, b1, b2)
    if a + b < SERIES_ANGLE * SERIES_ANGLE:
        y0, y1, y2 = cross(a0 - b0, a1 - b1, a2 - b2, x0, x1, x2)
        t = 1.0 / 12.0
        return a0 + b0 + 0.5 * x0 + t * y0, a1 + b1 + 0.5 * x1 + t * y1, a2 + b2 + 0.5 * x2 + t * y2
    # sin(x/2)/x and cos(x/2) of both angles
    p, _ = rotation_coefficients(0.25 * a)
    q, _ = rotation_coefficients(0.25 * b)
    p, q, c, d = 0.5 * p, 0.5 * q, cos(0.5 * sqrt(a)), cos(0.5 * sqrt(b))
    w = c * d - p * q * (a0 * b0 + a1 * b1 + a2 * b2)
    v0 = p * d * a0 + c * q * b0 + p * q * x0
    v1 = p * d * a1 + c * q * b1 + p * q * x1
    v2 = p * d * a2 + c * q * b2 + p * q * x2
    sine = sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    if w < 0.0:  # the shorter way round
        w, v0, v1, v2 = -w, -v0, -v1, -v2
    ratio = 2.0 if sine < 1e-12 else 2.0 * atan2(sine, w) / sine
    return ratio * v0, ratio * v1, ratio * v2


@helper
def _attitude(shift: Array) -> tuple[float, float, float]:
    """The rotation vector of a shift [rad]."""
    p = ERROR.attitude
    return shift[p], shift[p + 1], shift[p + 2]


@helper
def _set_attitude(shift: Array, rotation: tuple[float, float, float]) -> None:
    """Overwrite the rotation vector of a shift [rad]."""
    p = ERROR.attitude
    shift[p], shift[p + 1], shift[p + 2] = rotation


@kernel
def move_shift(F: Matrix, s: Vector, moved: Vector, J: Matrix) -> None:
    """Propagate a shift s of a node through a motion: the shift ``moved`` at its end, and its derivative J.

    The equations are those of the module. J must hold F, or the result of an earlier call: only the rows of position,
    velocity and attitude and the columns of attitude and biases depend on the shift. Biases and calibration states are
    independent and only decay; a clock's bias also moves by the drift that follows it.
    """
    n = s.size
    m = min(n, ERROR.calibration)
    p = ERROR.attitude
    first_bias, biased = ERROR.gyroscope_bias, n >= ERROR.calibration
    for i in range(first_bias):
        x = 0.0
        for j in range(m):
            x += F[i, j] * s[j]
        moved[i] = x
        for j in range(p, m):
            J[i, j] = F[i, j]
    for i in range(first_bias, n):
        moved[i] = F[i, i] * s[i]
        if i >= ERROR.calibration and i + 1 < n and F[i, i + 1] != 0.0:
            moved[i] += F[i, i + 1] * s[i + 1]
    p0, p1, p2 = _attitude(s)
    size = p0 * p0 + p1 * p1 + p2 * p2
    if biased:
        for j in range(first_bias, m):
            size += s[j] * s[j]
    if size <= 1e-24:
        return
    a, b = rotation_coefficients(p0 * p0 + p1 * p1 + p2 * p2)
    if biased:  # their columns turn with the attitude
        for j in range(first_bias, m):
            for i in range(0, first_bias, 3):
                J[i, j], J[i + 1, j], J[i + 2, j] = rotated(p0, p1, p2, a, b, F[i, j], F[i + 1, j], F[i + 2, j])
    for i in range(0, p, 3):  # position and velocity
        u0 = 0.5 * (F[i + 1, p + 2] - F[i + 2, p + 1])
        u1 = 0.5 * (F[i + 2, p] - F[i, p + 2])
        u2 = 0.5 * (F[i, p + 1] - F[i + 1, p])
        # E (u + F_b b) - u: what the bias shift adds turns with the node, so the attitude has a share in it.
        w0, w1, w2 = rotated(p0, p1, p2, a, b, u0, u1, u2)
        w0, w1, w2 = w0 - u0, w1 - u1, w2 - u2
        x0, x1, x2 = cross(p0, p1, p2, u0, u1, u2)
        moved[i] += w0 - x0
        moved[i + 1] += w1 - x1
        moved[i + 2] += w2 - x2
        if biased:
            for j in range(first_bias, m):
                for r in range(3):
                    moved[i + r] += (J[i + r, j] - F[i + r, j]) * s[j]
                w0 += J[i, j] * s[j]
                w1 += J[i + 1, j] * s[j]
                w2 += J[i + 2, j] * s[j]
        J[i, p + 1] += w2
        J[i, p + 2] -= w1
        J[i + 1, p] -= w2
        J[i + 1, p + 2] += w0
        J[i + 2, p] += w1
        J[i + 2, p + 1] -= w0
    a0, a1, a2 = _attitude(moved)
    b0, b1, b2 = 0.0, 0.0, 0.0
    if biased:
        for j in range(first_bias, m):
            b0 += F[p, j] * s[j]
            b1 += F[p + 1, j] * s[j]
            b2 += F[p + 2, j] * s[j]
        a0, a1, a2 = a0 - b0, a1 - b1, a2 - b2
        h0, h1, h2 = rotated(p0, p1, p2, a, b, 0.5 * b0, 0.5 * b1, 0.5 * b2)
        for j in range(first_bias, ERROR.accelerometer_bias):  # the left Jacobian of exp(b x), to first order
            x0, x1, x2 = cross(h0, h1, h2, J[p, j], J[p + 1, j], J[p + 2, j])
            J[p, j] += x0
            J[p + 1, j] += x1
            J[p + 2, j] += x2
    _set_attitude(moved, _compose(a0, a1, a2, b0, b1, b2))


@kernel(passed=True)
def relative_shift(shift: Vector, step: Vector, out: Vector) -> None:
    """A shift as seen from where a step leads: rotations compose."""
    (a0, a1, a2), (b0, b1, b2) = _attitude(shift), _attitude(step)
    for j in range(shift.size):
        out[j] = shift[j] - step[j]
    _set_attitude(out, _compose(a0, a1, a2, -b0, -b1, -b2))


@helper
def add_shift(step: Array, shift: Array, out: Array) -> None:
    """A shift and a step after it; ``out`` may be the shift."""
    (a0, a1, a2), (b0, b1, b2) = _attitude(step), _attitude(shift)
    for j in range(shift.size):
        out[j] = shift[j] + step[j]
    _set_attitude(out, _compose(a0, a1, a2, b0, b1, b2))
