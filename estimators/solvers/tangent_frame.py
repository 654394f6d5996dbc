"""A Cartesian frame fixed to the Earth: the local tangent plane, north-east-down, at a point.

For solvers that know vectors only. Geodetic positions are converted through Earth-centred, Earth-fixed coordinates, so
that nothing is approximated; gravity and the rotation of the Earth are vectors in the frame.

With C the DCM body to north-east-down at the state's own place and R the rotation body to frame, ``C = N R`` where N
turns the frame's axes to those of the place. A rotation ``R exp(w x)``, a displacement ``R r`` and a velocity change d
(in the frame) change what `InertialModel` calls the error by

- position: ``C r``
- velocity: ``N d + v x (W C r)``
- attitude: ``C w - W C r``

where W maps a displacement to the turn of the north-east-down axes (the transport rate's matrix, Groves eq. 5.44).

Sources: P. D. Groves 2013, sections 2.4.3 and 5.4; B. R. Bowring, "Transformation from spatial to geographical
coordinates", Survey Review 23(181), 1976 (its iteration gains about ten digits a step near the Earth's surface).
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.models.inertial_errors import ERROR
from simnav.geometry.earth import (
    ECCENTRICITY_SQUARED,
    FLATTENING,
    ROTATION_RATE,
    SEMI_MAJOR_AXIS,
    SEMI_MINOR_AXIS,
    gravity_scalar,
    radii_scalar,
)
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

__all__ = [
    "TANGENT", "TANGENT_PART", "GeodeticState", "LocalState", "TangentErrors", "TangentFrame", "TangentParts",
    "tangent_state",
]  # fmt: skip

_SECOND_ECCENTRICITY_SQUARED = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)


class TangentErrors(NamedTuple):
    """Where the changes of a state in the frame stand: the first of the three components of each part.

    Attributes
    ----------
    rotation, place : int
        Rotation vector [rad] and displacement [m] in body axes.
    speed : int
        In the frame [m/s].
    accelerometer_bias, gyroscope_bias : int
        In body axes [m/s^2], [rad/s]. GTSAM's order is this one; that of `ERROR` is the other.
    """

    rotation: int = 0
    place: int = 3
    speed: int = 6
    accelerometer_bias: int = 9
    gyroscope_bias: int = 12


TANGENT = TangentErrors()


class TangentParts(NamedTuple):
    """The components of each part, and of GTSAM's variables: the pose, the velocity and both biases."""

    rotation: slice
    place: slice
    pose: slice
    speed: slice
    bias: slice
    state: slice


TANGENT_PART = TangentParts(
    rotation=slice(TANGENT.rotation, TANGENT.place),
    place=slice(TANGENT.place, TANGENT.speed),
    pose=slice(TANGENT.rotation, TANGENT.speed),
    speed=slice(TANGENT.speed, TANGENT.accelerometer_bias),
    bias=slice(TANGENT.accelerometer_bias, TANGENT.gyroscope_bias + 3),
    state=slice(TANGENT.rotation, TANGENT.accelerometer_bias),
)


class LocalState(NamedTuple):
    """A state in the frame.

    Attributes
    ----------
    rotation : (3, 3) array
        From body to frame.
    place, speed : (3,) array
        Position [m], and velocity relative to the Earth [m/s].
    """

    rotation: Matrix
    place: Vector
    speed: Vector


class GeodeticState(NamedTuple):
    """A state as `InertialModel` has it, and how its error follows from changes in the frame.

    Attributes
    ----------
    position, velocity : (3,) array
        Latitude, longitude [rad], height [m]; north, east, down [m/s].
    dcm : (3, 3) array
        Rotation from body to north-east-down.
    error_map : (9, 9) array
        Error of position, velocity and attitude (`ERROR`) by the changes in the frame (`TANGENT`); equations in the
        module.
    """

    position: Vector
    velocity: Vector
    dcm: Matrix
    error_map: Matrix


def _blank() -> GeodeticState:
    return GeodeticState(np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((9, 9)))


@kernel
def tangent_state(origin: Vector, axes: Matrix, local: LocalState, state: GeodeticState, attraction: Vector) -> None:
    """Geodetic state of a state in the frame, and how its error changes.

    Parameters
    ----------
    origin : (3,) array
        Origin of the frame, Earth-centred [m].
    axes : (3, 3) array
        Rotation from Earth-centred axes to those of the frame.
    local : LocalState
        The state in the frame.
    state : GeodeticState
        Filled.
    attraction : (3,) array
        Filled: gravity in the frame [m/s^2].
    """
    rotation, place, speed = local
    position, velocity, dcm, error_map = state
    x = origin[0] + axes[0, 0] * place[0] + axes[1, 0] * place[1] + axes[2, 0] * place[2]
    y = origin[1] + axes[0, 1] * place[0] + axes[1, 1] * place[1] + axes[2, 1] * place[2]
    z = origin[2] + axes[0, 2] * place[0] + axes[1, 2] * place[1] + axes[2, 2] * place[2]
    level = sqrt(x * x + y * y)
    # Reduced latitude, by Bowring's iteration
    s, c = z * SEMI_MAJOR_AXIS, level * SEMI_MINOR_AXIS
    for _ in range(3):
        r = 1.0 / sqrt(s * s + c * c)
        s, c = s * r, c * r
        up = z + _SECOND_ECCENTRICITY_SQUARED * SEMI_MINOR_AXIS * s * s * s
        out = level - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * c * c * c
        s, c = (1.0 - FLATTENING) * up, out
    r = 1.0 / sqrt(up * up + out * out)
    s, c = up * r, out * r  # of the latitude
    position[0], position[1] = atan2(up, out), atan2(y, x)
    height = level * c + z * s - SEMI_MAJOR_AXIS * sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    position[2] = height
    sl, cl = sin(position[1]), cos(position[1])
    # North, east, down in the frame: rows of N
    N = np.empty((3, 3))
    for j in range(3):
        a0, a1, a2 = axes[j, 0], axes[j, 1], axes[j, 2]
        N[0, j] = -s * cl * a0 - s * sl * a1 + c * a2
        N[1, j] = -sl * a0 + cl * a1
        N[2, j] = -c * cl * a0 - c * sl * a1 - s * a2
    g = gravity_scalar(s, height)
    for i in range(3):
        attraction[i] = g * N[2, i]
        velocity[i] = N[i, 0] * speed[0] + N[i, 1] * speed[1] + N[i, 2] * speed[2]
        for j in range(3):
            dcm[i, j] = N[i, 0] * rotation[0, j] + N[i, 1] * rotation[1, j] + N[i, 2] * rotation[2, j]
    meridian, prime = radii_scalar(s)
    a, b = 1.0 / (meridian + height), 1.0 / (prime + height)
    t = s / c
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    error_map[:] = 0.0
    about, moved, faster = TANGENT.rotation, TANGENT.place, TANGENT.speed
    for j in range(3):
        c0, c1 = dcm[0, j], dcm[1, j]
        w0, w1, w2 = b * c1, -a * c0, -b * t * c1  # W C
        for i in range(3):
            error_map[ERROR.position + i, moved + j] = dcm[i, j]
            error_map[ERROR.attitude + i, about + j] = dcm[i, j]
            error_map[ERROR.velocity + i, faster + j] = N[i, j]
        error_map[ERROR.velocity, moved + j] = v1 * w2 - v2 * w1
        error_map[ERROR.velocity + 1, moved + j] = v2 * w0 - v0 * w2
        error_map[ERROR.velocity + 2, moved + j] = v0 * w1 - v1 * w0
        error_map[ERROR.attitude, moved + j] = -w0
        error_map[ERROR.attitude + 1, moved + j] = -w1
        error_map[ERROR.attitude + 2, moved + j] = -w2


class TangentFrame:
    """The tangent plane at a geodetic position.

    Parameters
    ----------
    position : (3,) array
        Latitude, longitude [rad], height [m].

    Attributes
    ----------
    origin : (3,) array
        Origin of the frame, Earth-centred [m].
    axes : (3, 3) array
        Rotation from Earth-centred axes to those of the frame.
    rotation : (3,) array
        Rotation rate of the Earth, in the frame [rad/s].

    Examples
    --------
    >>> frame = TangentFrame(np.array([0.8, 0.1, 20.0]))
    >>> bool(np.allclose(frame.local(np.array([0.8, 0.1, 10.0])), [0.0, 0.0, 10.0], atol=1e-8))
    True
    """

    def __init__(self, position: Array):
        self.axes = north_east_down(position)
        self.origin = earth_centred(position)
        self.rotation = ROTATION_RATE * self.axes[:, 2]

    def local(self, position: Array) -> Array:
        """(3,) position in the frame of a geodetic one."""
        there: Array = self.axes @ (earth_centred(position) - self.origin)
        return there

    def turn(self, position: Array) -> Array:
        """(3, 3) rotation from north-east-down at a geodetic position to the frame."""
        turned: Array = self.axes @ north_east_down(position).T
        return turned

    def state(self, rotation: Array, place: Array, speed: Array) -> GeodeticState:
        """Convert a state in the frame to a geodetic state.

        Parameters
        ----------
        rotation : (3, 3) array
            Rotation from body axes to the frame.
        place, speed : (3,) arrays
            Position and velocity in the local frame [m], [m/s].

        Returns
        -------
        GeodeticState
        """
        # GTSAM's arrays are in Fortran's order, or to be read only.
        local = LocalState(*(np.array(a, dtype=np.float64, order="C") for a in (rotation, place, speed)))
        state = _blank()
        tangent_state(self.origin, self.axes, local, state, np.empty(3))
        return state

    def gravity(self, place: Array) -> Array:
        """(3,) gravity at a place in the frame, less the centrifugal acceleration about the origin [m/s^2]."""
        attraction, local = np.empty(3), LocalState(np.eye(3), np.array(place), np.zeros(3))
        tangent_state(self.origin, self.axes, local, _blank(), attraction)
        w = self.rotation
        return attraction + w * (w @ place) - (w @ w) * place


def earth_centred(position: Array) -> Array:
    """Earth-centred, Earth-fixed coordinates [m] of a geodetic position (Groves eq. 2.112)."""
    latitude, longitude, height = np.asarray(position).tolist()
    s, c = sin(latitude), cos(latitude)
    prime = SEMI_MAJOR_AXIS / sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    level = (prime + height) * c
    return np.array(
        [level * cos(longitude), level * sin(longitude), ((1.0 - ECCENTRICITY_SQUARED) * prime + height) * s]
    )


def north_east_down(position: Array) -> Array:
    """(3, 3) rotation from Earth-centred axes to north-east-down at a geodetic position (Groves eq. 2.150)."""
    latitude, longitude = float(position[0]), float(position[1])
    s, c, sl, cl = sin(latitude), cos(latitude), sin(longitude), cos(longitude)
    return np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])
