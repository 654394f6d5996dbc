"""Errors and values of a measurement: adding an error, and telling two values apart.

Positions have values in radians and errors in metres, headings are cyclic; everything else just adds.
"""

from __future__ import annotations

import numpy as np

from simnav import earth
from simnav.rotation import wrap_angle
from simnav.types import Array

__all__ = ["add_error", "error_between"]


def _with_height(horizontal: Array) -> Array:
    # Radii at the sea surface: at 100 m depth the error of the error is 2e-5 of it.
    return np.concatenate([horizontal, np.zeros((len(horizontal), 1))], axis=1)


def add_error(kind: str, value: Array, error: Array) -> Array:
    """Values with an error added.

    Parameters
    ----------
    kind : str
        Key of `simnav.types.KINDS`.
    value, error : (n, d) array
        Components as in ``KINDS[kind].values`` and ``.errors``.

    Returns
    -------
    (n, d) array
        Headings in [-pi, pi).
    """
    match kind:
        case "gnss_position":
            return earth.displace(value, error)
        case "terrain_fix":
            return earth.displace(_with_height(value), _with_height(error))[:, :2]
        case "magnetic_compass" | "gyrocompass":
            return wrap_angle(value + error)
    return value + error


def error_between(kind: str, value: Array, reference: Array) -> Array:
    """The error that turns ``reference`` into ``value``: the inverse of `add_error`.

    Parameters
    ----------
    kind : str
    value, reference : (n, d) array

    Returns
    -------
    (n, d) array
        In the units of ``KINDS[kind].errors``.
    """
    match kind:
        case "gnss_position":
            return earth.relative_position(value, reference)
        case "terrain_fix":
            return earth.relative_position(_with_height(value), _with_height(reference))[:, :2]
        case "magnetic_compass" | "gyrocompass":
            return wrap_angle(value - reference)
    return value - reference
