"""Measurement models of the inertial state: what each kind of instrument should read, and its Jacobian.

Each function takes the model, the datasheet, the value measured and a matrix for the Jacobian (zeros at first; the same
matrix on every call), and returns a `Linearised` or None where the value is no measurement at all. With position p,
velocity v, DCM C, lever arm l, body rate relative to the Earth w (Groves 2013, section 14.3):

- GNSS position: ``p + C l``; attitude ``-[C l x]``
- GNSS velocity: ``v + C (w x l)``; attitude ``-[C (w x l) x]``; gyroscope bias ``C [l x]``
- DVL: ``u = C' v + w x l``, seen as ``(1 + s) u + u x a + b`` (scale s, misalignment a, bias b);
  velocity ``C'``; attitude ``C' [v x]``; gyroscope bias ``[l x]``
- heading: ``atan2(C_10, C_00)``; attitude ``(tan(pitch) cos(yaw), tan(pitch) sin(yaw), 1)``
- depth: ``-h + (C l)_D``
- speed log: forward component of the DVL's, through the water
- terrain fix: horizontal part of ``p + C l``

A bias adds to every one of them, with a Jacobian of 1. The noise is the datasheet's, and the gyroscopes' over the lever arm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import atan2, cos, hypot, isfinite, pi, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np

from estimators.models.base import Linearised
from simnav.earth import ECCENTRICITY_SQUARED, ROTATION_RATE, SEMI_MAJOR_AXIS
from simnav.types import Array, Datasheet

if TYPE_CHECKING:
    from estimators.models.inertial import InertialModel

__all__ = ["MODELS", "plausible", "wrap"]

#: Largest speed [m/s], height and depth [m] that a measurement is believed to mean.
LARGEST_SPEED, LARGEST_HEIGHT = 200.0, 20000.0


def wrap(angle: float) -> float:
    """An angle brought into [-pi, pi]."""
    return atan2(sin(angle), cos(angle))


def plausible(kind: str, value: Array) -> bool:
    """Whether a value can be a measurement of its kind at all: finite, on Earth, and no faster than any vehicle."""
    x = value.tolist()
    if not all(map(isfinite, x)):
        return False
    if kind in ("gnss_position", "terrain_fix"):
        return (
            abs(x[0]) < 0.5 * pi and abs(x[1]) <= 2.0 * pi and (kind == "terrain_fix" or abs(x[2]) < LARGEST_HEIGHT)
        )
    if kind in ("magnetic_compass", "gyrocompass"):
        return abs(x[0]) <= 4.0 * pi
    limit = LARGEST_HEIGHT if kind == "depth" else LARGEST_SPEED
    return all(abs(component) < limit for component in x)


def radii(latitude: float) -> tuple[float, float]:
    """Meridian and prime-vertical radius [m] (Groves eqs. 2.105-2.106), without the overhead of arrays."""
    x = 1.0 - ECCENTRICITY_SQUARED * sin(latitude) ** 2
    prime = SEMI_MAJOR_AXIS / sqrt(x)
    return prime * (1.0 - ECCENTRICITY_SQUARED) / x, prime


def _cross(a: Sequence3, b: Sequence3) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


Sequence3 = tuple[float, float, float] | list[float]


def _minus_skew(jacobian: Array, column: int, u: Sequence3) -> None:
    """Put ``-[u x]`` into three columns of a three-row Jacobian."""
    jacobian[0, column + 1], jacobian[0, column + 2] = u[2], -u[1]
    jacobian[1, column], jacobian[1, column + 2] = -u[2], u[0]
    jacobian[2, column], jacobian[2, column + 1] = u[1], -u[0]


def _bias(model: InertialModel, sheet: Datasheet, jacobian: Array, predicted: list[float]) -> list[float]:
    """Add the instrument's estimated bias, and its Jacobian."""
    at = model.bias_at.get(sheet.name)
    if at is None:
        return predicted
    for k in range(len(predicted)):
        jacobian[k, at + k] = 1.0
        predicted[k] += float(model.calibration[at - 15 + k])
    return predicted


def _earth_rate_body(model: InertialModel) -> tuple[float, float, float]:
    """Body rate relative to the Earth, body axes; the transport rate (under 1e-6 rad/s) is left out."""
    latitude = float(model.position[0])
    e0, e2 = ROTATION_RATE * cos(latitude), -ROTATION_RATE * sin(latitude)
    w, c = model.angular_rate, model.dcm
    return (
        w[0] - float(c[0, 0]) * e0 - float(c[2, 0]) * e2,
        w[1] - float(c[0, 1]) * e0 - float(c[2, 1]) * e2,
        w[2] - float(c[0, 2]) * e0 - float(c[2, 2]) * e2,
    )


def gnss_position(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Position of an antenna, or of a terrain fix: three or two components."""
    lever: list[float] = (model.dcm @ sheet.lever_arm).tolist()
    latitude, longitude, height = model.position.tolist()
    meridian, prime = radii(latitude)
    measured = value.tolist()
    innovation = [
        (measured[0] - latitude) * (meridian + height) - lever[0],
        wrap(measured[1] - longitude) * (prime + height) * cos(latitude) - lever[1],
    ]
    jacobian[0, 0] = jacobian[1, 1] = 1.0
    jacobian[0, 7], jacobian[0, 8] = lever[2], -lever[1]
    jacobian[1, 6], jacobian[1, 8] = -lever[2], lever[0]
    if len(measured) == 3:
        innovation.append(height - measured[2] - lever[2])
        jacobian[2, 2] = 1.0
        jacobian[2, 6], jacobian[2, 7] = lever[1], -lever[0]
    offset = _bias(model, sheet, jacobian, [0.0] * len(innovation))
    residual = np.array([i - o for i, o in zip(innovation, offset)])
    return Linearised(residual, jacobian, np.diag(model.white[sheet.name]))


def gnss_velocity(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Velocity of an antenna, north-east-down."""
    lever = sheet.lever_arm.tolist()
    noise = np.diag(model.white[sheet.name])
    jacobian[0, 3] = jacobian[1, 4] = jacobian[2, 5] = 1.0
    predicted = model.velocity.tolist()
    if any(lever):
        turning = (model.dcm @ _cross(_earth_rate_body(model), lever)).tolist()
        predicted = [p + t for p, t in zip(predicted, turning)]
        _minus_skew(jacobian, 6, turning)
        arm = np.array([[0.0, -lever[2], lever[1]], [lever[2], 0.0, -lever[0]], [-lever[1], lever[0], 0.0]])
        by_rate = model.dcm @ arm
        jacobian[:, 9:12] = by_rate
        noise = noise + model.rate_variance * (by_rate @ by_rate.T)
    predicted = _bias(model, sheet, jacobian, predicted)
    return Linearised(value - predicted, jacobian, noise)


def dvl(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Velocity over the ground of a transducer, body axes."""
    to_body = model.dcm.T
    lever = sheet.lever_arm.tolist()
    v = model.velocity.tolist()
    u = (to_body @ model.velocity).tolist()
    noise = model.white[sheet.name]
    jacobian[:, 3:6] = to_body
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    jacobian[:, 6:9] = to_body @ skew
    if any(lever):
        u = [a + b for a, b in zip(u, _cross(_earth_rate_body(model), lever))]
        _minus_skew(jacobian, 9, [-x for x in lever])
        squares = [x * x for x in lever]
        total = sum(squares)
        noise = noise + [model.rate_variance * (total - s) for s in squares]
    at = model.scale_at.get(sheet.name)
    if at is not None:
        # The effect of s and a on the other Jacobians is of second order.
        jacobian[0, at], jacobian[1, at], jacobian[2, at] = u
        scale, *misalignment = model.calibration[at - 15 : at - 11].tolist()
        # u x a = [u x] a
        _minus_skew(jacobian, at + 1, [-x for x in u])
        u = [(1.0 + scale) * a + b for a, b in zip(u, _cross(u, misalignment))]
    elif sheet.scale or sheet.misalignment.any():
        m = sheet.misalignment
        squares = [x * x for x in u]
        noise = noise + [
            sheet.scale**2 * squares[0] + m[1] ** 2 * squares[2] + m[2] ** 2 * squares[1],
            sheet.scale**2 * squares[1] + m[0] ** 2 * squares[2] + m[2] ** 2 * squares[0],
            sheet.scale**2 * squares[2] + m[0] ** 2 * squares[1] + m[1] ** 2 * squares[0],
        ]
    return Linearised(value - _bias(model, sheet, jacobian, u), jacobian, np.diag(noise))


def heading(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """True heading; None within a few degrees of the vertical, where there is none."""
    c = model.dcm
    c00, c10, c20 = float(c[0, 0]), float(c[1, 0]), float(c[2, 0])
    level = hypot(c00, c10)
    if level < 0.1:
        return None
    slope = -c20 / level / level
    jacobian[0, 6], jacobian[0, 7], jacobian[0, 8] = slope * c00, slope * c10, 1.0
    predicted = _bias(model, sheet, jacobian, [atan2(c10, c00)])
    return Linearised(np.array([wrap(float(value[0]) - predicted[0])]), jacobian, np.diag(model.white[sheet.name]))


def depth(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Depth below the mean sea surface, which is taken as the ellipsoid."""
    lever: list[float] = (model.dcm @ sheet.lever_arm).tolist()
    jacobian[0, 2] = 1.0
    jacobian[0, 6], jacobian[0, 7] = lever[1], -lever[0]
    predicted = _bias(model, sheet, jacobian, [-float(model.position[2]) + lever[2]])
    return Linearised(value - predicted, jacobian, np.diag(model.white[sheet.name]))


def speed_log(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Forward speed through the water; the current is part of the bias state."""
    c, v = model.dcm, model.velocity.tolist()
    forward: list[float] = c[:, 0].tolist()
    lever = sheet.lever_arm.tolist()
    u = forward[0] * v[0] + forward[1] * v[1] + forward[2] * v[2] + _cross(_earth_rate_body(model), lever)[0]
    jacobian[0, 3], jacobian[0, 4], jacobian[0, 5] = forward
    jacobian[0, 6], jacobian[0, 7], jacobian[0, 8] = _cross(forward, v)
    jacobian[0, 10], jacobian[0, 11] = -lever[2], lever[1]
    variance = model.white[sheet.name] + model.rate_variance * (lever[1] ** 2 + lever[2] ** 2)
    at = model.scale_at.get(sheet.name)
    if at is not None:
        jacobian[0, at] = u
        u *= 1.0 + float(model.calibration[at - 15])
    else:
        variance = variance + (sheet.scale * u) ** 2
    return Linearised(value - _bias(model, sheet, jacobian, [u]), jacobian, np.diag(variance))


#: The measurement model of every kind of instrument.
MODELS: Mapping[str, Callable[[InertialModel, Datasheet, Array, Array], Linearised | None]] = {
    "gnss_position": gnss_position,
    "gnss_velocity": gnss_velocity,
    "dvl": dvl,
    "magnetic_compass": heading,
    "gyrocompass": heading,
    "depth": depth,
    "speed_log": speed_log,
    "terrain_fix": gnss_position,
}
