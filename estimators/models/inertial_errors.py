"""Where the parts of an inertial state's error stand, in vectors and in rows and columns of matrices.

The six numbers of an IMU, such as its biases, have the same order: `TRIAD`.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ERROR", "PART", "TRIAD", "InertialErrors", "InertialParts", "Triads"]


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

    @property
    def height(self) -> int:
        """The vertical component of the position; for Python, not in kernels, as those below."""
        return self.position + 2

    @property
    def sinking(self) -> int:
        """The vertical component of the velocity."""
        return self.velocity + 2

    @property
    def heading(self) -> int:
        """The component of the attitude about the vertical."""
        return self.attitude + 2


ERROR = InertialErrors()


class InertialParts(NamedTuple):
    """The components of each part, for Python. Those of `simnav.types.Estimate.covariance` are the same.

    Attributes
    ----------
    position, velocity, attitude, gyroscope_bias : slice
        As of `InertialErrors`.
    motion : slice
        Position and velocity.
    navigation : slice
        Position, velocity and attitude.
    """

    position: slice
    velocity: slice
    attitude: slice
    gyroscope_bias: slice
    motion: slice
    navigation: slice


PART = InertialParts(
    position=slice(ERROR.position, ERROR.velocity),
    velocity=slice(ERROR.velocity, ERROR.attitude),
    attitude=slice(ERROR.attitude, ERROR.gyroscope_bias),
    gyroscope_bias=slice(ERROR.gyroscope_bias, ERROR.accelerometer_bias),
    motion=slice(ERROR.position, ERROR.attitude),
    navigation=slice(ERROR.position, ERROR.gyroscope_bias),
)


class Triads(NamedTuple):
    """The components of six numbers of an IMU; in kernels, too."""

    gyroscopes: slice = slice(0, 3)
    accelerometers: slice = slice(3, 6)


TRIAD = Triads()
