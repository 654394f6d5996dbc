"""New nodes and factors of a window over an inertial model, in compiled code.

These are the functions that `simnav.estimators.solvers.window_step` calls where nothing but the datasheet chooses the
noise of a measurement.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.factors import AidingFactors, Motions, NewRows, Rows
from simnav.kernel_types import Matrix, Stack, Vector
from simnav.records import Record
from simnav.types import Array

from .appended_rows import MotionSinceNode, append_aid, append_between, append_motion
from .covariance_propagation import carry_errors
from .filtering import Dynamics, Readings
from .intermediate_states import IntermediateStates
from .measurements import HEADING, has_heading
from .propagation import CLOCK, MOTION_NUMBERS, Motion, Samples, motion_of, propagate_inertial, time_of

__all__ = ["FactorFunctions", "Growing", "InertialStates", "inertial_factors"]


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


class FactorFunctions(Record):
    """The functions of a step of a window (`simnav.estimators.solvers.window_step`).

    Attributes
    ----------
    advance : callable
        Propagates the front to a time.
    choose : callable
        Chooses the noise of a reading; False if it is not to be used.
    make_node : callable
        Makes the front a node, with a motion factor.
    attach : callable
        Makes a reading a factor of the newest node.
    """

    advance: Callable[[Dynamics, Growing, Samples, float], None]
    choose: Callable[[Dynamics, Readings, int], bool]
    make_node: Callable[[Dynamics, Growing, Rows, NewRows], NewRows]
    attach: Callable[[Dynamics, Growing, Rows, NewRows, Readings, int], NewRows]


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
    state, row = motion_of(dynamics.numbers), rows.nodes - 1 + new.nodes
    append_motion(growing.motions, rows.first_motion + row, growing.since_node, time_of(state))
    _keep(state, dynamics.numbers[MOTION_NUMBERS:], growing.nodes, rows.first_node + row + 1)
    return NewRows(new.nodes + 1, new.aids, new.between)


@kernel(passed=True)
def attach(dynamics: Dynamics, growing: Growing, rows: Rows, new: NewRows, readings: Readings, k: int) -> NewRows:
    """Make a reading a factor of the newest node with its nominal noise; an intermediate state, if it is later."""
    state, since = motion_of(dynamics.numbers), growing.since_node
    s, newest, here, added = readings.instrument[k], rows.base + rows.nodes - 1 + new.nodes, -1, new.between
    d, noise = dynamics.aids.components[s], dynamics.aids.noise[s]
    if since.elapsed[0] > 0.0:
        row = rows.first_between + rows.between + added
        known = rows.between + added > 0 and growing.between.node[row - 1] == newest
        if not known or growing.between_states.time[row - 1] != time_of(state):
            append_between(growing.between, row, since, newest)
            _keep(state, dynamics.numbers[MOTION_NUMBERS:], growing.between_states, row)
            added += 1
        here = rows.base_between + rows.between + added - 1
    append_aid(
        growing.aids, rows.first_aid + rows.aids + new.aids, newest, here, s, readings.time[k],
        noise[: d * d].reshape((d, d)), readings.value[k, :d],
    )  # fmt: skip
    return NewRows(new.nodes, new.aids + 1, added)


@cache
def inertial_factors() -> FactorFunctions:
    """The functions of this module, which are looked up once."""
    return FactorFunctions(advance=advance, choose=use_nominal, make_node=make_node, attach=attach)
