"""Differences of estimates, and the mean of several: for solvers with several filters.

A kernel takes the vectors of an estimate as nine numbers in the order of `simnav.types.COMPONENTS`, but for the
position, which is latitude, longitude [rad] and height [m], and the attitude, which is roll, pitch and yaw [rad].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, sin

import numpy as np

from simnav.compiled import helper, kernel, ready
from simnav.estimators.models.inertial_errors import PART
from simnav.geometry.earth import displace_scalar, radii_scalar
from simnav.geometry.rotation import (
    Quaternion,
    multiply,
    quaternion_from_rotation,
    quaternion_from_rpy,
    rotation_from_quaternion,
    rpy_from_quaternion,
    wrap_scalar,
)
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.types import Array, Estimate

__all__ = ["difference", "differences", "mean_of"]

#: First of the numbers of each vector.
_POSITION, _VELOCITY, _ATTITUDE = (part.start for part in (PART.position, PART.velocity, PART.attitude))
_PARTS = {"position": PART.position, "velocity": PART.velocity, "attitude": PART.attitude}


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
    q = quaternion_from_rpy(other[a], other[a + 1], other[a + 2])
    turn = multiply(quaternion_from_rpy(one[a], one[a + 1], one[a + 2]), Quaternion(q.w, -q.x, -q.y, -q.z))
    difference[a], difference[a + 1], difference[a + 2] = rotation_from_quaternion(turn)


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
    turn = quaternion_from_rotation(error[a], error[a + 1], error[a + 2])
    q = multiply(turn, quaternion_from_rpy(state[a], state[a + 1], state[a + 2]))
    moved[a], moved[a + 1], moved[a + 2] = rpy_from_quaternion(q)


@kernel
def _subtract_all(states: Matrix, other: Vector, differences: Matrix) -> None:
    """Apply `_subtract` to K states."""
    for k in range(states.shape[0]):
        _subtract(states[k], other, differences[k])


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
    first = estimates[0]
    return replace(
        first,
        position=None if first.position is None else state[PART.position],
        velocity=None if first.velocity is None else state[PART.velocity],
        attitude=None if first.attitude is None else state[PART.attitude],
        covariance=covariance,
    )
