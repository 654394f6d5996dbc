"""New nodes and factors of a window over an inertial model, in compiled code.

These are the functions of the model that `simnav.estimators.solvers.window_step` calls. The covariance at the front is
carried along only where the noise of a measurement is chosen from its innovation.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.factors import AidingFactors, Motions, NewRows, Rows
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.records import Record
from simnav.types import Array

from .appended_rows import MotionSinceNode, append_aid, append_between, append_motion
from .covariance_propagation import carry_errors, propagate_covariance
from .filtering import Dynamics, Prediction, Readings
from .inertial_functions import predict
from .intermediate_states import IntermediateStates
from .measurements import HEADING, has_heading
from .propagation import CLOCK, MOTION_NUMBERS, Motion, Samples, motion_of, propagate_inertial, time_of

__all__ = ["INERTIAL_FACTORS", "FactorFunctions", "Growing", "InertialStates"]


class InertialStates(Record):
    """Inertial states of nodes or of intermediate states: whole columns, with c calibration states.

    Attributes
    ----------
    time : (K,) array
        Time [s].
    position, velocity, raw_rate : (K, 3) arrays
        Latitude, longitude [rad] and height [m]; velocity north, east, down [m/s]; output of the gyroscopes [rad/s].
    dcm : (K, 3, 3) array
        Rotation from body to north-east-down.
    bias : (K, 6) array
        Biases of gyroscopes [rad/s] and accelerometers [m/s^2].
    calibration : (K, c) array
        Calibration states of the instruments.
    """

    time: Vector
    position: Matrix
    velocity: Matrix
    dcm: Stack
    bias: Matrix
    calibration: Matrix
    raw_rate: Matrix


class Growing(Record):
    """What new rows are appended to: nodes and intermediate states with their inertial states, and the factors."""

    nodes: InertialStates
    motions: Motions
    aids: AidingFactors
    between: IntermediateStates
    between_states: InertialStates
    since_node: MotionSinceNode


class FactorFunctions(NamedTuple):
    """The functions of a model in a step of a window (`simnav.estimators.solvers.window_step.WindowStep`).

    Attributes
    ----------
    advance, advance_covariance : Kernel
        Propagates the front to a time, without its covariance or with it.
    predict_noise, predict : Kernel
        Predicts the noise of a reading, or all of it; the second needs the covariance.
    make_node : Kernel
        Makes the front a node.
    attach : Kernel
        Makes a reading a factor of the newest node.
    """

    advance: Callable[..., None]
    advance_covariance: Callable[..., None]
    predict_noise: Callable[..., bool]
    predict: Callable[..., bool]
    make_node: Callable[..., NewRows]
    attach: Callable[..., NewRows]


@helper
def _keep(state: Motion, calibration: Array, kept: InertialStates, row: int) -> None:
    """Write a state into a row."""
    clock = state.clock.view(CLOCK)[0]
    kept.time[row] = clock.time
    for i in range(3):
        kept.position[row, i], kept.velocity[row, i] = state.position[i], state.velocity[i]
        kept.raw_rate[row, i] = clock.rate[i]
        for j in range(3):
            kept.dcm[row, i, j] = state.dcm[i, j]
    for i in range(6):
        kept.bias[row, i] = state.bias[i]
    for i in range(calibration.size):
        kept.calibration[row, i] = calibration[i]


@kernel(passed=True)
def advance(dynamics: Dynamics, growing: Growing, samples: Samples, until: float) -> None:
    """Propagate the front, and the motion since the newest node."""
    state, since = motion_of(dynamics.numbers), growing.since_node
    elapsed = until - time_of(state)
    if elapsed > 0.0:
        dynamics.next_sample[0] = propagate_inertial(
            state, samples, dynamics.next_sample[0], until, dynamics.constants,
            (dynamics.transition, dynamics.process_noise, since.noise),
            (dynamics.numbers[MOTION_NUMBERS:], dynamics.decay, dynamics.density), elapsed,
        )  # fmt: skip
        carry_errors(dynamics.transition, dynamics.decay, elapsed, since.transition)
        since.elapsed[0] += elapsed


@kernel(passed=True)
def advance_covariance(dynamics: Dynamics, growing: Growing, samples: Samples, until: float) -> None:
    """Propagate the front with its covariance, and the motion since the newest node."""
    elapsed = until - time_of(motion_of(dynamics.numbers))
    advance(dynamics, growing, samples, until)
    if elapsed > 0.0:
        propagate_covariance(
            dynamics.covariance, dynamics.transition, dynamics.process_noise, np.zeros(dynamics.decay.size),
            dynamics.decay, dynamics.density, elapsed,
        )  # fmt: skip


@kernel(passed=True)
def predict_noise(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """The noise of the datasheet, and no more; False for a heading of a body that points up or down."""
    row, aids, d = readings.instrument[k], dynamics.aids, prediction.nominal.shape[0]
    for a in range(d):
        for b in range(d):
            prediction.nominal[a, b] = aids.noise[row, a * d + b]
    return aids.code[row] != HEADING or has_heading(motion_of(dynamics.numbers).dcm)


@kernel(passed=True)
def make_node(dynamics: Dynamics, growing: Growing, rows: Rows, new: NewRows) -> NewRows:
    """Make the front a node, with the motion since the newest one as its factor; after it there is no motion."""
    state, row = motion_of(dynamics.numbers), rows.nodes - 1 + new.nodes
    append_motion(growing.motions, rows.first_motion + row, growing.since_node, time_of(state))
    _keep(state, dynamics.numbers[MOTION_NUMBERS:], growing.nodes, rows.first_node + row + 1)
    return NewRows(new.nodes + 1, new.aids, new.between)


@kernel(passed=True)
def attach(
    dynamics: Dynamics, growing: Growing, rows: Rows, new: NewRows, readings: Readings, k: int, prediction: Prediction
) -> NewRows:
    """Make a reading a factor of the newest node, with the noise that was chosen; an intermediate state, if later."""
    state, since = motion_of(dynamics.numbers), growing.since_node
    s, newest, here, added = readings.instrument[k], rows.base + rows.nodes - 1 + new.nodes, -1, new.between
    noise = prediction.noise
    if since.elapsed[0] > 0.0:
        row = rows.first_between + rows.between + added
        known = rows.between + added > 0 and growing.between.node[row - 1] == newest
        if not known or growing.between_states.time[row - 1] != time_of(state):
            append_between(growing.between, row, since, newest)
            _keep(state, dynamics.numbers[MOTION_NUMBERS:], growing.between_states, row)
            added += 1
        here = rows.base_between + rows.between + added - 1
    append_aid(
        growing.aids, rows.first_aid + rows.aids + new.aids, newest, here, s, readings.time[k], noise,
        readings.value[k, : noise.shape[0]],
    )  # fmt: skip
    return NewRows(new.nodes, new.aids + 1, added)


INERTIAL_FACTORS = FactorFunctions(advance, advance_covariance, predict_noise, predict, make_node, attach)
