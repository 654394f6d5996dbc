"""Vectors between body axes and north-east-down, for many attitudes at once."""

from __future__ import annotations

import numpy as np

from simnav.types import Array

__all__ = ["turn_to_body", "turn_to_ned"]


def turn_to_ned(attitude: Array, vector: Array) -> Array:
    """Turn vectors from body axes to north-east-down, C v, for n attitudes.

    The rotation is computed as three rotations about one axis each. This is faster than a matrix for one vector, and
    the result of a row does not depend on the number of rows, as it may with a matrix product.

    Parameters
    ----------
    attitude : (n, 3) array
        Roll, pitch, yaw [rad].
    vector : (n, 3) or (3,) array
        Vectors in body axes (forward, starboard, down): one for all attitudes, or one for each.

    Returns
    -------
    (n, 3) array
        The vectors north-east-down.
    """
    (sr, sp, sy), (cr, cp, cy) = np.sin(attitude).T, np.cos(attitude).T
    x, y, z = vector.T
    y, z = cr * y - sr * z, sr * y + cr * z
    x, z = cp * x + sp * z, cp * z - sp * x
    out = np.empty(attitude.shape)
    out[:, 0], out[:, 1], out[:, 2] = cy * x - sy * y, sy * x + cy * y, z
    return out


def turn_to_body(attitude: Array, vector: Array) -> Array:
    """Turn vectors from north-east-down to body axes, C' v: the inverse of `turn_to_ned`."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(attitude).T, np.cos(attitude).T
    x, y, z = vector.T
    x, y = cy * x + sy * y, cy * y - sy * x
    x, z = cp * x - sp * z, sp * x + cp * z
    out = np.empty(attitude.shape)
    out[:, 0], out[:, 1], out[:, 2] = x, cr * y + sr * z, cr * z - sr * y
    return out
