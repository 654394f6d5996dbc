"""New nodes and factors of a window over an inertial model, in compiled code.

These are the functions that `simnav.estimators.solvers.window_step` calls where nothing but the datasheet chooses the
noise of a measurement.
"""

from __future__ import annotations

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.factors import AidingFactors, Motions, NewRows, Rows
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.records import Record
from simnav.types import Array

from .chain import FactorFunctions, MotionSinceNode, attach_one, begin_motion
from .covariance_propagation import carry_errors
from .filtering import Dynamics, Readings
from .intermediate_states import IntermediateStates
from .measurements import HEADING, has_heading
from .propagation import CLOCK, MOTION_NUMBERS, Motion, Samples, motion_of, propagate_inertial, time_of

__all__ = ["INERTIAL_FACTORS", "Growing", "InertialStates"]


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
def use_nominal(dynamics: Dynamics, readings: Readings, k: int) -> bool:
    """The noise is that of the datasheet; False for a heading of a body that points up or down."""
    code = dynamics.aids.code[readings.instrument[k]]
    return code != HEADING or has_heading(motion_of(dynamics.numbers).dcm)


@kernel(passed=True)
def make_node(dynamics: Dynamics, growing: Growing, rows: Rows, new: NewRows) -> NewRows:
    """Make the front a node, with the motion since the newest one as its factor; after it there is no motion."""
    motions, since, row = growing.motions, growing.since_node, rows.first_motion + rows.nodes - 1 + new.nodes
    state = motion_of(dynamics.numbers)
    begin_motion(
        since.transition, since.noise, motions.transition[row], motions.jacobian[row], motions.noise[row],
        motions.whitener[row],
    )  # fmt: skip
    for i in range(motions.begin_shift.shape[1]):
        motions.begin_shift[row, i], motions.end_shift[row, i] = 0.0, 0.0
    motions.time[row], motions.weight[row] = time_of(state), 1.0
    since.elapsed[0] = 0.0
    _keep(state, dynamics.numbers[MOTION_NUMBERS:], growing.nodes, rows.first_node + rows.nodes + new.nodes)
    return NewRows(new.nodes + 1, new.aids, new.between)


@helper
def _append_between(between: IntermediateStates, row: int, since: MotionSinceNode, node: int) -> None:
    """Make the motion since the newest node that of an intermediate state."""
    between.node[row] = node
    for i in range(between.shift.shape[1]):
        between.shift[row, i] = 0.0
        for j in range(between.shift.shape[1]):
            between.transition[row, i, j] = between.jacobian[row, i, j] = since.transition[i, j]
            between.noise[row, i, j] = since.noise[i, j]


@kernel(passed=True)
def attach(dynamics: Dynamics, growing: Growing, rows: Rows, new: NewRows, readings: Readings, k: int) -> NewRows:
    """Make a reading a factor of the newest node with its nominal noise; an intermediate state, if it is later."""
    state, since, aids = motion_of(dynamics.numbers), growing.since_node, growing.aids
    s, newest, here, added = readings.instrument[k], rows.base + rows.nodes - 1 + new.nodes, -1, new.between
    d, noise = dynamics.aids.components[s], dynamics.aids.noise[s]
    if since.elapsed[0] > 0.0:
        row = rows.first_between + rows.between + added
        known = rows.between + added > 0 and growing.between.node[row - 1] == newest
        if not known or growing.between_states.time[row - 1] != time_of(state):
            _append_between(growing.between, row, since, newest)
            _keep(state, dynamics.numbers[MOTION_NUMBERS:], growing.between_states, row)
            added += 1
        here = rows.base_between + rows.between + added - 1
    row = rows.first_aid + rows.aids + new.aids
    aids.node[row], aids.between[row], aids.bare[row], aids.instrument[row] = newest, here, here >= 0, s
    aids.components[row], aids.time[row], aids.weight[row] = d, readings.time[k], 1.0
    attach_one(
        noise[: d * d].reshape((d, d)), readings.value[k, :d], aids.noise[row], aids.whitener[row], aids.value[row]
    )
    return NewRows(new.nodes, new.aids + 1, added)


INERTIAL_FACTORS = FactorFunctions(advance, use_nominal, make_node, attach)
