"""The measurements of a step become factors of a window over an inertial model, in compiled code.

Where nothing chooses between measurements, it does what `simnav.estimators.solvers.window.WindowEstimator` does in
Python: the front is propagated to each measurement, becomes a node or an intermediate state, and the measurement
becomes a factor with its nominal noise.
"""

from __future__ import annotations

from typing import NamedTuple

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.factors import AidingFactors, Motions, Rows
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.records import Record
from simnav.types import Array

from .chain import MotionSinceNode, attach_one, begin_motion
from .filtering import Dynamics, Readings
from .intermediate_states import IntermediateStates
from .measurements import HEADING, has_heading
from .propagation import MOTION_NUMBERS, Motion, Samples, carry_errors, motion_of, propagate_inertial

__all__ = ["Growing", "InertialStates", "NewRows", "take_readings"]


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


class NewRows(NamedTuple):
    """How many rows a step has appended, and how many of its measurements cannot be used."""

    nodes: int
    aids: int
    between: int
    unused: int


@helper
def _keep(state: Motion, calibration: Array, kept: InertialStates, row: int) -> None:
    """Write a state into a row."""
    clock = state.clock
    kept.time[row] = clock[0]
    for i in range(3):
        kept.position[row, i], kept.velocity[row, i] = state.position[i], state.velocity[i]
        kept.raw_rate[row, i] = clock[12 + i]
        for j in range(3):
            kept.dcm[row, i, j] = state.dcm[i, j]
    for i in range(6):
        kept.bias[row, i] = state.bias[i]
    for i in range(calibration.size):
        kept.calibration[row, i] = calibration[i]


@helper
def _advance(dynamics: Dynamics, samples: Samples, until: float, since: MotionSinceNode) -> None:
    """Propagate the front, and the motion since the newest node."""
    state = motion_of(dynamics.numbers)
    elapsed = until - state.clock[0]
    if elapsed > 0.0:
        dynamics.next_sample[0] = propagate_inertial(
            state, samples, dynamics.next_sample[0], until, dynamics.constants,
            (dynamics.transition, dynamics.process_noise, since.noise),
            (dynamics.numbers[MOTION_NUMBERS:], dynamics.decay, dynamics.density), elapsed,
        )  # fmt: skip
        carry_errors(dynamics.transition, dynamics.decay, elapsed, since.transition)
        since.elapsed[0] += elapsed


@helper
def _append_motion(motions: Motions, row: int, since: MotionSinceNode, time: float) -> None:
    """Make the motion since the newest node a factor; after it there is no motion."""
    begin_motion(
        since.transition, since.noise, motions.transition[row], motions.jacobian[row], motions.noise[row],
        motions.whitener[row],
    )  # fmt: skip
    for i in range(motions.begin_shift.shape[1]):
        motions.begin_shift[row, i], motions.end_shift[row, i] = 0.0, 0.0
    motions.time[row], motions.weight[row] = time, 1.0
    since.elapsed[0] = 0.0


@helper
def _append_between(between: IntermediateStates, row: int, since: MotionSinceNode, node: int) -> None:
    """Make the motion since the newest node that of an intermediate state."""
    between.node[row] = node
    for i in range(between.shift.shape[1]):
        between.shift[row, i] = 0.0
        for j in range(between.shift.shape[1]):
            between.transition[row, i, j] = between.jacobian[row, i, j] = since.transition[i, j]
            between.noise[row, i, j] = since.noise[i, j]


@kernel
def take_readings(
    dynamics: Dynamics,
    samples: Samples,
    readings: Readings,
    count: int,
    until: float,
    spacing: float,
    growing: Growing,
    rows: Rows,
) -> NewRows:
    """Do `Chain.take` for the chain of an inertial model.

    Parameters
    ----------
    dynamics, samples, readings, count, until
        As of `simnav.estimators.solvers.filter_step.filter_step`.
    spacing : float
        As of `Chain.take` [s].
    growing : Growing
        What new rows are written to. There must be room for ``count`` of each.
    rows : Rows
        Where the window is in it.
    """
    state, calibration = motion_of(dynamics.numbers), dynamics.numbers[MOTION_NUMBERS:]
    since, aids, between_nodes = growing.since_node, growing.aids, growing.between.node
    codes, noises, last = dynamics.aids.codes, dynamics.aids.figures, readings.time[count - 1]
    newest, nodes, attached, added, unused = rows.base + rows.nodes - 1, 0, 0, 0, 0
    for k in range(count):
        time, s = readings.time[k], readings.instrument[k]
        d = codes[s, 1]
        _advance(dynamics, samples, min(time, until), since)
        if codes[s, 0] == HEADING and not has_heading(state.dcm):
            unused += 1
            continue
        if since.elapsed[0] > 0.0 and (time == last or since.elapsed[0] >= spacing):
            _append_motion(growing.motions, rows.first_motion + rows.nodes - 1 + nodes, since, state.clock[0])
            _keep(state, calibration, growing.nodes, rows.first_node + rows.nodes + nodes)
            nodes += 1
            newest += 1
        here, row = -1, rows.first_between + rows.between + added
        if since.elapsed[0] > 0.0:
            known = rows.between + added > 0 and between_nodes[row - 1] == newest
            if not known or growing.between_states.time[row - 1] != state.clock[0]:
                _append_between(growing.between, row, since, newest)
                _keep(state, calibration, growing.between_states, row)
                added += 1
            here = rows.base_between + rows.between + added - 1
        row = rows.first_aid + rows.aids + attached
        aids.node[row], aids.between[row], aids.bare[row], aids.instrument[row] = newest, here, here >= 0, s
        aids.components[row], aids.time[row], aids.weight[row] = d, time, 1.0
        attach_one(
            noises[s, : d * d].reshape((d, d)), readings.value[k, :d], aids.noise[row], aids.whitener[row],
            aids.value[row],
        )  # fmt: skip
        attached += 1
    return NewRows(nodes, attached, added, unused)
