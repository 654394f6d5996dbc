"""Earth-centred, Earth-fixed Cartesian coordinates (ECEF) of WGS-84, and geodetic positions.

Source: P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed., Artech
House 2013, section 2.4. The inverse is the iteration of B. R. Bowring, *Transformation from spatial to geographical
coordinates*, Survey Review 1976; two steps are exact to rounding between the centre of the Earth's crust and the orbits
of satellites.

x points to the equator at longitude 0, z along the axis of rotation to the north, y completes the right-handed triad.
"""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

from simnav.compiled import Array, helper
from simnav.geometry.earth import ECCENTRICITY_SQUARED, FLATTENING, SEMI_MAJOR_AXIS, SEMI_MINOR_AXIS

__all__ = ["ecef_from_geodetic", "ecef_from_geodetic_scalar", "geodetic_from_ecef", "ned_from_ecef"]

_SECOND_ECCENTRICITY_SQUARED = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)


@helper
def ecef_from_geodetic_scalar(latitude: float, longitude: float, height: float) -> tuple[float, float, float]:
    """`ecef_from_geodetic` for one position."""
    s, c = sin(latitude), cos(latitude)
    prime = SEMI_MAJOR_AXIS / sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    level = (prime + height) * c
    return level * cos(longitude), level * sin(longitude), (prime * (1.0 - ECCENTRICITY_SQUARED) + height) * s


def ecef_from_geodetic(position: Array) -> Array:
    """Cartesian coordinates of geodetic positions (Groves eq. 2.112).

    Parameters
    ----------
    position : (..., 3) array
        Latitude, longitude [rad], height [m].

    Returns
    -------
    (..., 3) array
        x, y, z [m].
    """
    latitude, longitude, height = np.moveaxis(np.asarray(position, dtype=np.float64), -1, 0)
    s, c = np.sin(latitude), np.cos(latitude)
    prime = SEMI_MAJOR_AXIS / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s**2)
    level = (prime + height) * c
    z = (prime * (1.0 - ECCENTRICITY_SQUARED) + height) * s
    return np.stack([level * np.cos(longitude), level * np.sin(longitude), z], axis=-1)


def geodetic_from_ecef(coordinates: Array) -> Array:
    """Geodetic positions of Cartesian coordinates: the inverse of `ecef_from_geodetic`.

    Parameters
    ----------
    coordinates : (..., 3) array
        x, y, z [m].

    Returns
    -------
    (..., 3) array
        Latitude, longitude [rad], height [m].
    """
    x, y, z = np.moveaxis(np.asarray(coordinates, dtype=np.float64), -1, 0)
    level = np.hypot(x, y)
    sin_reduced, cos_reduced = z, (1.0 - FLATTENING) * level
    for _ in range(2):
        size = np.hypot(sin_reduced, cos_reduced)
        s, c = sin_reduced / size, cos_reduced / size
        up = z + _SECOND_ECCENTRICITY_SQUARED * SEMI_MINOR_AXIS * s**3
        out = level - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * c**3
        sin_reduced, cos_reduced = (1.0 - FLATTENING) * up, out
    latitude = np.arctan2(up, out)
    s, c = np.sin(latitude), np.cos(latitude)
    # Without a division by a small cosine near the poles (Groves eq. 2.113 has one).
    height = level * c + z * s - SEMI_MAJOR_AXIS * np.sqrt(1.0 - ECCENTRICITY_SQUARED * s**2)
    return np.stack([latitude, np.arctan2(y, x), height], axis=-1)


def ned_from_ecef(latitude: Array | float, longitude: Array | float) -> Array:
    """Rotation from ECEF axes to north-east-down (Groves eq. 2.150).

    Parameters
    ----------
    latitude, longitude : array_like
        Geodetic latitude and longitude [rad], shape (...).

    Returns
    -------
    (..., 3, 3) array
        Matrices whose rows are the directions north, east and down.
    """
    sa, ca, so, co = np.broadcast_arrays(np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude))
    rows = [[-sa * co, -sa * so, ca], [-so, co, np.zeros_like(sa)], [-ca * co, -ca * so, -sa]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
