"""The 9-state model of Guo et al. (2026): position, velocity and attitude, with fixed sigmas and no biases.

The paper's motion constraint between epochs (eq. 3) is the strapdown integration. Here it is done as such
(`simnav.strapdown`), at IMU rate and on the rotating Earth. The printed equation lacks brackets and a square; it should
be ``dp = p' - p - v dt - (C f + g) dt^2 / 2``, ``dv = v' - v - (C f + g) dt``, and the attitude on SO(3). Its noise is
as in eq. 25: fixed sigmas of position, velocity and attitude for a second of motion, for any IMU. (Eq. 4 takes the
residual as its own sigma.) GNSS and DVL have the fixed sigmas given below eq. 5; other instruments have those of their
datasheets. ``C v`` in eq. 5 is ``C' v``, as in eq. 6.

Source: Guo et al. (2026), eqs. 1-6 and 25. The paper prints no sigmas of the motion; ours cover the biases of a
tactical-grade IMU for a second.
"""

from __future__ import annotations

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.joseph import project
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled
from simnav.types import Array, InitialState, Instruments, Measurement

from .base import Linearised
from .equations import equation_of
from .filtering import Dynamics, ModelFunctions, Prediction, Readings, aid_of
from .inertial import InertialModel
from .inertial_errors import PART
from .inertial_functions import state_of
from .measurements import NAVIGATION_STATES, observe_inertial
from .propagation import IMU_NOISE, Samples, correct_inertial, motion_of, propagate_inertial, time_of
from .state_blocks import StateBlocks

__all__ = ["NineStateModel"]


@kernel
def propagate_nine(
    covariance: Matrix, transition: Matrix, process_noise: Matrix, motion: Vector, elapsed: float
) -> None:
    """Compute ``P = F P F' + Q`` in place, with the first nine rows and columns of F.

    Parameters
    ----------
    covariance : (9, 9) array
        P; overwritten.
    transition, process_noise : (15, 15) arrays
        F and its noise, of which only that of a time without IMU data is left.
    motion : (9,) array
        Variances of a second of motion.
    elapsed : float
        Length of the step [s].
    """
    X = np.zeros((9, 9))
    for i in range(9):
        for k in range(9):
            for j in range(9):
                X[i, j] += transition[i, k] * covariance[k, j]
    for i in range(9):
        for j in range(i + 1):
            x = 0.5 * (process_noise[i, j] + process_noise[j, i])
            for k in range(9):
                x += 0.5 * (X[i, k] * transition[j, k] + X[j, k] * transition[i, k])
            covariance[i, j] = covariance[j, i] = x
        covariance[i, i] += elapsed * motion[i]


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time; the density is that of the fixed sigmas."""
    state = motion_of(dynamics.numbers)
    elapsed = until - time_of(state)
    if elapsed > 0.0:
        transition, noise, none = dynamics.transition, dynamics.process_noise, np.empty(0)
        dynamics.next_sample[0] = propagate_inertial(
            state, samples, dynamics.next_sample[0], until, dynamics.constants,
            (transition, noise, np.zeros((NAVIGATION_STATES, NAVIGATION_STATES))), (none, none, none), elapsed,
        )  # fmt: skip
        propagate_nine(dynamics.covariance, transition, noise, dynamics.density, elapsed)


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Predict a reading as the inertial model does, without biases."""
    row, aids, d = readings.instrument[k], dynamics.aids, prediction.innovation.size
    jacobian, nine = np.empty((d, NAVIGATION_STATES)), np.empty((d, 9))
    aid, value, state = aid_of(aids, row), readings.value[k, :d], state_of(dynamics.numbers)
    if not observe_inertial(aid, value, state, prediction.innovation, jacobian):
        return False
    for i in range(d):
        for j in range(9):
            nine[i, j] = jacobian[i, j]
        for j in range(d):
            prediction.nominal[i, j] = aids.noise[row, i * d + j]
    project(dynamics.covariance, nine, prediction.cross, prediction.predicted)
    return True


@kernel(passed=True)
def retract(dynamics: Dynamics) -> None:
    """Add the correction to the state."""
    state, full = motion_of(dynamics.numbers), np.zeros(NAVIGATION_STATES)
    for i in range(9):
        full[i] = dynamics.correction[i]
    correct_inertial(state.position, state.velocity, state.dcm, state.bias, np.empty(0), full)


class NineStateModel(InertialModel):
    """Nine states with fixed sigmas (see the module).

    Parameters
    ----------
    sigma_position, sigma_velocity, sigma_attitude_deg : float
        Standard deviations of one second of motion [m], [m/s], [deg]; variances grow in proportion to time.
    sigma_gnss_horizontal, sigma_gnss_vertical : float
        Standard deviations of a GNSS position, per component [m]; 0 takes those of the datasheet.
    sigma_dvl : float
        Standard deviation of a DVL velocity, per component [m/s]; 0 takes that of the datasheet.
    """

    fused = False  # those kernels are of fifteen states
    equations = ModelFunctions(propagate, predict, retract)

    def __init__(
        self,
        sigma_position: float = 0.01,
        sigma_velocity: float = 0.02,
        sigma_attitude_deg: float = 0.01,
        sigma_gnss_horizontal: float = 2.5,
        sigma_gnss_vertical: float = 5.0,
        sigma_dvl: float = 0.1,
    ):
        super().__init__(calibrate=False)
        motion = np.repeat([sigma_position, sigma_velocity, np.radians(sigma_attitude_deg)], 3)
        self._motion = motion**2
        self._gnss = np.array([sigma_gnss_horizontal, sigma_gnss_horizontal, sigma_gnss_vertical])
        self._dvl = sigma_dvl

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU."""
        super().begin(start, instruments)
        self.size, self.blocks, self._density = 9, StateBlocks(9), self._motion
        self._noise = filled(IMU_NOISE, interval=self._noise.view(IMU_NOISE)[0].interval)
        for sheet in instruments.values():
            equation = equation_of(sheet)
            if equation.has_height and np.all(self._gnss > 0.0):
                self.noise[sheet.name] = np.diag(self._gnss**2)
            elif equation.in_body and self._dvl > 0.0:
                self.noise[sheet.name] = self._dvl**2 * np.eye(3)
        return np.array(start.covariance, dtype=np.float64)

    def functions(self) -> ModelFunctions | None:
        """As `ErrorModel.functions`; None if an instrument has an equation of its own, or a scale factor."""
        return None if self.own or self.uncalibrated else self.equations

    def carry(self, error: Array, elapsed: float) -> None:
        """Take an error through the last propagation, in place."""
        error[:] = self.transition[PART.navigation, PART.navigation] @ error

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement (`simnav.estimators.models.measurements`)."""
        linearised = super().measure(measurement)
        if linearised is None:
            return None
        return linearised._replace(jacobian=np.ascontiguousarray(linearised.jacobian[:, PART.navigation]))
