"""The difference of two estimates, and estimates that differ by one: what solvers with several filters compare."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rotation_vector_from_dcm, rpy_from_dcm
from simnav.types import Array, Estimate

__all__ = ["difference", "displaced"]


def difference(estimate: Estimate, other: Estimate) -> Array:
    """One estimate minus another, over `simnav.types.COMPONENTS` [m, m/s, rad].

    Returns
    -------
    (9,) array
        The attitude as the rotation vector of ``C C_other'``; zero for vectors that one of them lacks.
    """
    found = np.zeros(9)
    if estimate.position is not None and other.position is not None:
        found[:3] = relative_position(estimate.position, other.position)
    if estimate.velocity is not None and other.velocity is not None:
        found[3:6] = estimate.velocity - other.velocity
    if estimate.attitude is not None and other.attitude is not None:
        turn = dcm_from_rpy(estimate.attitude) @ dcm_from_rpy(other.attitude).T
        found[6:] = rotation_vector_from_dcm(turn)
    return found


def displaced(estimate: Estimate, error: Array, covariance: Array) -> Estimate:
    """The estimate with a (9,) difference added, and another covariance."""
    position, velocity, attitude = estimate.position, estimate.velocity, estimate.attitude
    return replace(
        estimate,
        position=None if position is None else displace(position, error[:3]),
        velocity=None if velocity is None else velocity + error[3:6],
        attitude=None
        if attitude is None
        else rpy_from_dcm(dcm_from_rotation_vector(error[6:]) @ dcm_from_rpy(attitude)),
        covariance=covariance,
    )
