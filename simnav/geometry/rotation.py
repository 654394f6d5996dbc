"""Rotations: direction cosine matrices, quaternions, rotation vectors and roll-pitch-yaw.

A direction cosine matrix (DCM) C converts vectors from body axes to north-east-down (``v_n = C v_b``). Roll-pitch-yaw
is the Z-Y-X sequence, C = R_z(yaw) R_y(pitch) R_x(roll). Quaternions are scalar-first. Source: Groves 2013, chapter 2
and appendix E.

The functions work on stacks of rotations with `numpy`; the kernels work on scalars inside other kernels.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import Array, helper

__all__ = [
    "Quaternion",
    "cross",
    "dcm_from_quaternion",
    "dcm_from_rotation_vector",
    "dcm_from_rpy",
    "left_jacobian",
    "left_jacobian_coefficients",
    "multiply",
    "quaternion_from_dcm",
    "quaternion_from_rotation",
    "quaternion_from_rpy",
    "rotate_left",
    "rotate_right",
    "rotated",
    "rotation_coefficients",
    "rotation_from_quaternion",
    "rotation_vector_from_dcm",
    "rpy_from_dcm",
    "rpy_from_quaternion",
    "skew",
    "small_rotation_coefficients",
    "wrap_angle",
    "wrap_scalar",
]


def wrap_angle(angle: Array | float) -> Array:
    """Angles brought into [-pi, pi).

    Examples
    --------
    >>> wrap_angle(np.array([0.0, 3 * np.pi / 2])) / np.pi
    array([ 0. , -0.5])
    """
    return np.remainder(np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi


@helper
def wrap_scalar(angle: float) -> float:
    """`wrap_angle` for one angle."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def skew(vector: Array) -> Array:
    """Cross-product matrices: ``skew(a) @ b == cross(a, b)``.

    Parameters
    ----------
    vector : (..., 3) array
        The left factors of the cross products.

    Returns
    -------
    (..., 3, 3) array
        The skew-symmetric matrices.
    """
    v = np.asarray(vector, dtype=np.float64)
    s = np.zeros((*v.shape, 3))
    s[..., 0, 1], s[..., 0, 2], s[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    s[..., 1, 0], s[..., 2, 0], s[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return s


def dcm_from_rpy(rpy: Array) -> Array:
    """DCM body to north-east-down of roll, pitch, yaw.

    Parameters
    ----------
    rpy : (..., 3) array
        Roll, pitch, yaw [rad].

    Returns
    -------
    (..., 3, 3) array
        Groves eq. 2.22, transposed.
    """
    rpy = np.asarray(rpy, dtype=np.float64)
    sine, cosine = np.sin(rpy), np.cos(rpy)
    sr, sp, sy = sine[..., 0], sine[..., 1], sine[..., 2]
    cr, cp, cy = cosine[..., 0], cosine[..., 1], cosine[..., 2]
    dcm = np.empty((*rpy.shape, 3))  # np.stack would take as long as all the rest, ten times over
    dcm[..., 0, 0], dcm[..., 0, 1], dcm[..., 0, 2] = cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy
    dcm[..., 1, 0], dcm[..., 1, 1], dcm[..., 1, 2] = cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy
    dcm[..., 2, 0], dcm[..., 2, 1], dcm[..., 2, 2] = -sp, sr * cp, cr * cp
    return dcm


def rpy_from_dcm(dcm: Array) -> Array:
    """Roll, pitch, yaw of a DCM body to north-east-down.

    Parameters
    ----------
    dcm : (..., 3, 3) array
        Rotation matrices, body to north-east-down.

    Returns
    -------
    (..., 3) array
        Roll, pitch, yaw [rad]; pitch in [-pi/2, pi/2] (Groves eq. 2.23).
    """
    c = np.asarray(dcm)
    pitch = np.arctan2(-c[..., 2, 0], np.hypot(c[..., 2, 1], c[..., 2, 2]))
    roll = np.arctan2(c[..., 2, 1], c[..., 2, 2])
    yaw = np.arctan2(c[..., 1, 0], c[..., 0, 0])
    return np.stack([roll, pitch, yaw], axis=-1)


def dcm_from_rotation_vector(vector: Array) -> Array:
    """Matrix exponential of ``skew(vector)`` (Rodrigues' formula).

    Parameters
    ----------
    vector : (..., 3) array
        Axis times angle of the rotation [rad].

    Returns
    -------
    (..., 3, 3) array
        The rotation matrices.
    """
    v = np.asarray(vector, dtype=np.float64)
    angle2 = np.sum(v * v, axis=-1)[..., None, None]
    angle = np.sqrt(angle2)
    s = skew(v)
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    dcm: Array = np.eye(3) + a * s + b * (s @ s)
    return dcm


def rotation_vector_from_dcm(dcm: Array) -> Array:
    """Rotation vector of a DCM: the inverse of `dcm_from_rotation_vector`, accurate up to pi.

    Parameters
    ----------
    dcm : (..., 3, 3) array
        Rotation matrices.

    Returns
    -------
    (..., 3) array
        Rotation vectors [rad], with a length in [0, pi].
    """
    q = quaternion_from_dcm(dcm)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    with np.errstate(invalid="ignore", divide="ignore"):
        factor = np.where(sine > 1e-12, 2.0 * half / sine, 2.0)
    return factor * q[..., 1:]


def left_jacobian(rotation: Array) -> Array:
    """Left Jacobian of SO(3): ``exp((phi + d) x) = exp((J d) x) exp(phi x)`` to first order in d.

    Parameters
    ----------
    rotation : (3,) array
        Rotation vector phi [rad].

    Returns
    -------
    (3, 3) array
        The matrix J. Source: J. Sola, J. Deray and D. Atchuthan, *A micro Lie theory*, 2018, eq. 145.
    """
    x, y, z = rotation.tolist()
    angle2 = x * x + y * y + z * z
    if angle2 < 1e-6:
        a, b = 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        angle = sqrt(angle2)
        a, b = (1.0 - cos(angle)) / angle2, (angle - sin(angle)) / (angle2 * angle)
    one = 1.0 - b * angle2  # [phi x]^2 = phi phi' - |phi|^2 I
    return np.array([
        [one + b * x * x, b * x * y - a * z, b * x * z + a * y],
        [b * x * y + a * z, one + b * y * y, b * y * z - a * x],
        [b * x * z - a * y, b * y * z + a * x, one + b * z * z],
    ])  # fmt: skip


def dcm_from_quaternion(quaternion: Array) -> Array:
    """DCM of unit quaternions, scalar first: the inverse of `quaternion_from_dcm`.

    Parameters
    ----------
    quaternion : (..., 4) array
        Unit quaternions.

    Returns
    -------
    (..., 3, 3) array
        Rotation matrices (Groves eq. 2.34).
    """
    w, x, y, z = np.moveaxis(np.asarray(quaternion), -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def quaternion_from_dcm(dcm: Array) -> Array:
    """Unit quaternion, scalar first, of a DCM (Shepperd's method: the largest component is divided by).

    Parameters
    ----------
    dcm : (..., 3, 3) array
        Rotation matrices.

    Returns
    -------
    (..., 4) array
        Unit quaternions, scalar first.
    """
    c = np.asarray(dcm, dtype=np.float64)
    d0, d1, d2 = c[..., 0, 0], c[..., 1, 1], c[..., 2, 2]
    squares = np.empty((*c.shape[:-2], 4))
    squares[..., 0], squares[..., 1] = 1 + d0 + d1 + d2, 1 + d0 - d1 - d2
    squares[..., 2], squares[..., 3] = 1 - d0 + d1 - d2, 1 - d0 - d1 + d2
    x, y, z = c[..., 2, 1] - c[..., 1, 2], c[..., 0, 2] - c[..., 2, 0], c[..., 1, 0] - c[..., 0, 1]
    xy, xz, yz = c[..., 1, 0] + c[..., 0, 1], c[..., 0, 2] + c[..., 2, 0], c[..., 2, 1] + c[..., 1, 2]
    candidates = np.empty((*c.shape[:-2], 4, 4))
    rows = (
        (squares[..., 0], x, y, z),
        (x, squares[..., 1], xy, xz),
        (y, xy, squares[..., 2], yz),
        (z, xz, yz, squares[..., 3]),
    )
    for i, row in enumerate(rows):
        for j, element in enumerate(row):
            candidates[..., i, j] = element
    largest = squares.reshape(-1, 4).argmax(axis=-1)
    q = candidates.reshape(-1, 4, 4)[np.arange(len(largest)), largest].reshape(squares.shape)
    unit: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


@helper
def cross(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> tuple[float, float, float]:
    """Vector product of two 3-vectors of scalars."""
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@helper
def small_rotation_coefficients(angle2: float) -> tuple[float, float]:
    """`rotation_coefficients` by their series, exact to rounding for ``angle2`` below 1e-3."""
    # Reciprocals are folded when compiled: a division costs as much as five products.
    a = 1.0 - angle2 * (1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 * (1.0 / 5040.0)))
    b = 0.5 - angle2 * (1.0 / 24.0 - angle2 * (1.0 / 720.0 - angle2 * (1.0 / 40320.0)))
    return a, b


@helper
def rotation_coefficients(angle2: float) -> tuple[float, float]:
    """The coefficients sin(x)/x and (1 - cos(x))/x^2 for x^2 = ``angle2``, exact to rounding."""
    if angle2 < 1e-3:
        return small_rotation_coefficients(angle2)
    angle = sqrt(angle2)
    return sin(angle) / angle, (1.0 - cos(angle)) / angle2


@helper
def left_jacobian_coefficients(angle2: float) -> tuple[float, float]:
    """The coefficients with which `rotated` applies the left Jacobian of a rotation of the square ``angle2``."""
    sine, a = rotation_coefficients(angle2)
    return a, 1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 / 5040.0) if angle2 < 1e-3 else (1.0 - sine) / angle2


@helper
def rotated(
    r0: float, r1: float, r2: float, a: float, b: float, v0: float, v1: float, v2: float
) -> tuple[float, float, float]:
    """``exp(r x) v = v + a r x v + b r x (r x v)``, with the coefficients a, b of `rotation_coefficients`."""
    x0, x1, x2 = cross(r0, r1, r2, v0, v1, v2)
    y0, y1, y2 = cross(r0, r1, r2, x0, x1, x2)
    return v0 + a * x0 + b * y0, v1 + a * x1 + b * y1, v2 + a * x2 + b * y2


@helper
def rotate_left(dcm: Array, r0: float, r1: float, r2: float, a: float, b: float, turned: Array) -> None:
    """``turned = exp(r x) dcm``, with the coefficients a, b of `rotation_coefficients`; it may be the dcm itself."""
    for j in range(3):
        turned[0, j], turned[1, j], turned[2, j] = rotated(r0, r1, r2, a, b, dcm[0, j], dcm[1, j], dcm[2, j])


@helper
def rotate_right(dcm: Array, r0: float, r1: float, r2: float, a: float, b: float) -> None:
    """``dcm = dcm exp(r x)`` in place, with the coefficients a, b of `rotation_coefficients`."""
    for i in range(3):
        c0, c1, c2 = dcm[i, 0], dcm[i, 1], dcm[i, 2]
        # A row times [r x] is row x r.
        x0, x1, x2 = cross(c0, c1, c2, r0, r1, r2)
        y0, y1, y2 = cross(x0, x1, x2, r0, r1, r2)
        dcm[i, 0] = c0 + a * x0 + b * y0
        dcm[i, 1] = c1 + a * x1 + b * y1
        dcm[i, 2] = c2 + a * x2 + b * y2


class Quaternion(NamedTuple):
    """A unit quaternion of scalars, for kernels."""

    w: float
    x: float
    y: float
    z: float


@helper
def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """The rotation q, and then p."""
    return Quaternion(
        p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z,
        p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
        p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
        p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
    )


@helper
def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quaternion:
    """The rotation from body to north-east-down."""
    cr, cp, cy = cos(0.5 * roll), cos(0.5 * pitch), cos(0.5 * yaw)
    sr, sp, sy = sin(0.5 * roll), sin(0.5 * pitch), sin(0.5 * yaw)
    return Quaternion(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@helper
def rpy_from_quaternion(q: Quaternion) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation from body to north-east-down."""
    down_x, down_y = 2.0 * (q.x * q.z - q.w * q.y), 2.0 * (q.y * q.z + q.w * q.x)
    down_z = 1.0 - 2.0 * (q.x * q.x + q.y * q.y)
    yaw = atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return atan2(down_y, down_z), atan2(-down_x, sqrt(down_y * down_y + down_z * down_z)), yaw


@helper
def quaternion_from_rotation(x: float, y: float, z: float) -> Quaternion:
    """The rotation of a rotation vector."""
    angle = sqrt(x * x + y * y + z * z)
    sine = sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    return Quaternion(cos(0.5 * angle), sine * x, sine * y, sine * z)


@helper
def rotation_from_quaternion(q: Quaternion) -> tuple[float, float, float]:
    """The rotation vector, of up to half a turn."""
    sine = sqrt(q.x * q.x + q.y * q.y + q.z * q.z)
    half = atan2(sine, abs(q.w))
    factor = (2.0 if q.w >= 0.0 else -2.0) * (half / sine if sine > 1e-12 else 1.0)
    return factor * q.x, factor * q.y, factor * q.z
