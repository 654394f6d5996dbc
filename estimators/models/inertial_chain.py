"""The chain of the inertial model: preintegrated IMU factors, and all aids of a window linearised at once.

Equations of the motion factors are in `simnav.estimators.models.preintegrated`. The kernels take the whole window, so
that one call linearises all factors or moves all nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.block_tridiagonal import after_step, error_after_step, whiten_one
from simnav.estimators.algebra.factors import Rows, Window
from simnav.kernel_types import Matrix, Stack
from simnav.records import Record
from simnav.types import Array, InitialState, Instruments

from .chain import Chain, chain_of
from .columns import Columns
from .difference_prior import differences_at_mean, differences_at_node
from .filtering import AidTable, aid_of
from .group_prior import at_mean, at_node
from .inertial import InertialModel
from .inertial_errors import ERROR
from .inertial_functions import INERTIAL_FUNCTIONS
from .intermediate_states import IntermediateStates, add_noise, through_one
from .marginalisation import Reference
from .measurements import OWN, State, observe_inertial
from .new_factors import INERTIAL_FACTORS, Growing, InertialStates
from .preintegrated import add_shift, move_shift, relative_shift
from .propagation import IMU_NOISE, correct_inertial

__all__ = ["InertialChain", "InertialWindow", "Moves"]

#: Density of the white noise of accelerometers in a motion factor, at least [m/s^2/sqrt(Hz)]: 0.1 ug, a tenth of that
#: of the best ones. Without noise the rounding of a motion is worth many sigmas, and a robust weight sets it aside.
LEAST_NOISE = 1e-6


class MovedStates(Record):
    """Intermediate states where the shifts of their nodes lead; arrays as of `InertialStates`."""

    position: Matrix
    velocity: Matrix
    dcm: Stack
    bias: Matrix
    calibration: Matrix


class InertialWindow(Record):
    """The window of an inertial model: nodes and factors, the inertial states of its nodes, and what lies between."""

    window: Window
    states: InertialStates
    between: IntermediateStates
    predicted: InertialStates
    moved: MovedStates
    instruments: AidTable


class Moves(Record):
    """How the nodes of a window are moved (`simnav.estimators.solvers.window_iteration`).

    Attributes
    ----------
    reference : Reference
        How the prior is linearised at another state.
    linearise : callable
        Linearises and whitens the factors that have to do with a node or later ones.
    retract : callable
        Adds a (K, n) step to the nodes.
    take_step : callable
        Adds the step of each node, and keeps the linearisation; the cost.
    """

    reference: Reference
    linearise: Callable[[InertialWindow, Rows, int], None]
    retract: Callable[[InertialWindow, Rows, Matrix], None]
    take_step: Callable[[InertialWindow, Rows], float]


@kernel
def _along_motion(
    transition: Stack,
    jacobian: Stack,
    residual: Matrix,
    begin_shift: Matrix,
    end_shift: Matrix,
    step: Matrix,
    along: Matrix,
) -> None:
    """A step that follows the motion exactly, from one that solves the linear problem (`Chain.along_motion`).

    Parameters
    ----------
    transition, jacobian, residual, begin_shift, end_shift
        The linearised motion factors, as in `_linearise_motion`.
    step : (K + 1, n) array
        Step of each node that solves the linear problem.
    along : (K + 1, n) array
        Overwritten: the same first step, and after it the motion with the errors that the linear solution leaves to it.
    """
    count, n = begin_shift.shape
    shift, moved, error, J = np.empty(n), np.empty(n), np.empty(n), np.zeros((n, n))
    along[0] = step[0]
    for k in range(count):
        error_after_step(residual[k], jacobian[k], step[k], step[k + 1], error)
        add_shift(along[k], begin_shift[k], shift)
        move_shift(transition[k], shift, moved, J)
        add_shift(error, moved, shift)
        relative_shift(shift, end_shift[k], along[k + 1])


@helper
def _move_between(first: int, end: int, w: InertialWindow) -> None:
    """Move the intermediate states in these rows to where their nodes' shifts lead, with the derivatives."""
    transition, shift, jacobian, predicted, now = (
        w.between.transition, w.between.shift, w.between.jacobian, w.predicted, w.moved,
    )  # fmt: skip
    n, c = shift.shape[1], now.calibration.shape[1]
    moved, dx = np.empty(n), np.zeros(ERROR.calibration + c)
    for k in range(first, end):
        for i in range(3):
            now.position[k, i], now.velocity[k, i] = predicted.position[k, i], predicted.velocity[k, i]
            for j in range(3):
                now.dcm[k, i, j] = predicted.dcm[k, i, j]
        for i in range(6):
            now.bias[k, i] = predicted.bias[k, i]
        for i in range(c):
            now.calibration[k, i] = predicted.calibration[k, i]
        move_shift(transition[k], shift[k], moved, jacobian[k])
        for j in range(n):
            dx[j] = moved[j]
        correct_inertial(now.position[k], now.velocity[k], now.dcm[k], now.bias[k], now.calibration[k], dx)


@helper
def _first_aid(w: InertialWindow, rows: Rows, first: int) -> int:
    """The row of the first aiding factor of a node, counted from the first of the window, or of a later one."""
    node, row = w.window.aids.node, rows.first_aid + rows.aids
    while row > rows.first_aid and node[row - 1] - rows.base >= first:
        row -= 1
    return row


@kernel
def _linearise_motion(w: InertialWindow, rows: Rows, first: int) -> None:
    """Compute the error of each motion that leads to a node or to later ones, its derivative, and its whitened norm."""
    m, m0, moved = w.window.motions, rows.first_motion, np.empty(w.window.motions.residual.shape[1])
    for k in range(m0 + max(first - 1, 0), m0 + rows.nodes - 1):
        move_shift(m.transition[k], m.begin_shift[k], moved, m.jacobian[k])
        relative_shift(m.end_shift[k], moved, m.residual[k])
        m.norm[k] = whiten_one(m.residual[k], m.whitener[k], m.whitened[k])


@kernel
def _linearise_readings(w: InertialWindow, rows: Rows, first: int) -> None:
    """Predict the readings of a node or of later ones whose equation is compiled, at nodes or intermediate states."""
    aids, instruments, states, now, rate = w.window.aids, w.instruments, w.states, w.moved, w.predicted.raw_rate
    node, between, residual, jacobian = aids.node, aids.between, aids.residual, aids.jacobian
    n, begin, end = jacobian.shape[2], _first_aid(w, rows, first), rows.first_aid + rows.aids
    innovation, wide, b0 = np.empty(3), np.zeros((3, ERROR.calibration)), rows.first_between
    if rows.between and begin < end:
        at = b0 + rows.between
        while at > b0 and w.between.node[at - 1] >= node[begin]:
            at -= 1
        _move_between(at, b0 + rows.between, w)
    for i in range(begin, end):
        s = aids.instrument[i]
        if instruments.code[s] == OWN:
            continue
        if between[i] >= 0:
            k = b0 + between[i] - rows.base_between
            state = State(now.position[k], now.velocity[k], now.dcm[k], rate[k], now.bias[k], now.calibration[k])
        else:
            k = rows.first_node + node[i] - rows.base
            state = State(
                states.position[k], states.velocity[k], states.dcm[k], states.raw_rate[k], states.bias[k],
                states.calibration[k],
            )  # fmt: skip
        d = observe_inertial(
            aid_of(instruments, s),
            aids.value[i], state, innovation, jacobian[i] if n >= ERROR.calibration else wide,
        )  # fmt: skip
        aids.components[i] = d
        for r in range(3):
            residual[i, r] = innovation[r] if r < d else 0.0
        if n < ERROR.calibration:
            for r in range(3):
                for c in range(n):
                    jacobian[i, r, c] = wide[r, c]
                    wide[r, c] = 0.0


@kernel
def _refer_to_nodes(w: InertialWindow, rows: Rows, first: int) -> None:
    """Refer the readings at intermediate states to their nodes, and whiten all readings of a node or of later ones."""
    aids, between = w.window.aids, w.between
    n = aids.jacobian.shape[2]
    work = np.empty(n)
    for i in range(_first_aid(w, rows, first), rows.first_aid + rows.aids):
        if aids.between[i] >= 0:
            k = rows.first_between + aids.between[i] - rows.base_between
            if aids.bare[i] != 0:
                aids.bare[i] = 0
                add_noise(
                    aids.jacobian[i], aids.components[i], between.noise[k], aids.noise[i], aids.whitener[i], work
                )  # fmt: skip
            through_one(between.jacobian[k], min(ERROR.calibration, n), aids.jacobian[i], work)
        aids.norm[i] = whiten_one(aids.residual[i], aids.whitener[i], aids.whitened[i])


@kernel(passed=True)
def _linearise(w: InertialWindow, rows: Rows, first: int) -> None:
    """Linearise and whiten the factors that have to do with a node or later ones, all with compiled equations."""
    _linearise_motion(w, rows, first)
    _linearise_readings(w, rows, first)
    _refer_to_nodes(w, rows, first)


@kernel(passed=True)
def _retract(w: InertialWindow, rows: Rows, step: Matrix) -> None:
    """Move the nodes by a step, in place, with the shifts of the motions and of the prior.

    Parameters
    ----------
    w : InertialWindow
        The window.
    rows : Rows
        Where it is.
    step : (K, n) array
        Corrections, of which the rotation vector at `ERROR.attitude` turns the attitude from the left; its first row
        is that of the first node.
    """
    states, motions, between, shift = w.states, w.window.motions, w.between, w.window.prior.shift
    n, k0, m0, count = step.shape[1], rows.first_node, rows.first_motion, rows.nodes
    dx, before = np.zeros(max(n, ERROR.calibration)), np.empty(n)
    for k in range(count):
        row, m = k0 + k, m0 + k
        for j in range(n):
            dx[j] = step[k, j]
        correct_inertial(
            states.position[row], states.velocity[row], states.dcm[row], states.bias[row], states.calibration[row], dx
        )
        if k < count - 1:
            add_shift(step[k], motions.begin_shift[m], motions.begin_shift[m])
        if k > 0:
            add_shift(step[k], motions.end_shift[m - 1], motions.end_shift[m - 1])
    for i in range(rows.first_between, rows.first_between + rows.between):
        add_shift(step[between.node[i] - rows.base], between.shift[i], between.shift[i])
    for j in range(n):
        before[j] = shift[j]
    relative_shift(before, step[0], shift)


@kernel(passed=True)
def _take_step(w: InertialWindow, rows: Rows) -> float:
    """Move the nodes by their steps, and keep the linearisation (`after_step`); the cost."""
    _retract(w, rows, w.window.nodes.step[rows.first_node : rows.first_node + rows.nodes])
    return after_step(w.window, rows)


@cache
def _moves(prior: Literal["differences", "group"]) -> Moves:
    """The functions of this module, which are looked up once."""
    to_node, to_mean = (at_node, at_mean) if prior == "group" else (differences_at_node, differences_at_mean)
    reference = Reference(at_node=to_node, at_mean=to_mean, relative_shift=relative_shift)
    return Moves(reference=reference, linearise=_linearise, retract=_retract, take_step=_take_step)


class InertialChain(Chain):
    """The chain of an inertial model.

    Parameters
    ----------
    front : InertialModel
        Of 15 states, with or without calibration states, or the 9-state model.
    """

    coupled = ERROR.calibration
    front: InertialModel

    @property
    def node_arrays(self) -> tuple[str, ...]:
        """As `Chain.node_arrays`: the output of the gyroscopes, and of the accelerometers if a delay needs it."""
        return ("raw_rate", "raw_force") if self.front.delayed else ("raw_rate",)

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """One node, at the start; its covariance. UnsuitableScenario without an IMU."""
        covariance = super().begin(start, instruments)
        front = self.front
        imu = front._noise.view(IMU_NOISE)[0]
        imu["accelerometer"] = max(imu["accelerometer"], LEAST_NOISE**2)
        self._instruments = front.table(self.names)
        self._instruments.code[[name in front.own for name in self.names]] = OWN
        self.functions = INERTIAL_FACTORS if front.functions() is INERTIAL_FUNCTIONS else None
        if self.functions is not None:
            self.dynamics = front.dynamics(covariance, self.names)
        return covariance

    @property
    def reference(self) -> Reference:
        """As `Chain.reference`: rotations compose."""
        return _moves(self.prior_of).reference

    @property
    def graph(self) -> InertialWindow:
        """The window as kernels take it; it holds until a column is replaced."""
        return self._made.once(InertialWindow, self._make_graph)

    def _make_graph(self) -> InertialWindow:
        return InertialWindow(
            window=self.window, states=self.nodes.record(InertialStates), between=self._states_between,
            predicted=self.between.record(InertialStates), moved=self.between.record(MovedStates, "now_"),
            instruments=self._instruments,
        )  # fmt: skip

    def growing(self, count: int) -> Growing:
        """As `Chain.growing`."""
        for columns in (self.nodes, self.motions, self.aids, self.between):
            columns.reserve(count)
        return self._made.once(Growing, self._make_growing)

    def _make_growing(self) -> Growing:
        w = self.graph
        return Growing(
            nodes=w.states, motions=w.window.motions, aids=w.window.aids, between=w.between,
            between_states=w.predicted, since_node=self.since_node,
        )  # fmt: skip

    @property
    def moves(self) -> Any:
        """As `Chain.moves`: kernels, unless a reading has an equation of its own."""
        return super().moves if self.front.own else _moves(self.prior_of)

    def linearise_from(self, node: int = 0) -> None:
        """As `Chain.linearise_from` (equations in the module)."""
        if self.front.own:
            self.linearise_motion(node)
            self.linearise_aids(node)
        else:
            _linearise.unchecked(self.graph, self.rows, node)

    def linearise_motion(self, node: int = 0) -> None:
        """As `Chain.linearise_motion`."""
        _linearise_motion.unchecked(self.graph, self.rows, node)

    def linearise_aids(self, node: int = 0) -> None:
        """As `Chain.linearise_aids`."""
        _linearise_readings.unchecked(self.graph, self.rows, node)
        if self.front.own:
            self._observe_own(self.first_aid(node))
        _refer_to_nodes.unchecked(self.graph, self.rows, node)

    def _observe_own(self, first: int) -> None:
        """The readings from an index on whose kind has a measurement equation of its own."""
        aids = self.aids
        for row, states, prefix in self.places(first):
            self.observe(first, row, states, prefix, aids["jacobian"])

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`, for readings whose kind has a measurement equation of its own."""
        wide = jacobian if self.size >= ERROR.calibration else np.zeros((len(jacobian), 3, ERROR.calibration))
        position, velocity, dcm, bias, calibration = (states[prefix + name] for name in self.front.state)
        arrays = [states[name] for name in self.node_arrays]
        inertial = arrays[0] if len(arrays) == 1 else np.hstack(arrays)
        self.observe_own(first, row, wide, State(position, velocity, dcm, inertial, bias, calibration))
        if wide is not jacobian:
            own = self._instruments.code[self.aids["instrument"][first:]] == OWN
            here = np.flatnonzero((row[first:] >= 0) & own) + first
            jacobian[here] = wide[here, :, : self.size]

    def retract(self, step: Array) -> None:
        """As `Chain.retract`."""
        _retract.unchecked(self.graph, self.rows, step)

    def take_step(self) -> float:
        """As `Chain.take_step`."""
        cost: float = _take_step.unchecked(self.graph, self.rows)
        return cost

    def along_motion(self, step: Array) -> Array:
        """As `Chain.along_motion`."""
        m, along = self.motions, np.empty_like(step)
        _along_motion.unchecked(
            m["transition"], m["jacobian"], m["residual"], m["begin_shift"], m["end_shift"], step, along
        )  # fmt: skip
        return along


@chain_of.register
def _(model: InertialModel) -> Chain:
    return InertialChain(model)
