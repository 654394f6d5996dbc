"""The chain of the inertial model: preintegrated IMU factors, and all aids of a window linearised at once.

Between two nodes the front integrated the IMU samples from the state x' to y', and computed the transition matrix F.
From another node x, with the shift ``s = x - x'`` (rotation phi, biases b), the same samples lead to ``f(x) = y' + F s
+ c``. c is the effect of the rotation of the increments beyond the first order. With ``E = exp(phi x)`` and the vectors
u_p, u_v of the double and single integral of the specific force in north-east-down, which are part of F (its block of
the attitude is ``-[u x]``),

- ``c_p = (E - 1 - phi x) u_p + (E - 1) F_pb b``, and c_v likewise with u_v and F_vb; the derivative by the attitude
  is ``-[E (u_p + F_pb b) x]``
- attitude: the rotation vector of ``exp(F_phi,phi phi) exp(F_phi,b b)``

F and its bias columns turn with the node (``F_pb = C B`` with B in body axes): these are the body-frame increments and
bias Jacobians of preintegration (Forster et al. 2017, eqs. 38-44; eqs. 8-10 of Mao, Wang and Fu 2025, but with gravity
outside of the integral). Curvature and rotation of the Earth are in y' and in F, to first order in the shift.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.estimators.algebra.block_tridiagonal import ROWS, Rows, error_after_step, whiten_one
from simnav.estimators.algebra.whitening import whitening
from simnav.geometry.rotation import cross, rotated, rotation_coefficients
from simnav.types import Array, InitialState, Instruments, Integers, Measurement

from .chain import Chain, chain_of
from .columns import Columns
from .folds import add_noise, through_one
from .inertial import InertialModel
from .inertial_step import Packet
from .inertial_take import AID_COLUMNS, FOLD_COLUMNS, KEPT, MOTION_COLUMNS, take_inertial
from .measurements import OWN, observe_inertial
from .propagation import correct_inertial

__all__ = ["InertialChain"]

#: Rotations below this are composed by a series [rad].
SERIES_ANGLE = 0.014


@kernel()
def _compose(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> tuple[float, float, float]:
    """Rotation vector of ``exp(a x) exp(b x)``.

    A series of third order (Baker, Campbell, Hausdorff) below `SERIES_ANGLE`, where it is good to 2e-9 rad; the product
    of the quaternions above it.
    """
    a, b = a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2
    x0, x1, x2 = cross(a0, a1, a2, b0, b1, b2)
    if a + b < SERIES_ANGLE * SERIES_ANGLE:
        y0, y1, y2 = cross(a0 - b0, a1 - b1, a2 - b2, x0, x1, x2)
        t = 1.0 / 12.0
        return a0 + b0 + 0.5 * x0 + t * y0, a1 + b1 + 0.5 * x1 + t * y1, a2 + b2 + 0.5 * x2 + t * y2
    # sin(x/2)/x and cos(x/2) of both angles
    p, _ = rotation_coefficients(0.25 * a)
    q, _ = rotation_coefficients(0.25 * b)
    p, q, c, d = 0.5 * p, 0.5 * q, cos(0.5 * sqrt(a)), cos(0.5 * sqrt(b))
    w = c * d - p * q * (a0 * b0 + a1 * b1 + a2 * b2)
    v0 = p * d * a0 + c * q * b0 + p * q * x0
    v1 = p * d * a1 + c * q * b1 + p * q * x1
    v2 = p * d * a2 + c * q * b2 + p * q * x2
    sine = sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    if w < 0.0:  # the shorter way round
        w, v0, v1, v2 = -w, -v0, -v1, -v2
    ratio = 2.0 if sine < 1e-12 else 2.0 * atan2(sine, w) / sine
    return ratio * v0, ratio * v1, ratio * v2


@kernel()
def _move(F: Array, s: Array, moved: Array, J: Array) -> None:
    """Propagate a shift s of a node through a motion: the shift ``moved`` at its end, and its derivative J.

    The equations are those of the module. J must hold F, or the result of an earlier call: only the rows of position,
    velocity and attitude and the columns of attitude and biases depend on the shift. Biases and calibration states are
    independent and only decay; a clock's bias also moves by the drift that follows it.
    """
    n = s.size
    m = min(n, 15)
    for i in range(9):
        x = 0.0
        for j in range(m):
            x += F[i, j] * s[j]
        moved[i] = x
        for j in range(6, m):
            J[i, j] = F[i, j]
    for i in range(9, n):
        moved[i] = F[i, i] * s[i]
        if i >= 15 and i + 1 < n and F[i, i + 1] != 0.0:
            moved[i] += F[i, i + 1] * s[i + 1]
    p0, p1, p2 = s[6], s[7], s[8]
    size = p0 * p0 + p1 * p1 + p2 * p2
    if n >= 15:
        for j in range(9, 15):
            size += s[j] * s[j]
    if size <= 1e-24:
        return
    a, b = rotation_coefficients(p0 * p0 + p1 * p1 + p2 * p2)
    if n >= 15:  # the bias columns turn with the attitude
        for j in range(9, 15):
            for i in range(0, 9, 3):
                J[i, j], J[i + 1, j], J[i + 2, j] = rotated(p0, p1, p2, a, b, F[i, j], F[i + 1, j], F[i + 2, j])
    for i in range(0, 6, 3):
        u0 = 0.5 * (F[i + 1, 8] - F[i + 2, 7])
        u1 = 0.5 * (F[i + 2, 6] - F[i, 8])
        u2 = 0.5 * (F[i, 7] - F[i + 1, 6])
        # E (u + F_b b) - u: what the bias shift adds turns with the node, so the attitude has a share in it.
        w0, w1, w2 = rotated(p0, p1, p2, a, b, u0, u1, u2)
        w0, w1, w2 = w0 - u0, w1 - u1, w2 - u2
        x0, x1, x2 = cross(p0, p1, p2, u0, u1, u2)
        moved[i] += w0 - x0
        moved[i + 1] += w1 - x1
        moved[i + 2] += w2 - x2
        if n >= 15:
            for j in range(9, 15):
                for r in range(3):
                    moved[i + r] += (J[i + r, j] - F[i + r, j]) * s[j]
                w0 += J[i, j] * s[j]
                w1 += J[i + 1, j] * s[j]
                w2 += J[i + 2, j] * s[j]
        J[i, 7] += w2
        J[i, 8] -= w1
        J[i + 1, 6] -= w2
        J[i + 1, 8] += w0
        J[i + 2, 6] += w1
        J[i + 2, 7] -= w0
    a0, a1, a2 = moved[6], moved[7], moved[8]
    b0, b1, b2 = 0.0, 0.0, 0.0
    if n >= 15:
        for j in range(9, 15):
            b0 += F[6, j] * s[j]
            b1 += F[7, j] * s[j]
            b2 += F[8, j] * s[j]
        a0, a1, a2 = a0 - b0, a1 - b1, a2 - b2
        h0, h1, h2 = rotated(p0, p1, p2, a, b, 0.5 * b0, 0.5 * b1, 0.5 * b2)
        for j in range(9, 12):  # the left Jacobian of exp(b x), to first order
            x0, x1, x2 = cross(h0, h1, h2, J[6, j], J[7, j], J[8, j])
            J[6, j] += x0
            J[7, j] += x1
            J[8, j] += x2
    moved[6], moved[7], moved[8] = _compose(a0, a1, a2, b0, b1, b2)


@kernel("void(f8[::1], f8[::1], f8[::1])")
def _relative_shift(shift: Array, step: Array, out: Array) -> None:
    """A shift as seen from where a step leads: rotations compose."""
    for j in range(shift.size):
        out[j] = shift[j] - step[j]
    out[6], out[7], out[8] = _compose(shift[6], shift[7], shift[8], -step[6], -step[7], -step[8])


@kernel()
def _add(step: Array, shift: Array, out: Array) -> None:
    """A shift and a step after it."""
    for j in range(shift.size):
        out[j] = shift[j] + step[j]
    out[6], out[7], out[8] = _compose(step[6], step[7], step[8], shift[6], shift[7], shift[8])


@kernel()
def _add_to(shift: Array, step: Array) -> None:
    """Add a step to a shift."""
    r0, r1, r2 = _compose(step[6], step[7], step[8], shift[6], shift[7], shift[8])
    for j in range(shift.size):
        shift[j] += step[j]
    shift[6], shift[7], shift[8] = r0, r1, r2


@kernel("void(f8[:, ::1], f8[::1], f8[:, ::1])")
def _turn_covariance(P: Array, shift: Array, out: Array) -> None:
    p0, p1, p2 = shift[6], shift[7], shift[8]
    angle2 = p0 * p0 + p1 * p1 + p2 * p2
    sine, a = rotation_coefficients(angle2)
    b = 1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 / 5040.0) if angle2 < 1e-3 else (1.0 - sine) / angle2
    n = P.shape[0]
    out[:] = P
    for side in range(2):
        for i in range(n):
            v0, v1, v2 = (out[6, i], out[7, i], out[8, i]) if side == 0 else (out[i, 6], out[i, 7], out[i, 8])
            v0, v1, v2 = rotated(p0, p1, p2, a, b, v0, v1, v2)  # with the coefficients of the left Jacobian
            if side == 0:
                out[6, i], out[7, i], out[8, i] = v0, v1, v2
            else:
                out[i, 6], out[i, 7], out[i, 8] = v0, v1, v2


@kernel("void(f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def _along_motion(
    transition: Array, jacobian: Array, residual: Array, begin_shift: Array, end_shift: Array, step: Array, along: Array
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
        _add(along[k], begin_shift[k], shift)
        _move(transition[k], shift, moved, J)
        _add(error, moved, shift)
        _relative_shift(shift, end_shift[k], along[k + 1])


@kernel()
def _linearise_motion(
    first: int, begin_shift: Array, transition: Array, end_shift: Array, residual: Array, jacobian: Array,
    whitener: Array, whitened: Array, norm: Array,
) -> None:  # fmt: skip
    """Residual and derivative of the motion factors from a row on; see `_linearise`."""
    moved = np.empty(begin_shift.shape[1])
    for k in range(first, begin_shift.shape[0]):
        _move(transition[k], begin_shift[k], moved, jacobian[k])
        _relative_shift(end_shift[k], moved, residual[k])
        norm[k] = whiten_one(residual[k], whitener[k], whitened[k])


@kernel()
def _move_folds(
    first: int,
    transition: Array,
    shift: Array,
    predicted: tuple[Array, ...],
    now: tuple[Array, ...],
    jacobian: Array,
    dx: Array,
) -> None:
    """States of folds from a row on, where their nodes' shifts lead, and their derivatives; ``dx`` is work space."""
    position, velocity, dcm, bias, calibration = now
    moved = np.empty(shift.shape[1])
    for k in range(first, shift.shape[0]):
        for i in range(3):
            position[k, i], velocity[k, i] = predicted[0][k, i], predicted[1][k, i]
            for j in range(3):
                dcm[k, i, j] = predicted[2][k, i, j]
        for i in range(6):
            bias[k, i] = predicted[3][k, i]
        for i in range(calibration.shape[1]):
            calibration[k, i] = predicted[4][k, i]
        _move(transition[k], shift[k], moved, jacobian[k])
        for j in range(moved.size):
            dx[j] = moved[j]
        correct_inertial(position[k], velocity[k], dcm[k], bias[k], calibration[k], dx)


#: What `_linearise` is to do: motion factors; readings that it predicts itself; what follows for all readings.
MOTION, READINGS, REST = 1, 2, 4
EVERYTHING = MOTION | READINGS | REST

_STATES = "Tuple((f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1]))"
_NODE_STATES = "Tuple((f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1]))"
NODE_STATES = ("position", "velocity", "dcm", "raw_rate", "bias", "calibration")
STATE = ("position", "velocity", "dcm", "bias", "calibration")
NOW = tuple(f"now_{name}" for name in STATE)
MOTIONS = ("begin_shift", "transition", "end_shift", "residual", "jacobian", "whitener", "whitened", "norm")
AIDS = (
    "node", "fold", "instrument", "components", "bare", "value", "noise", "residual", "jacobian", "whitener",
    "whitened", "norm",
)  # fmt: skip
FOLDS = ("node", "transition", "noise", "shift", "jacobian", "raw_rate")
SHIFTS, FOLD_SHIFT = ("begin_shift", "end_shift"), ("node", "shift")
MARGINAL = ("predicted", "predicted_shift", "step")


@kernel(
    f"void(i8, i8, {ROWS}, UniTuple(i8, 3), {_NODE_STATES}, "
    "Tuple((f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[::1])), "
    "Tuple((i8[::1], i8[::1], i8[::1], i8[::1], i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, :, ::1], "
    "f8[:, :, ::1], f8[:, ::1], f8[::1])), "
    "Tuple((i8[::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1])), "
    f"{_STATES}, {_STATES}, Tuple((i8[::1], f8[:, ::1], i8[::1], i8[::1])))"
)
def _linearise(
    what: int, first: int, rows: Rows, fold_rows: tuple[int, int, int], nodes: tuple[Array, ...],
    motions: tuple[Array, ...], aids: tuple[Any, ...], folds: tuple[Any, ...], predicted: tuple[Array, ...],
    now: tuple[Array, ...], known: tuple[Integers, Array, Integers, Integers],
) -> None:  # fmt: skip
    """Linearise and whiten the factors that have to do with a node or later ones.

    Parameters
    ----------
    what : int
        Sum of `MOTION`, `READINGS` and `REST`: the error of each motion and its derivative; the readings whose equation
        is compiled; for all readings, what a fold adds to their noise, and their derivatives by its node.
    first : int
        The node, counted from the first of the window.
    rows : tuple of int
        Where nodes and factors are in the arrays below, see `simnav.estimators.algebra.block_tridiagonal.Rows`.
    fold_rows : tuple of int
        Row of the first fold, their number, and the number of the first fold, from which factors count theirs.
    nodes, motions, aids, folds, predicted, now : tuples of arrays
        Whole columns of `Chain`: `NODE_STATES`; `MOTIONS`; `AIDS`; `FOLDS`; and of the folds the state as predicted and
        as moved by the shift of its node.
    known : tuple of arrays
        Parameters of each instrument, see `simnav.estimators.models.measurements.Aid`.
    """
    k0, count, m0, i0, total, base = rows
    n = motions[4].shape[1]
    if what & MOTION:
        m1 = m0 + count - 1
        _linearise_motion(
            max(first - 1, 0), motions[0][m0:m1], motions[1][m0:m1], motions[2][m0:m1], motions[3][m0:m1],
            motions[4][m0:m1], motions[5][m0:m1], motions[6][m0:m1], motions[7][m0:m1],
        )  # fmt: skip
    node, fold, instrument, components, bare, value, noise, residual, jacobian, whitener, whitened, norm = aids
    codes, arms, bias_at, scale_at = known
    fold0, folds_count, fold_base = fold_rows
    i1 = i0 + total
    begin = i1
    while begin > i0 and node[begin - 1] - base >= first:
        begin -= 1
    if what & READINGS and folds_count and begin < i1:
        f1 = fold0 + folds_count
        at = f1
        while at > fold0 and folds[0][at - 1] >= node[begin]:
            at -= 1
        dx = np.zeros(15 + now[4].shape[1])
        _move_folds(
            at - fold0,
            folds[1][fold0:f1],
            folds[3][fold0:f1],
            (
                predicted[0][fold0:f1],
                predicted[1][fold0:f1],
                predicted[2][fold0:f1],
                predicted[3][fold0:f1],
                predicted[4][fold0:f1],
            ),
            (now[0][fold0:f1], now[1][fold0:f1], now[2][fold0:f1], now[3][fold0:f1], now[4][fold0:f1]),
            folds[4][fold0:f1],
            dx,
        )
    innovation, wide, work = np.empty(3), np.zeros((3, 15)), np.empty(n)
    for i in range(begin, i1):
        s, at_fold = instrument[i], fold[i] >= 0
        f = fold0 + fold[i] - fold_base
        if what & READINGS and codes[s] != OWN:
            J = jacobian[i] if n >= 15 else wide
            aid = codes[s], arms[s], bias_at[s], scale_at[s]
            if at_fold:
                d = observe_inertial(
                    aid, value[i], (now[0][f], now[1][f], now[2][f], folds[5][f], now[3][f], now[4][f]), innovation, J
                )
            else:
                k = k0 + node[i] - base
                d = observe_inertial(
                    aid, value[i], (nodes[0][k], nodes[1][k], nodes[2][k], nodes[3][k], nodes[4][k], nodes[5][k]),
                    innovation, J,
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
            if at_fold:
                if bare[i] != 0:
                    bare[i] = 0
                    add_noise(jacobian[i], components[i], folds[2][f], noise[i], whitener[i], work)
                through_one(folds[4][f], min(15, n), jacobian[i], work)
            norm[i] = whiten_one(residual[i], whitener[i], whitened[i])


@kernel(
    f"void({ROWS}, UniTuple(i8, 2), f8[:, ::1], {_STATES}, UniTuple(f8[:, ::1], 2), Tuple((i8[::1], f8[:, ::1])), "
    "f8[::1])"
)
def _retract(
    rows: Rows, fold_rows: tuple[int, int], step: Array, states: tuple[Array, ...], shifts: tuple[Array, Array],
    folds: tuple[Integers, Array], prior_shift: Array,
) -> None:  # fmt: skip
    """Move the nodes by a step, in place.

    Parameters
    ----------
    rows, fold_rows : tuples of int
        Where nodes and motion factors are in the arrays below, see
        `simnav.estimators.algebra.block_tridiagonal.Rows`; row of the first fold, and number of folds.
    step : (K, n) array
        Corrections, with a rotation vector at 6:9 that turns the attitude from the left; its first row is that of the
        first node.
    states : tuple of arrays
        Whole columns: position, velocity, rotation, biases and calibration of the nodes; updated.
    shifts : two arrays
        Whole columns: by how much the nodes at both ends of each motion have been moved; updated.
    folds : tuple of arrays
        Whole columns: numbers of the nodes of the folds, and by how much these have been moved, which is updated.
    prior_shift : (n,) array
        Mean of the prior minus the first node; updated.
    """
    k0, count, m0, _, _, base = rows
    position, velocity, dcm, bias, calibration = states
    begin_shift, end_shift = shifts
    of_fold, fold_shift = folds
    n = step.shape[1]
    dx, before = np.zeros(max(n, 15)), np.empty(n)
    for k in range(count):
        row, m = k0 + k, m0 + k
        for j in range(n):
            dx[j] = step[k, j]
        correct_inertial(position[row], velocity[row], dcm[row], bias[row], calibration[row], dx)
        if k < count - 1:
            _add_to(begin_shift[m], step[k])
        if k > 0:
            _add_to(end_shift[m - 1], step[k])
    for i in range(fold_rows[0], fold_rows[0] + fold_rows[1]):
        _add_to(fold_shift[i], step[of_fold[i] - base])
    before[:] = prior_shift
    _relative_shift(before, step[0], prior_shift)


@kernel("void(f8[:, ::1], f8[::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def _marginalise(
    covariance: Array, shift: Array, step: Array, prior: Array, prior_shift: Array, whitener: Array
) -> None:
    """Make the prior of a node from what was predicted for it: covariance, and shift before its last step.

    ``prior`` (n, n), ``prior_shift`` (n,) and ``whitener`` (n, n) are overwritten.
    """
    mean = shift + step
    _turn_covariance(covariance, mean, prior)
    _relative_shift(mean, step, prior_shift)
    whitening(prior, whitener)


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
        nothing = (0, np.zeros(3), -1, -1)
        known = [front.aid_parameters.get(name, nothing) for name in self.names]
        self._known = (
            np.array([OWN if name in front.own else code for name, (code, *_) in zip(self.names, known)], np.int64),
            np.array([arm for _, arm, _, _ in known], dtype=np.float64).reshape(-1, 3),
            np.array([at for *_, at, _ in known], dtype=np.int64),
            np.array([at for *_, at in known], dtype=np.int64),
        )
        table = front.step_table(self.names)
        self._packet = None if table is None else Packet(self.names, table)
        return covariance

    def take(self, measurements: Sequence[Measurement], until: float, spacing: float) -> tuple[int, int] | None:
        """As `Chain.take`, if no instrument has an equation or a clock of its own."""
        nodes, motions, aids, folds = self.nodes, self.motions, self.aids, self.folds
        count, packet, front = len(measurements), self._packet, self.front
        if packet is None or count > aids.free:
            return None
        for columns in (nodes, motions, folds):
            columns.reserve(count)
        state, samples, first, noise, others = front.carried()
        first, self.ahead, (new, attached, folded, unused) = take_inertial.unchecked(
            state, samples, first, (until, spacing, self.ahead), noise,
            (front.transition, front.process_noise, self._transition, self._noise), others,
            (packet.aids, packet.fill(measurements)),
            (
                nodes.last, motions.last, aids.last, folds.last, self.base + len(nodes) - 1,
                self.fold_base + len(folds), len(folds),
            ),
            (
                nodes.whole(KEPT), motions.whole(MOTION_COLUMNS), aids.whole(AID_COLUMNS), folds.whole(FOLD_COLUMNS),
                folds.whole(KEPT),
            ),
        )  # fmt: skip
        front.arrived(first)
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
            what, node, self.rows, (folds.first, len(folds), self.fold_base), self.nodes.whole(NODE_STATES),
            self.motions.whole(MOTIONS), self.aids.whole(AIDS), folds.whole(FOLDS), folds.whole(STATE),
            folds.whole(NOW), self._known,
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
        folds = self.folds
        _retract.unchecked(
            self.rows, (folds.first, len(folds)), step, self.nodes.whole(STATE), self.motions.whole(SHIFTS),
            folds.whole(FOLD_SHIFT), self.prior_shift,
        )  # fmt: skip

    def marginalise(self, count: int) -> None:
        """As `Chain.marginalise`."""
        row = self.nodes.first + count
        covariance, shift, step = (column[row] for column in self.nodes.whole(MARGINAL))
        _marginalise.unchecked(covariance, shift, step, self.prior, self.prior_shift, self.prior_whitener)
        self.drop(count)

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
        _turn_covariance.unchecked(covariance, shift, turned)
        return turned

    def relative_shift(self, shift: Array, step: Array) -> Array:
        """Rotations compose."""
        rest = np.empty_like(shift)
        _relative_shift.unchecked(shift, step, rest)
        return rest


@chain_of.register
def _(model: InertialModel) -> Chain:
    return InertialChain(model)
