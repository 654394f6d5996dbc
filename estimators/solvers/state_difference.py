"""The difference of two estimates, and estimates that differ by one: what solvers with several filters compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from simnav.estimators.models.inertial_errors import PART
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rotation_vector_from_dcm, rpy_from_dcm
from simnav.types import Array, Estimate

__all__ = ["difference", "differences", "displaced"]


def differences(estimates: Sequence[Estimate], other: Estimate) -> Array:
    """Estimates minus another one, over `simnav.types.COMPONENTS` [m, m/s, rad].

    Returns
    -------
    (k, 9) array
        The attitude as the rotation vector of ``C C_other'``; zero for vectors that one of the two lacks.
    """
    found = np.zeros((len(estimates), 9))
    at, positions = _those(estimates, "position")
    if at and other.position is not None:
        found[at, PART.position] = relative_position(positions, other.position)
    at, velocities = _those(estimates, "velocity")
    if at and other.velocity is not None:
        found[at, PART.velocity] = velocities - other.velocity
    at, attitudes = _those(estimates, "attitude")
    if at and other.attitude is not None:
        turns = dcm_from_rpy(attitudes) @ dcm_from_rpy(other.attitude).T
        found[at, PART.attitude] = rotation_vector_from_dcm(turns)
    return found


def difference(estimate: Estimate, other: Estimate) -> Array:
    """`differences` of one estimate, (9,)."""
    first: Array = differences([estimate], other)[0]
    return first


def _those(estimates: Sequence[Estimate], name: str) -> tuple[list[int], Array]:
    """The places of the estimates that have a vector, and the vectors."""
    given = [getattr(one, name) for one in estimates]
    at = [k for k, vector in enumerate(given) if vector is not None]
    return at, np.array([given[k] for k in at])


def displaced(estimate: Estimate, error: Array, covariance: Array) -> Estimate:
    """The estimate with a (9,) difference added, and another covariance."""
    position, velocity, attitude = estimate.position, estimate.velocity, estimate.attitude
    return replace(
        estimate,
        position=None if position is None else displace(position, error[PART.position]),
        velocity=None if velocity is None else velocity + error[PART.velocity],
        attitude=None
        if attitude is None
        else rpy_from_dcm(dcm_from_rotation_vector(error[PART.attitude]) @ dcm_from_rpy(attitude)),
        covariance=covariance,
    )
