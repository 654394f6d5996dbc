"""Measurement models of the inertial state: the predicted reading of each kind of instrument, and its Jacobian.

`observe_inertial` is for a filter with one measurement at a time and for a window with many; each kind of reading is a
function of its own. With position p, velocity v, direction cosine matrix C, lever arm l, body rate relative to the
Earth w, height h and ``(.)_D`` for a down component (Groves 2013, section 14.3):

- GNSS position: ``p + C l``; attitude ``-[C l x]``
- GNSS velocity: ``v + C (w x l)``; attitude ``-[C (w x l) x]``; gyroscope bias ``C [l x]``
- DVL: ``u = C' v + w x l``, measured as ``(1 + s) u + u x a + b`` (scale factor s, misalignment a, bias b);
  velocity ``C'``; attitude ``C' [v x]``; gyroscope bias ``[l x]``
- heading: ``atan2(C_10, C_00)``; attitude ``(tan(pitch) cos(yaw), tan(pitch) sin(yaw), 1)``
- depth: ``-h + (C l)_D``; the mean sea surface is taken as the ellipsoid
- speed log: forward component as for the DVL, of the velocity through the water ``v - c``, with the current c (north,
  east) as two states after the bias; current ``-C'``
- terrain fix: horizontal part of ``p + C l``

After each quantity the Jacobians with respect to the states are given. A bias is added to all of them, with a Jacobian
of 1. The effect of scale factor and misalignment on the Jacobians of the other states is of second order and neglected.
The noise is that of the datasheet plus that of the gyroscopes times the lever arm.
"""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

from simnav.compiled import helper, kernel
from simnav.geometry.earth import ECCENTRICITY_SQUARED, ROTATION_RATE, SEMI_MAJOR_AXIS, horizontal_offset
from simnav.geometry.rotation import cross
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array

from .filtering import Aid
from .inertial_errors import ERROR

__all__ = [
    "OWN", "State", "has_heading", "observe", "observe_inertial", "radii", "wrap",
]  # fmt: skip

#: Smallest cosine of the pitch at which there is a heading [-].
LEAST_LEVEL = 0.1
#: Number of components of the inertial state, without the calibration.
NAVIGATION_STATES = ERROR.calibration

#: What `observe_inertial` calls the measurement equations: `simnav.estimators.models.equations.Equation.code`.
GNSS_POSITION, TERRAIN_FIX, GNSS_VELOCITY, DVL, SPEED_LOG, HEADING, DEPTH = range(7)
#: Number of components of the reading by each of them.
COMPONENTS = (3, 2, 3, 3, 1, 1, 1)
#: In the place of a code: the kind of instrument has a function of its own (`simnav.kinds.Kind.observation`).
OWN = -1


class State(NamedTuple):
    """The state at which a measurement is predicted.

    Attributes
    ----------
    position, velocity : (3,) array
        Latitude, longitude [rad] and height [m]; velocity north, east, down [m/s].
    dcm : (3, 3) array
        Rotation from body to north-east-down.
    rate : (3,) array
        Body rate relative to the inertial frame, as measured [rad/s].
    bias : (6,) array
        Biases, the gyroscopes' first.
    calibration : (n - 15,) array
        Calibration states of the instruments.
    """

    position: Vector
    velocity: Vector
    dcm: Matrix
    rate: Vector
    bias: Vector
    calibration: Vector


def wrap(angle: float) -> float:
    """An angle brought into [-pi, pi]."""
    return atan2(sin(angle), cos(angle))


def radii(latitude: float) -> tuple[float, float]:
    """Meridian and prime-vertical radius [m] (Groves eqs. 2.105-2.106), without the overhead of arrays."""
    x = 1.0 - ECCENTRICITY_SQUARED * sin(latitude) ** 2
    prime = SEMI_MAJOR_AXIS / sqrt(x)
    return prime * (1.0 - ECCENTRICITY_SQUARED) / x, prime


@helper
def has_heading(dcm: Array) -> bool:
    """Whether a (3, 3) attitude is far enough from the vertical for a compass."""
    return not dcm[0, 0] * dcm[0, 0] + dcm[1, 0] * dcm[1, 0] < LEAST_LEVEL * LEAST_LEVEL


@helper
def _fill(jacobian: Array, row: int, first: int, values: tuple[float, float, float]) -> None:
    """Write three elements of a row, the derivatives by one part of the error."""
    jacobian[row, first], jacobian[row, first + 1], jacobian[row, first + 2] = values


@helper
def _to_navigation_axes(dcm: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """``C x``, of a vector in body axes."""
    return (
        dcm[0, 0] * x + dcm[0, 1] * y + dcm[0, 2] * z,
        dcm[1, 0] * x + dcm[1, 1] * y + dcm[1, 2] * z,
        dcm[2, 0] * x + dcm[2, 1] * y + dcm[2, 2] * z,
    )


@helper
def _swing(state: State, arm: Array) -> tuple[float, float, float]:
    """``w x l``: what the turning adds to the velocity at the end of a lever arm, in body axes."""
    dcm, rate, bias = state.dcm, state.rate, state.bias
    # Relative to the Earth; the transport rate, under 1e-6 rad/s, is left out.
    e0, e2 = ROTATION_RATE * cos(state.position[0]), -ROTATION_RATE * sin(state.position[0])
    w0 = rate[0] - bias[0] - dcm[0, 0] * e0 - dcm[2, 0] * e2
    w1 = rate[1] - bias[1] - dcm[0, 1] * e0 - dcm[2, 1] * e2
    w2 = rate[2] - bias[2] - dcm[0, 2] * e0 - dcm[2, 2] * e2
    return cross(w0, w1, w2, arm[0], arm[1], arm[2])


@helper
def observe_horizontal_position(arm: Array, value: Array, state: State, innovation: Array, jacobian: Array) -> None:
    """Linearise a terrain fix, and the horizontal part of a GNSS position."""
    c0, c1, c2 = _to_navigation_axes(state.dcm, arm[0], arm[1], arm[2])
    north, east = horizontal_offset(state.position, value[0], value[1])
    innovation[0], innovation[1] = north - c0, east - c1
    jacobian[0, ERROR.position], jacobian[1, ERROR.position + 1] = 1.0, 1.0
    _fill(jacobian, 0, ERROR.attitude, (0.0, c2, -c1))
    _fill(jacobian, 1, ERROR.attitude, (-c2, 0.0, c0))


@helper
def observe_down(arm: Array, down: float, state: State, row: int, innovation: Array, jacobian: Array) -> None:
    """Linearise a depth, and the height of a GNSS position as a depth below the ellipsoid."""
    c0, c1, c2 = _to_navigation_axes(state.dcm, arm[0], arm[1], arm[2])
    innovation[row] = down + state.position[2] - c2
    jacobian[row, ERROR.position + 2] = 1.0
    _fill(jacobian, row, ERROR.attitude, (c1, -c0, 0.0))


@helper
def observe_gnss_velocity(arm: Array, value: Array, state: State, innovation: Array, jacobian: Array) -> None:
    """Linearise the velocity of a GNSS antenna."""
    dcm = state.dcm
    u0, u1, u2 = _swing(state, arm)
    t0, t1, t2 = _to_navigation_axes(dcm, u0, u1, u2)
    innovation[0] = value[0] - state.velocity[0] - t0
    innovation[1] = value[1] - state.velocity[1] - t1
    innovation[2] = value[2] - state.velocity[2] - t2
    _fill(jacobian, 0, ERROR.attitude, (0.0, t2, -t1))
    _fill(jacobian, 1, ERROR.attitude, (-t2, 0.0, t0))
    _fill(jacobian, 2, ERROR.attitude, (t1, -t0, 0.0))
    for i in range(3):
        jacobian[i, ERROR.velocity + i] = 1.0
        # row i of C times [l x]
        _fill(jacobian, i, ERROR.gyroscope_bias, cross(dcm[i, 0], dcm[i, 1], dcm[i, 2], arm[0], arm[1], arm[2]))


@helper
def _along_body_axis(state: State, axis: int, v0: float, v1: float, v2: float, jacobian: Array) -> float:
    """Component of a velocity along a body axis; its derivatives by velocity and attitude go into the row."""
    c0, c1, c2 = state.dcm[0, axis], state.dcm[1, axis], state.dcm[2, axis]
    _fill(jacobian, axis, ERROR.velocity, (c0, c1, c2))
    _fill(jacobian, axis, ERROR.attitude, cross(c0, c1, c2, v0, v1, v2))
    component: float = c0 * v0 + c1 * v1 + c2 * v2
    return component


@helper
def observe_dvl(aid: Aid, value: Array, state: State, innovation: Array, jacobian: Array) -> None:
    """Linearise the velocity of a DVL, with scale factor and misalignment where they are states."""
    arm, scale_at = aid.lever_arm, aid.scale_at
    v0, v1, v2 = state.velocity[0], state.velocity[1], state.velocity[2]
    u0, u1, u2 = _swing(state, arm)
    u0 += _along_body_axis(state, 0, v0, v1, v2, jacobian)
    u1 += _along_body_axis(state, 1, v0, v1, v2, jacobian)
    u2 += _along_body_axis(state, 2, v0, v1, v2, jacobian)
    _fill(jacobian, 0, ERROR.gyroscope_bias, (0.0, -arm[2], arm[1]))
    _fill(jacobian, 1, ERROR.gyroscope_bias, (arm[2], 0.0, -arm[0]))
    _fill(jacobian, 2, ERROR.gyroscope_bias, (-arm[1], arm[0], 0.0))
    innovation[0], innovation[1], innovation[2] = value[0] - u0, value[1] - u1, value[2] - u2
    if scale_at >= 0:
        k = scale_at - NAVIGATION_STATES
        s, a0, a1, a2 = (
            state.calibration[k],
            state.calibration[k + 1],
            state.calibration[k + 2],
            state.calibration[k + 3],
        )
        jacobian[0, scale_at], jacobian[0, scale_at + 2], jacobian[0, scale_at + 3] = u0, -u2, u1
        jacobian[1, scale_at], jacobian[1, scale_at + 1], jacobian[1, scale_at + 3] = u1, u2, -u0
        jacobian[2, scale_at], jacobian[2, scale_at + 1], jacobian[2, scale_at + 2] = u2, -u1, u0
        innovation[0] = innovation[0] - s * u0 - (u1 * a2 - u2 * a1)
        innovation[1] -= s * u1 + u2 * a0 - u0 * a2
        innovation[2] -= s * u2 + u0 * a1 - u1 * a0


@helper
def observe_speed_log(aid: Aid, value: Array, state: State, innovation: Array, jacobian: Array) -> None:
    """Linearise the speed of a log through the water, with current and scale factor where they are states."""
    arm, bias_at, scale_at = aid.lever_arm, aid.bias_at, aid.scale_at
    v0, v1, v2 = state.velocity[0], state.velocity[1], state.velocity[2]
    if bias_at >= 0:
        k = bias_at - NAVIGATION_STATES
        v0, v1 = v0 - state.calibration[k + 1], v1 - state.calibration[k + 2]
        jacobian[0, bias_at + 1], jacobian[0, bias_at + 2] = -state.dcm[0, 0], -state.dcm[1, 0]
    u0 = _swing(state, arm)[0] + _along_body_axis(state, 0, v0, v1, v2, jacobian)
    _fill(jacobian, 0, ERROR.gyroscope_bias, (0.0, -arm[2], arm[1]))
    innovation[0] = value[0] - u0
    if scale_at >= 0:
        jacobian[0, scale_at] = u0
        innovation[0] -= state.calibration[scale_at - NAVIGATION_STATES] * u0


@helper
def observe_heading(value: Array, state: State, innovation: Array, jacobian: Array) -> None:
    """Linearise a heading."""
    c0, c1 = state.dcm[0, 0], state.dcm[1, 0]
    slope = -state.dcm[2, 0] / (c0 * c0 + c1 * c1)
    _fill(jacobian, 0, ERROR.attitude, (slope * c0, slope * c1, 1.0))
    innovation[0] = value[0] - atan2(c1, c0)


@helper
def observe_inertial(aid: Aid, value: Array, state: State, innovation: Array, jacobian: Array) -> int:
    """Compute innovation and Jacobian of one measurement (equations in the module).

    Parameters
    ----------
    aid : Aid
        Parameters of the instrument.
    value : (d,) array
        Measured value.
    state : State
        The state at which the measurement is predicted.
    innovation : (d,) array
        Overwritten with measured minus predicted, in the units of ``KINDS[kind].errors``.
    jacobian : (d, n) array
        Overwritten with the Jacobian of the prediction, including zeros; n may be 12 without calibration states.

    Returns
    -------
    int
        Number d of components; 0 if there is no such measurement at this state (a heading near the vertical).
    """
    code, arm, bias_at = aid.code, aid.lever_arm, aid.bias_at
    d = COMPONENTS[code]
    for i in range(d):
        for j in range(jacobian.shape[1]):
            jacobian[i, j] = 0.0
    if code == HEADING and not has_heading(state.dcm):
        return 0

    if code == GNSS_POSITION:
        observe_horizontal_position(arm, value, state, innovation, jacobian)
        observe_down(arm, -value[2], state, 2, innovation, jacobian)
    elif code == TERRAIN_FIX:
        observe_horizontal_position(arm, value, state, innovation, jacobian)
    elif code == GNSS_VELOCITY:
        observe_gnss_velocity(arm, value, state, innovation, jacobian)
    elif code == DVL:
        observe_dvl(aid, value, state, innovation, jacobian)
    elif code == SPEED_LOG:
        observe_speed_log(aid, value, state, innovation, jacobian)
    elif code == HEADING:
        observe_heading(value, state, innovation, jacobian)
    else:
        observe_down(arm, value[0], state, 0, innovation, jacobian)

    if bias_at >= 0:
        for i in range(d):
            jacobian[i, bias_at + i] = 1.0
            innovation[i] -= state.calibration[bias_at - NAVIGATION_STATES + i]
    if code == HEADING:
        innovation[0] = atan2(sin(innovation[0]), cos(innovation[0]))
    return d


@kernel
def observe(
    aid: Aid,
    value: Vector,
    state: State,
    innovation: Vector,
    jacobian: Matrix,
) -> int:
    """Call `observe_inertial` from Python."""
    return observe_inertial(aid, value, state, innovation, jacobian)
