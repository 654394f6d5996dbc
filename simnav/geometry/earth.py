"""The WGS-84 Earth: radii of curvature, normal gravity, Earth and transport rate.

Sources: NIMA TR8350.2 (WGS-84); P. D. Groves, *Principles of GNSS, Inertial, and Multisensor Integrated Navigation
Systems*, 2nd ed., Artech House 2013, chapter 2.

The kernels take and return scalars and are used by other kernels; the plain functions beside them work on arrays.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt

import numpy as np

from simnav.compiled import Array, helper

__all__ = [
    "ECCENTRICITY_SQUARED",
    "EQUATORIAL_GRAVITY",
    "FLATTENING",
    "GRAVITATIONAL_CONSTANT",
    "ROTATION_RATE",
    "SEMI_MAJOR_AXIS",
    "SEMI_MINOR_AXIS",
    "SOMIGLIANA",
    "displace",
    "displace_scalar",
    "earth_rate",
    "gravity",
    "gravity_scalar",
    "horizontal_offset",
    "move_position",
    "principal_radii",
    "radii_scalar",
    "relative_position",
]

#: Equatorial radius [m].
SEMI_MAJOR_AXIS = 6378137.0
#: Flattening of the ellipsoid [-].
FLATTENING = 1.0 / 298.257223563
#: Polar radius [m].
SEMI_MINOR_AXIS = SEMI_MAJOR_AXIS * (1.0 - FLATTENING)
#: Square of the first eccentricity [-].
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
#: Rotation rate of the Earth [rad/s].
ROTATION_RATE = 7.292115e-5
#: Geocentric gravitational constant [m^3/s^2].
GRAVITATIONAL_CONSTANT = 3.986004418e14
#: Normal gravity at the equator [m/s^2].
EQUATORIAL_GRAVITY = 9.7803253359
#: Somigliana's constant [-].
SOMIGLIANA = 0.00193185265241
_M = ROTATION_RATE**2 * SEMI_MAJOR_AXIS**2 * SEMI_MINOR_AXIS / GRAVITATIONAL_CONSTANT
_GRADIENT = 2.0 / SEMI_MAJOR_AXIS * (1.0 + FLATTENING + _M)
_GRADIENT_SIN2 = 4.0 * FLATTENING / SEMI_MAJOR_AXIS
_CURVATURE = 3.0 / SEMI_MAJOR_AXIS**2


@helper
def radii_scalar(sin_latitude: float) -> tuple[float, float]:
    """Meridian and prime-vertical radius [m] at a sine of latitude (Groves eqs. 2.105-2.106)."""
    x = 1.0 - ECCENTRICITY_SQUARED * sin_latitude * sin_latitude
    prime_vertical = SEMI_MAJOR_AXIS / sqrt(x)
    # R_M = R_N (1 - e^2) / x, without the second division
    scaled = prime_vertical * (1.0 / SEMI_MAJOR_AXIS)
    return prime_vertical * (1.0 - ECCENTRICITY_SQUARED) * scaled * scaled, prime_vertical


@helper
def gravity_scalar(sin_latitude: float, height: float) -> float:
    """Normal gravity [m/s^2], positive down: Somigliana with height terms (Groves eqs. 2.134, 2.139)."""
    s2 = sin_latitude * sin_latitude
    surface = EQUATORIAL_GRAVITY * (1.0 + SOMIGLIANA * s2) / sqrt(1.0 - ECCENTRICITY_SQUARED * s2)
    return surface * (1.0 - (_GRADIENT - _GRADIENT_SIN2 * s2) * height + _CURVATURE * height * height)


@helper
def displace_scalar(
    latitude: float, longitude: float, height: float, north: float, east: float, down: float
) -> tuple[float, float, float]:
    """`displace` for one position: latitude, longitude [rad] and height [m] after an offset [m]."""
    s = sin(latitude)
    x = 1.0 - ECCENTRICITY_SQUARED * (s * s)
    prime_vertical = SEMI_MAJOR_AXIS / sqrt(x)
    meridian = prime_vertical * (1.0 - ECCENTRICITY_SQUARED) / x
    parallel = (prime_vertical + height) * cos(latitude)
    return latitude + north / (meridian + height), longitude + east / parallel, height - down


@helper
def move_position(position: Array, north: float, east: float, down: float) -> None:
    """Move a (3,) position by metres, in place, as a filter corrects it: with the radii where it was."""
    meridian, prime_vertical = radii_scalar(sin(position[0]))
    position[1] += east / ((prime_vertical + position[2]) * cos(position[0]))
    position[0] += north / (meridian + position[2])
    position[2] -= down


@helper
def horizontal_offset(position: Array, latitude: float, longitude: float) -> tuple[float, float]:
    """Metres north and east that lead from a (3,) position to a latitude and longitude, with the radii where it is."""
    meridian, prime_vertical = radii_scalar(sin(position[0]))
    east = longitude - position[1]
    parallel = atan2(sin(east), cos(east)) * (prime_vertical + position[2]) * cos(position[0])
    return (latitude - position[0]) * (meridian + position[2]), parallel


def principal_radii(latitude: Array | float) -> tuple[Array, Array]:
    """Radii of curvature of the ellipsoid.

    Parameters
    ----------
    latitude : array_like
        Geodetic latitude [rad].

    Returns
    -------
    meridian, prime_vertical : array
        R_M and R_N [m], the shape of ``latitude`` (Groves eqs. 2.105-2.106).
    """
    x = 1.0 - ECCENTRICITY_SQUARED * np.sin(latitude) ** 2
    prime_vertical = SEMI_MAJOR_AXIS / np.sqrt(x)
    return prime_vertical * (1.0 - ECCENTRICITY_SQUARED) / x, prime_vertical


def gravity(latitude: Array | float, height: Array | float = 0.0) -> Array:
    """Normal gravity, positive down.

    Parameters
    ----------
    latitude, height : array_like
        Geodetic latitude [rad] and height above the ellipsoid [m].

    Returns
    -------
    array
        Gravity [m/s^2] (Groves eqs. 2.134, 2.139; the small north component at height is neglected).
    """
    s2 = np.sin(latitude) ** 2
    surface = EQUATORIAL_GRAVITY * (1.0 + SOMIGLIANA * s2) / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s2)
    h = np.asarray(height)
    return np.asarray(surface * (1.0 - (_GRADIENT - _GRADIENT_SIN2 * s2) * h + _CURVATURE * h**2))


def earth_rate(latitude: Array | float) -> Array:
    """Rotation of the Earth in north-east-down axes.

    Parameters
    ----------
    latitude : array_like
        Geodetic latitude [rad], shape (...).

    Returns
    -------
    (..., 3) array
        Earth rate, north, east, down [rad/s] (Groves eq. 2.123).
    """
    latitude = np.asarray(latitude)
    rate = np.zeros((*latitude.shape, 3))
    rate[..., 0], rate[..., 2] = ROTATION_RATE * np.cos(latitude), -ROTATION_RATE * np.sin(latitude)
    return rate


def displace(position: Array, offset: Array) -> Array:
    """Move geodetic positions by small north-east-down offsets.

    Parameters
    ----------
    position : (..., 3) array
        Latitude, longitude [rad], height [m].
    offset : (..., 3) array
        North, east, down [m]; small compared with the Earth's radius.

    Returns
    -------
    (..., 3) array
        The moved positions: latitude, longitude [rad], height [m].
    """
    position, offset = np.asarray(position), np.asarray(offset)
    meridian, prime_vertical = principal_radii(position[..., 0])
    latitude = position[..., 0] + offset[..., 0] / (meridian + position[..., 2])
    parallel = (prime_vertical + position[..., 2]) * np.cos(position[..., 0])
    longitude = position[..., 1] + offset[..., 1] / parallel
    return np.stack(np.broadcast_arrays(latitude, longitude, position[..., 2] - offset[..., 2]), axis=-1)


def relative_position(position: Array, origin: Array) -> Array:
    """North-east-down offset of geodetic positions from nearby origins: the inverse of `displace`.

    Parameters
    ----------
    position, origin : (..., 3) array
        Latitude, longitude [rad], height [m].

    Returns
    -------
    (..., 3) array
        North, east, down [m], with the radii at the origin; longitudes are compared modulo 2 pi.
    """
    position, origin = np.asarray(position), np.asarray(origin)
    meridian, prime_vertical = principal_radii(origin[..., 0])
    east = np.remainder(position[..., 1] - origin[..., 1] + np.pi, 2.0 * np.pi) - np.pi
    offset = np.empty(np.broadcast(position, origin).shape)
    offset[..., 0] = (position[..., 0] - origin[..., 0]) * (meridian + origin[..., 2])
    offset[..., 1] = east * (prime_vertical + origin[..., 2]) * np.cos(origin[..., 0])
    offset[..., 2] = origin[..., 2] - position[..., 2]
    return offset
