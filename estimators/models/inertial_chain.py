"""The chain of the inertial model: preintegrated IMU factors, and all aids of a window linearised at once.

Equations of the motion factors are in `simnav.estimators.models.preintegrated`. The kernels take whole columns with the
places of their rows (`simnav.estimators.models.columns.Columns`), so that one call linearises all factors, moves all
nodes, or attaches all measurements of a step.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.block_tridiagonal import (
    after_step,
    error_after_step,
    whiten_one,
)
from simnav.estimators.algebra.whitening import whitening
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.types import Array, InitialState, Instruments, Measurement

from .chain import STEPPED, Chain, chain_of
from .columns import Columns, Selection
from .filtering import ReadingsOfSteps
from .folds import add_noise, through_one
from .inertial import InertialModel
from .inertial_take import TAKEN, take_inertial
from .measurements import OWN, Aid, State, observe_inertial
from .preintegrated import add_shift, move_shift, relative_shift, turn_covariance
from .propagation import correct_inertial

__all__ = ["InertialChain"]


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
def _move_folds(
    first: int,
    end: int,
    transition: Array,
    shift: Array,
    jacobian: Array,
    predicted: tuple[Array, ...],
    now: tuple[Array, ...],
) -> None:
    """States of the folds in these rows where their nodes' shifts lead, and their derivatives; see `_linearise`."""
    position, velocity, dcm, bias, calibration = now
    moved, dx = np.empty(shift.shape[1]), np.zeros(15 + calibration.shape[1])
    for k in range(first, end):
        for i in range(3):
            position[k, i], velocity[k, i] = predicted[0][k, i], predicted[1][k, i]
            for j in range(3):
                dcm[k, i, j] = predicted[2][k, i, j]
        for i in range(6):
            bias[k, i] = predicted[3][k, i]
        for i in range(calibration.shape[1]):
            calibration[k, i] = predicted[4][k, i]
        move_shift(transition[k], shift[k], moved, jacobian[k])
        for j in range(moved.size):
            dx[j] = moved[j]
        correct_inertial(position[k], velocity[k], dcm[k], bias[k], calibration[k], dx)


#: What `_linearise` is to do: motion factors; readings that it predicts itself; what follows for all readings.
MOTION, READINGS, REST = 1, 2, 4
EVERYTHING = MOTION | READINGS | REST

_STATES = "Tuple((f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1]))"
_NODE_STATES = "Tuple((f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1]))"
_STATE = ("position", "velocity", "dcm", "bias", "calibration")
#: The whole columns that `_linearise`, `_retract` and `_marginalise` take.
LINEARISED = Selection(
    ("nodes", ("position", "velocity", "dcm", "raw_rate", "bias", "calibration")),
    (
        "motions",
        ("begin_shift", "transition", "end_shift", "residual", "jacobian", "whitener", "whitened", "norm"),
    ),
    (
        "aids",
        (
            "node", "fold", "instrument", "components", "bare", "value", "noise", "residual", "jacobian", "whitener",
            "whitened", "norm",
        ),
    ),
    ("folds", ("node", "transition", "noise", "shift", "jacobian", "raw_rate")),
    ("folds", _STATE),
    ("folds", tuple(f"now_{name}" for name in _STATE)),
)  # fmt: skip
MOVED = Selection(("nodes", _STATE), ("motions", ("begin_shift", "end_shift")), ("folds", ("node", "shift")))
LEFT = Selection(("nodes", ("predicted", "predicted_shift", "step")), ("aids", ("node",)), ("folds", ("node",)))


@kernel
def _linearise(
    what: int,
    first: int,
    rows: tuple[int, int, int, int, int, int],
    fold_rows: tuple[int, int, int],
    columns: tuple[
        tuple[Matrix, Matrix, Stack, Matrix, Matrix, Matrix],
        tuple[Matrix, Stack, Matrix, Matrix, Stack, Stack, Matrix, Vector],
        tuple[
            IntegerVector,
            IntegerVector,
            IntegerVector,
            IntegerVector,
            IntegerVector,
            Matrix,
            Stack,
            Matrix,
            Stack,
            Stack,
            Matrix,
            Vector,
        ],
        tuple[IntegerVector, Stack, Stack, Matrix, Stack, Matrix],
        tuple[Matrix, Matrix, Stack, Matrix, Matrix],
        tuple[Matrix, Matrix, Stack, Matrix, Matrix],
    ],
    known: tuple[IntegerVector, Matrix, IntegerVector, IntegerVector],
) -> None:
    """Linearise and whiten the factors that have to do with a node or later ones.

    Parameters
    ----------
    what : int
        Sum of `MOTION`, `READINGS` and `REST`: the error of each motion and its derivative; the readings whose equation
        is compiled; for all readings, what a fold adds to their noise, and their derivatives by its node.
    first : int
        The node, counted from the first of the window.
    rows : tuple of int
        Where nodes and factors are in the columns, see `simnav.estimators.algebra.block_tridiagonal.Rows`.
    fold_rows : tuple of int
        Row of the first fold, their number, and the number of the first fold, from which factors count theirs.
    columns : tuple of tuples of arrays
        Whole columns, see `LINEARISED`; of the folds the state as predicted, and as moved by the shift of its node.
    known : tuple of arrays
        Parameters of each instrument, see `simnav.estimators.models.measurements.Aid`.
    """
    nodes, motions, aids, folds, predicted, now = columns
    k0, count, m0, i0, total, base = rows
    fold0, folded, fold_base = fold_rows
    node, fold, instrument, components, bare, value, noise, residual, jacobian, whitener, whitened, norm = aids
    fold_node, fold_transition, fold_noise, fold_shift, fold_jacobian, fold_rate = folds
    codes, arms, bias_at, scale_at = known
    begin_shift, transition, end_shift, error, motion_jacobian, motion_whitener, whitened_error, motion_norm = motions
    position, velocity, dcm, rate, bias, calibration = nodes
    n, begin, end = jacobian.shape[2], i0 + total, i0 + total
    innovation, wide, moved, work = np.empty(3), np.zeros((3, 15)), np.empty(n), np.empty(n)
    while begin > i0 and node[begin - 1] - base >= first:
        begin -= 1
    if what & MOTION:
        for m in range(m0 + max(first - 1, 0), m0 + count - 1):
            move_shift(transition[m], begin_shift[m], moved, motion_jacobian[m])
            relative_shift(end_shift[m], moved, error[m])
            motion_norm[m] = whiten_one(error[m], motion_whitener[m], whitened_error[m])
    if what & READINGS and folded and begin < end:
        at = fold0 + folded
        while at > fold0 and fold_node[at - 1] >= node[begin]:
            at -= 1
        _move_folds(at, fold0 + folded, fold_transition, fold_shift, fold_jacobian, predicted, now)
    for i in range(begin, end):
        s, f = instrument[i], fold0 + fold[i] - fold_base
        if what & READINGS and codes[s] != OWN:
            k = k0 + node[i] - base
            state = State(position[k], velocity[k], dcm[k], rate[k], bias[k], calibration[k])
            if fold[i] >= 0:
                state = State(now[0][f], now[1][f], now[2][f], fold_rate[f], now[3][f], now[4][f])
            d = observe_inertial(
                Aid(codes[s], arms[s], bias_at[s], scale_at[s]), value[i], state, innovation,
                jacobian[i] if n >= 15 else wide,
            )  # fmt: skip
            components[i] = d
            for r in range(3):
                residual[i, r] = innovation[r] if r < d else 0.0
            if n < 15:
                for r in range(3):
                    for c in range(n):
                        jacobian[i, r, c] = wide[r, c]
                        wide[r, c] = 0.0
        if what & REST:
            if fold[i] >= 0:
                if bare[i] != 0:
                    bare[i] = 0
                    add_noise(jacobian[i], components[i], fold_noise[f], noise[i], whitener[i], work)
                through_one(fold_jacobian[f], min(15, n), jacobian[i], work)
            norm[i] = whiten_one(residual[i], whitener[i], whitened[i])


@kernel
def _retract(
    keep: bool,
    rows: tuple[int, int, int, int, int, int],
    fold_rows: tuple[int, int],
    step: Matrix,
    moved: tuple[tuple[Matrix, Matrix, Stack, Matrix, Matrix], tuple[Matrix, Matrix], tuple[IntegerVector, Matrix]],
    prior: tuple[Matrix, Vector],
    stepped: tuple[
        tuple[Matrix, Matrix, Matrix],
        tuple[Stack, Matrix, Stack, Matrix, Vector, Vector],
        tuple[IntegerVector, Stack, Matrix, Stack, Matrix, Vector, Vector],
    ],
) -> float:
    """Move the nodes by a step, in place.

    Parameters
    ----------
    keep : bool
        Whether to do `simnav.estimators.algebra.block_tridiagonal.after_step`.
    rows, fold_rows : tuples of int
        Where nodes and motion factors are in the arrays below, see
        `simnav.estimators.algebra.block_tridiagonal.Rows`; row of the first fold, and number of folds.
    step : (K, n) array
        Corrections, with a rotation vector at 6:9 that turns the attitude from the left; its first row is that of the
        first node.
    moved : tuple of tuples of arrays
        Whole columns, see `MOVED`; all but the numbers of the nodes of folds are updated.
    prior : (n, n) and (n,) arrays
        Whitener of the prior; its mean minus the first node, which is updated.
    stepped : tuple of tuples of arrays
        Whole columns, the last three arguments of `after_step`.

    Returns
    -------
    float
        The cost, or 0 if it is not computed.
    """
    k0, count, m0, _, _, base = rows
    (position, velocity, dcm, bias, calibration), (begin_shift, end_shift), (of_fold, fold_shift) = moved
    n = step.shape[1]
    dx, before = np.zeros(max(n, 15)), np.empty(n)
    for k in range(count):
        row, m = k0 + k, m0 + k
        for j in range(n):
            dx[j] = step[k, j]
        correct_inertial(position[row], velocity[row], dcm[row], bias[row], calibration[row], dx)
        if k < count - 1:
            add_shift(step[k], begin_shift[m], begin_shift[m])
        if k > 0:
            add_shift(step[k], end_shift[m - 1], end_shift[m - 1])
    for i in range(fold_rows[0], fold_rows[0] + fold_rows[1]):
        add_shift(step[of_fold[i] - base], fold_shift[i], fold_shift[i])
    for j in range(n):
        before[j] = prior[1][j]
    relative_shift(before, step[0], prior[1])
    return after_step(rows, prior, stepped[0], stepped[1], stepped[2]) if keep else 0.0


@kernel
def _marginalise(
    leaving: int,
    rows: tuple[int, int, int, int, int, int],
    fold_rows: tuple[int, int],
    columns: tuple[tuple[Stack, Matrix, Matrix], tuple[IntegerVector], tuple[IntegerVector]],
    prior: tuple[Matrix, Vector, Matrix],
) -> tuple[int, int]:
    """Make the prior of the first node that stays from what was predicted for it.

    Parameters
    ----------
    leaving : int
        Number of nodes that leave.
    rows, fold_rows : tuples of int
        As of `_retract`.
    columns : tuple of tuples of arrays
        Whole columns, see `LEFT`.
    prior : (n, n), (n,) and (n, n) arrays
        Covariance, shift, and whitener of the prior; overwritten.

    Returns
    -------
    int, int
        Numbers of aiding factors and of folds that leave with their nodes.
    """
    nodes, (of_aid,), (of_fold,) = columns
    k0, _, _, i0, total, base = rows
    step, mean = nodes[2][k0 + leaving], np.empty(nodes[2].shape[1])
    for j in range(mean.size):
        mean[j] = nodes[1][k0 + leaving, j] + step[j]
    turn_covariance(nodes[0][k0 + leaving], mean, prior[0])
    relative_shift(mean, step, prior[1])
    whitening(prior[0], prior[2])
    aids, folds, first = 0, 0, base + leaving
    while aids < total and of_aid[i0 + aids] < first:
        aids += 1
    while folds < fold_rows[1] and of_fold[fold_rows[0] + folds] < first:
        folds += 1
    return aids, folds


class InertialChain(Chain):
    """The chain of an inertial model.

    Parameters
    ----------
    front : InertialModel
        Of 15 states, with or without calibration states, or the 9-state model.
    """

    coupled = 15
    front: InertialModel

    @property
    def node_arrays(self) -> tuple[str, ...]:
        """As `Chain.node_arrays`: the output of the gyroscopes, and of the accelerometers if a delay needs it."""
        return ("raw_rate", "raw_force") if self.front.delayed else ("raw_rate",)

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """One node, at the start; its covariance. UnsuitableScenario without an IMU."""
        covariance = super().begin(start, instruments)
        front = self.front
        nothing = Aid(0, np.zeros(3), -1, -1)
        known = [front.aid_parameters.get(name, nothing) for name in self.names]
        self._known = (
            np.array([OWN if name in front.own else code for name, (code, *_) in zip(self.names, known)], np.int64),
            np.array([arm for _, arm, _, _ in known], dtype=np.float64).reshape(-1, 3),
            np.array([at for *_, at, _ in known], dtype=np.int64),
            np.array([at for *_, at in known], dtype=np.int64),
        )
        self._dynamics = None if front.functions() is None else front.dynamics(covariance, self.names)
        self._readings = ReadingsOfSteps(dict.fromkeys(self.names, 0))
        return covariance

    def take(self, measurements: Sequence[Measurement], until: float, spacing: float) -> tuple[int, int] | None:
        """As `Chain.take`, if no instrument has an equation or a clock of its own."""
        nodes, motions, aids, folds = self.nodes, self.motions, self.aids, self.folds
        count, dynamics = len(measurements), self._dynamics
        if dynamics is None or count > aids.free:
            return None
        for columns in (nodes, motions, folds):
            columns.reserve(count)
        self.ahead, (new, attached, folded, unused) = take_inertial.unchecked(
            dynamics, self.front.samples, self._readings.fill(measurements), count, (until, spacing, self.ahead),
            (self._transition, self._noise),
            (
                nodes.last, motions.last, aids.last, folds.last, self.base + len(nodes) - 1,
                self.fold_base + len(folds), len(folds),
            ),
            self.whole(TAKEN),
        )  # fmt: skip
        for columns, rows in ((nodes, new), (motions, new), (aids, attached), (folds, folded)):
            if rows:
                columns.grow(rows)
        return attached, unused

    def linearise_from(self, node: int = 0) -> None:
        """As `Chain.linearise_from` (equations in the module)."""
        if not self.front.own:
            self._compute(EVERYTHING, node)
            return
        self._compute(MOTION | READINGS, node)
        self._observe_own(self.first_aid(node))
        self._compute(REST, node)

    def linearise_motion(self, node: int = 0) -> None:
        """As `Chain.linearise_motion`."""
        self._compute(MOTION, node)

    def linearise_aids(self, node: int = 0) -> None:
        """As `Chain.linearise_aids`."""
        self._compute(READINGS, node)
        if self.front.own:
            self._observe_own(self.first_aid(node))
        self._compute(REST, node)

    def _compute(self, what: int, node: int) -> None:
        folds = self.folds
        _linearise.unchecked(
            what, node, self.rows, (folds.first, folds.last - folds.first, self.fold_base), self.whole(LINEARISED),
            self._known,
        )  # fmt: skip

    def _observe_own(self, first: int) -> None:
        """The readings from an index on whose kind has a measurement equation of its own."""
        aids = self.aids
        for row, states, prefix in self.places(first):
            self.observe(first, row, states, prefix, aids["jacobian"])

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`, for readings whose kind has a measurement equation of its own."""
        wide = jacobian if self.size >= 15 else np.zeros((len(jacobian), 3, 15))
        position, velocity, dcm, bias, calibration = (states[prefix + name] for name in self.front.state)
        arrays = [states[name] for name in self.node_arrays]
        inertial = arrays[0] if len(arrays) == 1 else np.hstack(arrays)
        self.observe_own(first, row, wide, position, velocity, dcm, inertial, bias, calibration)
        if wide is not jacobian:
            own = self._known[0][self.aids["instrument"][first:]] == OWN
            here = np.flatnonzero((row[first:] >= 0) & own) + first
            jacobian[here] = wide[here, :, : self.size]

    def retract(self, step: Array) -> None:
        """As `Chain.retract`."""
        self._move(False, step)

    def take_step(self) -> float:
        """As `Chain.take_step`."""
        return self._move(True, self.nodes["step"])

    def _move(self, keep: bool, step: Array) -> float:
        folds = self.folds
        cost: float = _retract.unchecked(
            keep, self.rows, (folds.first, folds.last - folds.first), step, self.whole(MOVED),
            (self.prior_whitener, self.prior_shift), self.whole(STEPPED),
        )  # fmt: skip
        return cost

    def marginalise(self, count: int) -> None:
        """As `Chain.marginalise`."""
        aids, folds = _marginalise.unchecked(
            count, self.rows, (self.folds.first, len(self.folds)), self.whole(LEFT),
            (self.prior, self.prior_shift, self.prior_whitener),
        )  # fmt: skip
        self._leave(count, aids, folds)

    def along_motion(self, step: Array) -> Array:
        """As `Chain.along_motion`."""
        m, along = self.motions, np.empty_like(step)
        _along_motion.unchecked(
            m["transition"], m["jacobian"], m["residual"], m["begin_shift"], m["end_shift"], step, along
        )  # fmt: skip
        return along

    def turned(self, covariance: Array, shift: Array) -> Array:
        """``J P J'`` with the left Jacobian of the rotation (`simnav.geometry.rotation.left_jacobian`)."""
        turned = np.empty_like(covariance)
        turn_covariance.unchecked(covariance, shift, turned)
        return turned

    def relative_shift(self, shift: Array, step: Array) -> Array:
        """Rotations compose."""
        rest = np.empty_like(shift)
        relative_shift.unchecked(shift, step, rest)
        return rest


@chain_of.register
def _(model: InertialModel) -> Chain:
    return InertialChain(model)
