"""Where the parts of an inertial state's error stand, in vectors and in rows and columns of matrices."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ERROR", "InertialErrors"]


class InertialErrors(NamedTuple):
    """The first of the three components of each part.

    Attributes
    ----------
    position, velocity : int
        North, east, down [m], [m/s].
    attitude : int
        Rotation vector in north-east-down [rad].
    gyroscope_bias, accelerometer_bias : int
        In the axes of the body [rad/s], [m/s^2].
    calibration : int
        The first of the calibration states of the instruments; so the number of components before them.
    """

    position: int = 0
    velocity: int = 3
    attitude: int = 6
    gyroscope_bias: int = 9
    accelerometer_bias: int = 12
    calibration: int = 15


ERROR = InertialErrors()
