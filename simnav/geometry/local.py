"""North-east-down coordinates around an origin, exactly: through Earth-centred ones, not on a flat Earth."""

from __future__ import annotations

import numpy as np

from simnav.compiled import Array
from simnav.geometry.ecef import ecef_from_geodetic, geodetic_from_ecef, ned_from_ecef

__all__ = ["geodetic_of_local", "local_of_geodetic", "turn_to_origin"]


def local_of_geodetic(position: Array, origin: Array) -> Array:
    """Coordinates in the axes north, east, down of an origin.

    Parameters
    ----------
    position : (n, 3) array
        Latitude, longitude [rad], height [m].
    origin : (3,) array
        Likewise.

    Returns
    -------
    (n, 3) array
        North, east, down [m].
    """
    axes = ned_from_ecef(origin[0], origin[1])
    return np.asarray((ecef_from_geodetic(position) - ecef_from_geodetic(origin)) @ axes.T)


def geodetic_of_local(local: Array, origin: Array) -> Array:
    """Latitude, longitude [rad] and height [m] of coordinates north, east, down: inverse of `local_of_geodetic`."""
    axes = ned_from_ecef(origin[0], origin[1])
    return np.asarray(geodetic_from_ecef(ecef_from_geodetic(origin) + local @ axes))


def turn_to_origin(position: Array, origin: Array) -> Array:
    """(n, 3, 3) rotations from the axes north, east, down of n positions to those of an origin."""
    here = ned_from_ecef(position[:, 0], position[:, 1])
    return np.asarray(ned_from_ecef(origin[0], origin[1]) @ np.swapaxes(here, -1, -2))
