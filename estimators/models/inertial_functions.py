"""The equations of the inertial model as the functions of a filter, over its flat state."""

from __future__ import annotations

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.types import Array

from .filtering import Aid, Dynamics, ModelFunctions, Prediction, Readings, aid_of
from .measurements import State, observe_inertial
from .propagation import CLOCK, MOTION_NUMBERS, Samples, correct_inertial, motion_of, propagate_inertial, time_of

__all__ = ["INERTIAL_FUNCTIONS", "state_of", "use_reading"]


@helper
def state_of(numbers: Array) -> State:
    """The state at which a reading is predicted, as views of the flat one."""
    motion = motion_of(numbers)
    rate = motion.clock.view(CLOCK)[0].rate[:]  # an array like the others
    return State(motion.position, motion.velocity, motion.dcm, rate, motion.bias, numbers[MOTION_NUMBERS:])


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time, through the IMU samples."""
    state = motion_of(dynamics.numbers)
    elapsed = until - time_of(state)
    if elapsed > 0.0:
        dynamics.next_sample[0] = propagate_inertial(
            state, samples, dynamics.next_sample[0], until, dynamics.constants,
            (dynamics.transition, dynamics.process_noise, dynamics.covariance),
            (dynamics.numbers[MOTION_NUMBERS:], dynamics.decay, dynamics.density), elapsed,
        )  # fmt: skip


@helper
def predict_reading(
    aid: Aid, value: Array, state: State, covariance: Array, innovation: Array, cross: Array, predicted: Array
) -> bool:
    """Compute innovation, P H' and H P H' of a reading; False if there is no such reading at this state."""
    jacobian = np.empty((innovation.size, covariance.shape[0]))
    if not observe_inertial(aid, value, state, innovation, jacobian):
        return False
    project(covariance, jacobian, cross, predicted)
    return True


@helper
def use_reading(aid: Aid, value: Array, state: State, covariance: Array, noise: Array, correction: Array) -> None:
    """Correct a state and its covariance by a reading, where there is such a reading, for a loop over many filters."""
    n, d = covariance.shape[0], noise.shape[0]
    innovation, cross, spread = np.empty(d), np.empty((n, d)), np.empty((d, d))
    if not predict_reading(aid, value, state, covariance, innovation, cross, spread):
        return
    for a in range(d):
        for b in range(d):
            spread[a, b] += noise[a, b]
    if joseph_update(covariance, cross, spread, innovation, correction) >= 0.0:
        correct_inertial(state.position, state.velocity, state.dcm, state.bias, state.calibration, correction)


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Compute what a reading should be, and the covariance of that (`observe_inertial`)."""
    row, aids = readings.instrument[k], dynamics.aids
    d = aids.components[row]
    for a in range(d):
        for b in range(d):
            prediction.nominal[a, b] = aids.noise[row, a * d + b]
    return predict_reading(
        aid_of(aids, row), readings.value[k, :d], state_of(dynamics.numbers), dynamics.covariance,
        prediction.innovation, prediction.cross, prediction.predicted,
    )  # fmt: skip


@kernel(passed=True)
def retract(dynamics: Dynamics) -> None:
    """Add the correction to the state."""
    state = motion_of(dynamics.numbers)
    correct_inertial(
        state.position, state.velocity, state.dcm, state.bias, dynamics.numbers[MOTION_NUMBERS:], dynamics.correction
    )


INERTIAL_FUNCTIONS = ModelFunctions(propagate, predict, retract)
