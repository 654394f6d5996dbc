"""The constant-velocity model: position and velocity driven by white acceleration, for GNSS alone.

It is the smallest model of simnav: four functions over one flat state, and a class that says how a run begins.

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley 2001,
section 6.2.2 (continuous white noise acceleration).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, sin

import numpy as np

from simnav.compiled import kernel
from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import Needs
from simnav.estimators.algebra.joseph import project
from simnav.geometry.earth import horizontal_offset, move_position
from simnav.kinds import POSITION, VELOCITY, kinds_with
from simnav.structures import filled, structure
from simnav.types import Array, Datasheet, Estimate, InitialState, Instruments

from .declared_errors import bias_of
from .equations import equation_of
from .error_states import with_variance
from .filtering import Aid, AidTable, Dynamics, ModelFunctions, Prediction, Readings, aid_table
from .function_model import FunctionModel
from .inertial_errors import ERROR, PART
from .propagation import Samples

__all__ = ["KinematicModel"]

#: Below this speed the course is no heading for a lever arm [m/s].
SLOWEST = 1.0
#: Roll, pitch and drift angle that a lever arm is not corrected for, and their rate, one sigma [rad], [rad/s].
TILT, TILT_RATE = 0.04, 0.03
#: Velocity in a seaway that fixes once a second cannot follow, one sigma [m/s].
SEAWAY = 0.2

#: The flat state: time [s], position (latitude, longitude [rad], height [m]), velocity [m/s], and last heading [rad].
STATE = structure(time=float, position=3, velocity=3, heading=float)
#: Variance density of the velocity, each axis [(m/s)^2/s].
MOTION = structure(acceleration=float)
#: What an instrument measures.
A_POSITION, A_VELOCITY = range(2)


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time: ``P = F P F' + Q`` with ``F = [1, dt; 0, 1]``."""
    state, P, F = dynamics.numbers.view(STATE)[0], dynamics.covariance, dynamics.transition
    dt = until - state.time
    if dt <= 0.0:
        return
    velocity, q = state.velocity, dynamics.constants.view(MOTION)[0].acceleration
    move_position(state.position, velocity[0] * dt, velocity[1] * dt, velocity[2] * dt)
    state.time = until
    for i in range(3):
        F[i, ERROR.velocity + i] = dt
        for j in range(6):
            P[i, j] += dt * P[ERROR.velocity + i, j]
    for i in range(6):
        for j in range(3):
            P[i, j] += dt * P[i, 3 + j]
    for i in range(3):
        P[i, i] += q * dt * dt * dt / 3.0
        P[i, ERROR.velocity + i] += q * dt * dt / 2.0
        P[ERROR.velocity + i, i] += q * dt * dt / 2.0
        P[ERROR.velocity + i, ERROR.velocity + i] += q * dt


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Predict a fix or a velocity. The lever arm is turned by the course, at low speed by the last one."""
    state, aids, row, value = dynamics.numbers.view(STATE)[0], dynamics.aids, readings.instrument[k], readings.value[k]
    position, velocity, arm, innovation = state.position, state.velocity, aids.lever_arm[row], prediction.innovation
    H = np.zeros((3, 6))
    if aids.code[row] == A_VELOCITY:
        for i in range(3):
            innovation[i], H[i, ERROR.velocity + i] = value[i] - velocity[i], 1.0
    else:
        if hypot(velocity[0], velocity[1]) > SLOWEST:
            state.heading = atan2(velocity[1], velocity[0])
        c, s = cos(state.heading), sin(state.heading)
        north, east = horizontal_offset(position, value[0], value[1])
        innovation[0], innovation[1] = north - (c * arm[0] - s * arm[1]), east - (s * arm[0] + c * arm[1])
        innovation[2] = position[2] - value[2] - arm[2]
        for i in range(3):
            H[i, i] = 1.0
    for i in range(3):
        for j in range(3):
            prediction.nominal[i, j] = aids.noise[row, i] if i == j else 0.0
    project(dynamics.covariance, H, prediction.cross, prediction.predicted)
    return True


@kernel(passed=True)
def retract(dynamics: Dynamics) -> None:
    """Add the correction to the state."""
    state, dx = dynamics.numbers.view(STATE)[0], dynamics.correction
    move_position(state.position, dx[ERROR.position], dx[ERROR.position + 1], dx[ERROR.position + 2])
    for i in range(3):
        state.velocity[i] += dx[ERROR.velocity + i]


class KinematicModel(FunctionModel):
    """The model of the module; six states.

    The bias and the slow errors of a receiver are not observable. They are added to the covariance of the estimate.

    Parameters
    ----------
    acceleration : float
        Noise density of the velocity, each axis [m/s/sqrt(s)].
    """

    size = 6
    equations = ModelFunctions(propagate, predict, retract)

    def __init__(self, acceleration: float = 0.2):
        self.acceleration = acceleration

    def observes(self, instrument: Datasheet) -> bool:
        """Whether it is GNSS."""
        return instrument.equation in (POSITION, VELOCITY)

    @property
    def needs(self) -> Needs:
        """GNSS positions."""
        return (tuple(kinds_with(POSITION)),)

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without GNSS positions."""
        receivers = instruments.of_equation(POSITION)
        if not receivers:
            raise UnsuitableScenario(
                f"it needs an instrument of kind {' or '.join(kinds_with(POSITION))}; there is none"
            )
        self.instruments = instruments
        self.names = [name for name, sheet in instruments.items() if self.observes(sheet)]
        self.numbers = filled(
            STATE, time=start.time, position=start.position, velocity=start.velocity, heading=start.attitude[2]
        )
        self.constants = filled(MOTION, acceleration=self.acceleration**2)
        slow = [with_variance(np.zeros(3), bias_of(r).processes) for r in receivers]
        self._slow = np.diag(np.max(slow, axis=0))
        return np.array(start.covariance[PART.motion, PART.motion])

    def table(self, names: Sequence[str]) -> AidTable:
        """The receivers, with the variances of their noise; what a lever arm does beside the heading is noise."""
        sheets, aids, noise = [self.instruments[name] for name in names], [], []
        for sheet in sheets:
            velocity, arm = equation_of(sheet).is_fix, np.array(sheet.lever_arm, dtype=np.float64)
            aids.append(Aid(A_VELOCITY if velocity else A_POSITION, arm))
            swinging = (TILT_RATE if velocity else TILT) ** 2 * float(arm @ arm)
            noise.append(sheet.sigma**2 + swinging + (sheet.bias**2 + SEAWAY**2 if velocity else 0.0))
        return aid_table(aids, [3] * len(aids), noise)

    def estimate(self, covariance: Array) -> Estimate:
        """Position and velocity."""
        state = self.numbers.view(STATE)[0]
        full = np.zeros((ERROR.gyroscope_bias, ERROR.gyroscope_bias))
        full[PART.motion, PART.motion] = covariance
        full[PART.position, PART.position] += self._slow
        velocity = range(ERROR.velocity, ERROR.attitude)
        full[velocity, velocity] += SEAWAY**2
        return Estimate(self.time, state.position.copy(), state.velocity.copy(), None, full)
