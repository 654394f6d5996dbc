"""Differences of estimates, estimates that differ by one, and the mean of several: for solvers with several filters.

A kernel takes the vectors of an estimate as nine numbers in the order of `simnav.types.COMPONENTS`, but for the
position, which is latitude, longitude [rad] and height [m], and the attitude, which is roll, pitch and yaw [rad].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.estimators.models.inertial_errors import PART
from simnav.geometry.earth import displace_scalar, radii_scalar
from simnav.geometry.rotation import wrap_scalar
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.types import Array, Estimate

__all__ = ["difference", "differences", "displaced", "mean_of"]

#: First of the numbers of each vector.
_POSITION, _VELOCITY, _ATTITUDE = (part.start for part in (PART.position, PART.velocity, PART.attitude))
_PARTS = {"position": PART.position, "velocity": PART.velocity, "attitude": PART.attitude}


class _Quaternion(NamedTuple):
    """A unit quaternion, scalar first."""

    w: float
    x: float
    y: float
    z: float


@helper
def _quaternion(roll: float, pitch: float, yaw: float) -> _Quaternion:
    """The rotation from body to north-east-down."""
    cr, cp, cy = cos(0.5 * roll), cos(0.5 * pitch), cos(0.5 * yaw)
    sr, sp, sy = sin(0.5 * roll), sin(0.5 * pitch), sin(0.5 * yaw)
    return _Quaternion(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


@helper
def _product(p: _Quaternion, q: _Quaternion) -> _Quaternion:
    """The rotation q, and then p."""
    return _Quaternion(
        p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z,
        p.w * q.x + p.x * q.w + p.y * q.z - p.z * q.y,
        p.w * q.y - p.x * q.z + p.y * q.w + p.z * q.x,
        p.w * q.z + p.x * q.y - p.y * q.x + p.z * q.w,
    )


@helper
def _subtract(one: Vector, other: Vector, difference: Vector) -> None:
    """The difference of two states [m, m/s, rad]; the attitude as the rotation vector of ``C C_other'``."""
    meridian, prime_vertical = radii_scalar(sin(other[_POSITION]))
    height = other[_POSITION + 2]
    difference[_POSITION] = (one[_POSITION] - other[_POSITION]) * (meridian + height)
    east = wrap_scalar(one[_POSITION + 1] - other[_POSITION + 1])
    difference[_POSITION + 1] = east * (prime_vertical + height) * cos(other[_POSITION])
    difference[_POSITION + 2] = height - one[_POSITION + 2]
    for i in range(_VELOCITY, _VELOCITY + 3):
        difference[i] = one[i] - other[i]
    a = _ATTITUDE
    q = _quaternion(other[a], other[a + 1], other[a + 2])
    turn = _product(_quaternion(one[a], one[a + 1], one[a + 2]), _Quaternion(q.w, -q.x, -q.y, -q.z))
    sine = sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z)
    half = atan2(sine, abs(turn.w))
    factor = (2.0 if turn.w >= 0.0 else -2.0) * (half / sine if sine > 1e-12 else 1.0)
    difference[a], difference[a + 1], difference[a + 2] = factor * turn.x, factor * turn.y, factor * turn.z


@helper
def _add(state: Vector, error: Vector, moved: Vector) -> None:
    """The state that differs by an error from another one."""
    moved[_POSITION], moved[_POSITION + 1], moved[_POSITION + 2] = displace_scalar(
        state[_POSITION], state[_POSITION + 1], state[_POSITION + 2],
        error[_POSITION], error[_POSITION + 1], error[_POSITION + 2],
    )  # fmt: skip
    for i in range(_VELOCITY, _VELOCITY + 3):
        moved[i] = state[i] + error[i]
    a = _ATTITUDE
    x, y, z = error[a], error[a + 1], error[a + 2]
    angle = sqrt(x * x + y * y + z * z)
    sine = sin(0.5 * angle) / angle if angle > 1e-12 else 0.5
    turn = _Quaternion(cos(0.5 * angle), sine * x, sine * y, sine * z)
    q = _product(turn, _quaternion(state[a], state[a + 1], state[a + 2]))
    down_x, down_y = 2.0 * (q.x * q.z - q.w * q.y), 2.0 * (q.y * q.z + q.w * q.x)
    down_z = 1.0 - 2.0 * (q.x * q.x + q.y * q.y)
    moved[a], moved[a + 1] = atan2(down_y, down_z), atan2(-down_x, sqrt(down_y * down_y + down_z * down_z))
    moved[a + 2] = atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


@kernel
def _subtract_all(states: Matrix, other: Vector, differences: Matrix) -> None:
    """Apply `_subtract` to K states."""
    for k in range(states.shape[0]):
        _subtract(states[k], other, differences[k])


@kernel
def _displace(state: Vector, error: Vector, moved: Vector) -> None:
    """Apply `_add`."""
    _add(state, error, moved)


@kernel
def _mix(states: Matrix, covariances: Stack, weights: Vector, mean: Vector, covariance: Matrix) -> None:
    """The mean of K states and its covariance, by their weights, in the tangent space of the first."""
    count, n = states.shape
    apart, middle = np.empty((count, n)), np.zeros(n)
    for k in range(count):
        _subtract(states[k], states[0], apart[k])
        for i in range(n):
            middle[i] += weights[k] * apart[k, i]
    covariance[:] = 0.0
    for k in range(count):
        for i in range(n):
            for j in range(n):
                spread = (apart[k, i] - middle[i]) * (apart[k, j] - middle[j])
                covariance[i, j] += weights[k] * (covariances[k, i, j] + spread)
    _add(states[0], middle, mean)


def _numbers(estimate: Estimate) -> Array:
    """The nine numbers of an estimate; 0 for what it lacks."""
    state = np.zeros(9)
    for name, part in _PARTS.items():
        vector = getattr(estimate, name)
        if vector is not None:
            state[part] = vector
    return state


def differences(estimates: Sequence[Estimate], other: Estimate) -> Array:
    """Estimates minus another one, over `simnav.types.COMPONENTS` [m, m/s, rad].

    Returns
    -------
    (k, 9) array
        The attitude as the rotation vector of ``C C_other'``; zero for vectors that one of the two lacks.
    """
    found = np.empty((len(estimates), 9))
    _subtract_all.unchecked(np.array([_numbers(one) for one in estimates]).reshape(-1, 9), _numbers(other), found)
    for name, part in _PARTS.items():
        lacking = [getattr(one, name) is None or getattr(other, name) is None for one in estimates]
        if any(lacking):
            found[lacking, part] = 0.0
    return found


def difference(estimate: Estimate, other: Estimate) -> Array:
    """`differences` of one estimate, (9,)."""
    first: Array = differences([estimate], other)[0]
    return first


def _moved(estimate: Estimate, state: Array, covariance: Array) -> Estimate:
    """The estimate with the vectors that it has in nine numbers, and another covariance."""
    return replace(
        estimate,
        position=None if estimate.position is None else state[PART.position],
        velocity=None if estimate.velocity is None else state[PART.velocity],
        attitude=None if estimate.attitude is None else state[PART.attitude],
        covariance=covariance,
    )


def displaced(estimate: Estimate, error: Array, covariance: Array) -> Estimate:
    """The estimate with a (9,) difference added, and another covariance."""
    state = np.empty(9)
    _displace.unchecked(_numbers(estimate), ready(error), state)
    return _moved(estimate, state, covariance)


def mean_of(estimates: Sequence[Estimate], weights: Array) -> Estimate:
    """The mean of estimates that have the same vectors, with the covariance of their mixture.

    Parameters
    ----------
    estimates : sequence of Estimate
        The estimates, with covariances; all else is that of the first.
    weights : (k,) array
        Their weights, which sum to 1.
    """
    state, covariance = np.empty(9), np.empty((9, 9))
    states = np.array([_numbers(one) for one in estimates])
    _mix.unchecked(states, np.array([one.covariance for one in estimates]), ready(weights), state, covariance)
    return _moved(estimates[0], state, covariance)
