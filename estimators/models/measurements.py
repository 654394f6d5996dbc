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

A bias adds to every one of them, with a Jacobian of 1. The noise is the datasheet's, and the gyroscopes' over the lever
arm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import atan2, cos, hypot, isfinite, pi, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np

from estimators.models.base import Linearised
from simnav.compiled import kernel
from simnav.earth import ECCENTRICITY_SQUARED, ROTATION_RATE, SEMI_MAJOR_AXIS
from simnav.rotation import cross
from simnav.types import Array, Datasheet

if TYPE_CHECKING:
    from estimators.models.inertial import InertialModel

__all__ = ["MODELS", "plausible", "velocity_of_arm", "white_noise", "wrap"]

#: Largest speed [m/s], height and depth [m] that a measurement is believed to mean.
LARGEST_SPEED, LARGEST_HEIGHT = 200.0, 20000.0


def wrap(angle: float) -> float:
    """An angle brought into [-pi, pi]."""
    return atan2(sin(angle), cos(angle))


def plausible(kind: str, value: Array) -> bool:
    """Whether a value can be a measurement of its kind at all: finite, on Earth, and no faster than any vehicle."""
    x: list[float] = value.tolist()
    if not all(map(isfinite, x)):
        return False
    if kind in ("gnss_position", "terrain_fix"):
        return abs(x[0]) < 0.5 * pi and abs(x[1]) <= 2.0 * pi and (kind == "terrain_fix" or abs(x[2]) < LARGEST_HEIGHT)
    if kind in ("magnetic_compass", "gyrocompass"):
        return abs(x[0]) <= 4.0 * pi
    limit = LARGEST_HEIGHT if kind == "depth" else LARGEST_SPEED
    return all(abs(component) < limit for component in x)


def radii(latitude: float) -> tuple[float, float]:
    """Meridian and prime-vertical radius [m] (Groves eqs. 2.105-2.106), without the overhead of arrays."""
    x = 1.0 - ECCENTRICITY_SQUARED * sin(latitude) ** 2
    prime = SEMI_MAJOR_AXIS / sqrt(x)
    return prime * (1.0 - ECCENTRICITY_SQUARED) / x, prime


def _bias(model: InertialModel, sheet: Datasheet, jacobian: Array, predicted: list[float]) -> list[float]:
    """Add the instrument's estimated bias, and its Jacobian."""
    at = model.bias_at.get(sheet.name)
    if at is None:
        return predicted
    for k in range(len(predicted)):
        jacobian[k, at + k] = 1.0
        predicted[k] += float(model.calibration[at - 15 + k])
    return predicted


@kernel("void(b1, f8, f8[:, ::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[::1])")
def velocity_of_arm(  # type: ignore[no-untyped-def]
    body, latitude, dcm, velocity, rate, bias, arm, jacobian, predicted
):
    """Velocity at the end of a lever arm, in body axes or north-east-down, and its Jacobian (equations in the module).

    Parameters
    ----------
    body : bool
        True for ``C' v + w x l``, false for ``v + C (w x l)``.
    latitude : float
    dcm : (3, 3) array
    velocity, rate, bias, arm : (k,) arrays, k >= 3
        Body rate relative to the inertial frame as measured, and its bias.
    jacobian : (3, n) array
        Columns 3 to 11 are filled.
    predicted : (3,) array
        Filled.
    """
    # Relative to the Earth; the transport rate, under 1e-6 rad/s, is left out.
    e0, e2 = ROTATION_RATE * cos(latitude), -ROTATION_RATE * sin(latitude)
    w0 = rate[0] - bias[0] - dcm[0, 0] * e0 - dcm[2, 0] * e2
    w1 = rate[1] - bias[1] - dcm[0, 1] * e0 - dcm[2, 1] * e2
    w2 = rate[2] - bias[2] - dcm[0, 2] * e0 - dcm[2, 2] * e2
    l0, l1, l2 = arm[0], arm[1], arm[2]
    u0, u1, u2 = cross(w0, w1, w2, l0, l1, l2)
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    if body:
        for i in range(3):
            c0, c1, c2 = dcm[0, i], dcm[1, i], dcm[2, i]
            predicted[i] = c0 * v0 + c1 * v1 + c2 * v2
            jacobian[i, 3], jacobian[i, 4], jacobian[i, 5] = c0, c1, c2
            jacobian[i, 6], jacobian[i, 7], jacobian[i, 8] = cross(c0, c1, c2, v0, v1, v2)
        predicted[0], predicted[1], predicted[2] = predicted[0] + u0, predicted[1] + u1, predicted[2] + u2
        jacobian[0, 10], jacobian[0, 11] = -l2, l1
        jacobian[1, 9], jacobian[1, 11] = l2, -l0
        jacobian[2, 9], jacobian[2, 10] = -l1, l0
    else:
        t0 = dcm[0, 0] * u0 + dcm[0, 1] * u1 + dcm[0, 2] * u2
        t1 = dcm[1, 0] * u0 + dcm[1, 1] * u1 + dcm[1, 2] * u2
        t2 = dcm[2, 0] * u0 + dcm[2, 1] * u1 + dcm[2, 2] * u2
        predicted[0], predicted[1], predicted[2] = v0 + t0, v1 + t1, v2 + t2
        jacobian[0, 3], jacobian[1, 4], jacobian[2, 5] = 1.0, 1.0, 1.0
        jacobian[0, 7], jacobian[0, 8] = t2, -t1
        jacobian[1, 6], jacobian[1, 8] = -t2, t0
        jacobian[2, 6], jacobian[2, 7] = t1, -t0
        for i in range(3):
            # Row i of C times [l x]
            jacobian[i, 9], jacobian[i, 10], jacobian[i, 11] = cross(dcm[i, 0], dcm[i, 1], dcm[i, 2], l0, l1, l2)


def white_noise(sheet: Datasheet, faster: Array | float, rate_variance: float) -> Array:
    """(d, d) noise: the instrument's own, what is ``faster`` than a state can follow, and the rate's over the arm."""
    noise = np.diag(sheet.sigma**2 + faster)
    arm = sheet.lever_arm
    if sheet.kind == "gnss_velocity":
        noise += rate_variance * (arm @ arm) * np.eye(3)
    elif sheet.kind == "dvl":
        noise += rate_variance * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    elif sheet.kind == "speed_log":
        noise += rate_variance * (arm[1:] @ arm[1:])
    return noise


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
    return Linearised(residual, jacobian, model.noise[sheet.name])


def gnss_velocity(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Velocity of an antenna, north-east-down."""
    predicted = _velocity(model, False, sheet, jacobian)
    return Linearised(value - _bias(model, sheet, jacobian, predicted), jacobian, model.noise[sheet.name])


def _velocity(model: InertialModel, body: bool, sheet: Datasheet, jacobian: Array) -> list[float]:
    predicted = np.empty(3)
    velocity_of_arm(
        body, model.position[0], model.dcm, model.velocity, model.raw_rate, model.bias, sheet.lever_arm,
        jacobian, predicted,
    )  # fmt: skip
    listed: list[float] = predicted.tolist()
    return listed


def dvl(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Velocity over the ground of a transducer, body axes."""
    u = _velocity(model, True, sheet, jacobian)
    noise = model.noise[sheet.name]
    at = model.scale_at.get(sheet.name)
    if at is not None:
        # The effect of s and a on the other Jacobians is of second order.
        u0, u1, u2 = u
        jacobian[0, at], jacobian[0, at + 2], jacobian[0, at + 3] = u0, -u2, u1
        jacobian[1, at], jacobian[1, at + 1], jacobian[1, at + 3] = u1, u2, -u0
        jacobian[2, at], jacobian[2, at + 1], jacobian[2, at + 2] = u2, -u1, u0
        s, a0, a1, a2 = model.calibration[at - 15 : at - 11].tolist()
        s += 1.0
        u = [s * u0 + u1 * a2 - u2 * a1, s * u1 + u2 * a0 - u0 * a2, s * u2 + u0 * a1 - u1 * a0]
    elif sheet.scale or sheet.misalignment.any():
        noise = noise + np.diag((sheet.scale * np.array(u)) ** 2)
        m = sheet.misalignment**2
        q = np.square(u)
        noise += np.diag([m[1] * q[2] + m[2] * q[1], m[0] * q[2] + m[2] * q[0], m[0] * q[1] + m[1] * q[0]])
    return Linearised(value - _bias(model, sheet, jacobian, u), jacobian, noise)


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
    return Linearised(np.array([wrap(float(value[0]) - predicted[0])]), jacobian, model.noise[sheet.name])


def depth(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Depth below the mean sea surface, which is taken as the ellipsoid."""
    lever: list[float] = (model.dcm @ sheet.lever_arm).tolist()
    jacobian[0, 2] = 1.0
    jacobian[0, 6], jacobian[0, 7] = lever[1], -lever[0]
    predicted = _bias(model, sheet, jacobian, [-float(model.position[2]) + lever[2]])
    return Linearised(value - predicted, jacobian, model.noise[sheet.name])


def speed_log(model: InertialModel, sheet: Datasheet, value: Array, jacobian: Array) -> Linearised | None:
    """Forward speed through the water; the current is part of the bias state."""
    work = np.zeros((3, 12))
    u = _velocity(model, True, sheet, work)[0]
    jacobian[0, :12] = work[0]
    noise = model.noise[sheet.name]
    at = model.scale_at.get(sheet.name)
    if at is not None:
        jacobian[0, at] = u
        u *= 1.0 + float(model.calibration[at - 15])
    elif sheet.scale:
        noise = noise + (sheet.scale * u) ** 2
    return Linearised(value - _bias(model, sheet, jacobian, [u]), jacobian, noise)


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
