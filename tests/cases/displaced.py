"""An estimate that differs from another one, by the functions on arrays of rotations."""

from __future__ import annotations

from dataclasses import replace

from simnav.geometry.earth import displace
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rpy_from_dcm
from simnav.types import Array, Estimate

__all__ = ["displaced"]


def displaced(estimate: Estimate, error: Array, covariance: Array) -> Estimate:
    """The estimate with a (9,) difference added [m, m/s, rad], and another covariance."""
    assert estimate.position is not None
    assert estimate.velocity is not None
    assert estimate.attitude is not None
    return replace(
        estimate,
        position=displace(estimate.position, error[:3]),
        velocity=estimate.velocity + error[3:6],
        attitude=rpy_from_dcm(dcm_from_rotation_vector(error[6:]) @ dcm_from_rpy(estimate.attitude)),
        covariance=covariance,
    )
