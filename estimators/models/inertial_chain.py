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

from math import atan2, cos, sqrt

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.estimators.algebra.block_tridiagonal import error_after_step
from simnav.geometry.rotation import cross, rotated, rotation_coefficients
from simnav.types import Array, InitialState, Instruments, Integers

from .chain import Chain, chain_of
from .columns import Columns
from .inertial import InertialModel
from .measurements import State, observe_inertial
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


@kernel("void(i8, f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1])")
def _linearise_motion(
    first: int, transition: Array, begin_shift: Array, end_shift: Array, residual: Array, jacobian: Array
) -> None:
    """Residual and derivative of the motion factors from a row on.

    Parameters
    ----------
    first : int
        Index of the first factor that is computed.
    transition : (K, n, n) array
        Transition matrix F of each motion, along the predicted trajectory.
    begin_shift, end_shift : (K, n) arrays
        Shifts of the nodes at both ends since the prediction.
    residual : (K, n) array
        Overwritten with the newer node minus its prediction from the older one.
    jacobian : (K, n, n) array
        Overwritten with the derivative of the prediction with respect to the older node.
    """
    count, n = begin_shift.shape
    moved = np.empty(n)
    for k in range(first, count):
        _move(transition[k], begin_shift[k], moved, jacobian[k])
        _relative_shift(end_shift[k], moved, residual[k])


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


@kernel(
    "void(i8, Tuple((i8[::1], i8[::1], f8[:, ::1])), Tuple((i8[::1], f8[:, ::1], i8[::1], i8[::1])), "
    "Tuple((f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])), f8[:, ::1], f8[:, :, ::1], "
    "i8[::1])"
)
def _linearise_aids(
    first: int, measured: tuple[Integers, Integers, Array], aids: tuple[Integers, Array, Integers, Integers],
    states: State, residual: Array, jacobian: Array, components: Integers,
) -> None:  # fmt: skip
    """Residuals and derivatives of M measurements at the K states that they are attached to.

    Parameters
    ----------
    first : int
        Index of the first measurement that is computed.
    measured : (M,) int, (M,) int and (M, 3) arrays
        Number of the state of each measurement (-1: none of these states); number of its instrument; its value.
    aids : tuple of arrays
        Parameters of each instrument, see `simnav.estimators.models.measurements.Aid`.
    states : tuple of (K, ...) arrays
        The states, see `simnav.estimators.models.measurements.State`.
    residual : (M, 3) array
        Overwritten: measured minus predicted.
    jacobian : (M, 3, n) array
        Overwritten: derivative of the prediction with respect to the state's error.
    components : (M,) int array
        Overwritten: components that count; 0 where the state has no such measurement.
    """
    row, instrument, value = measured
    codes, arms, bias_at, scale_at = aids
    position, velocity, dcm, rate, bias, calibration = states
    innovation = np.empty(3)
    for i in range(first, row.size):
        k, s = row[i], instrument[i]
        if k < 0:
            continue
        components[i] = observe_inertial(
            (codes[s], arms[s], bias_at[s], scale_at[s]), value[i],
            (position[k], velocity[k], dcm[k], rate[k], bias[k], calibration[k]), innovation, jacobian[i],
        )  # fmt: skip
        for r in range(3):
            residual[i, r] = innovation[r] if r < components[i] else 0.0


@kernel(
    "void(i8, f8[:, :, ::1], f8[:, ::1], Tuple((f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1])), "
    "f8[:, :, ::1])"
)
def _move_folds(
    first: int, transition: Array, shift: Array, states: tuple[Array, Array, Array, Array, Array], jacobian: Array
) -> None:
    """Correct the states of folds by where their nodes' shifts lead, in place.

    Parameters
    ----------
    first : int
        Fold to begin with.
    transition : (K, n, n) array
        Phi from each node to the time of its fold.
    shift : (K, n) array
        By how much the node has been moved since the fold was predicted.
    states : tuple of (K, ...) arrays
        Position, velocity, rotation, biases and calibration at the folds; updated.
    jacobian : (K, n, n) array
        Overwritten: derivative of the fold's state with respect to the node.
    """
    position, velocity, dcm, bias, calibration = states
    count, n = shift.shape
    moved, dx = np.empty(n), np.zeros(15 + calibration.shape[1])
    for k in range(first, count):
        _move(transition[k], shift[k], moved, jacobian[k])
        for j in range(n):
            dx[j] = moved[j]
        correct_inertial(position[k], velocity[k], dcm[k], bias[k], calibration[k], dx)


@kernel("void(f8[:, ::1], i8[::1], i8, f8[:, ::1])")
def _retract_folds(step: Array, node: Integers, base: int, shift: Array) -> None:
    for i in range(node.size):
        _add(step[node[i] - base], shift[i].copy(), shift[i])


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def _retract(
    step: Array, position: Array, velocity: Array, dcm: Array, bias: Array, calibration: Array, begin_shift: Array,
    end_shift: Array,
) -> None:  # fmt: skip
    """Move the nodes by a step, in place.

    Parameters
    ----------
    step : (K, n) array
        Corrections, with a rotation vector at 6:9 that turns the attitude from the left.
    position, velocity, dcm, bias, calibration : (K, ...) arrays
        States of the nodes; updated.
    begin_shift, end_shift : (K - 1, n) arrays
        By how much the nodes at both ends of each motion have been moved; updated.
    """
    count, n = step.shape
    dx = np.zeros(max(n, 15))
    for k in range(count):
        for j in range(n):
            dx[j] = step[k, j]
        correct_inertial(position[k], velocity[k], dcm[k], bias[k], calibration[k], dx)
        for side in range(2):
            if (side == 0 and k == count - 1) or (side == 1 and k == 0):
                continue
            shift = begin_shift[k] if side == 0 else end_shift[k - 1]
            r0, r1, r2 = _compose(dx[6], dx[7], dx[8], shift[6], shift[7], shift[8])
            for j in range(n):
                shift[j] += dx[j]
            shift[6], shift[7], shift[8] = r0, r1, r2


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
        # The compiled loop leaves out what has an equation of its own.
        self._own = np.array([name in front.own for name in self.names], dtype=bool)
        known = [nothing if name in front.own else front.aid_parameters.get(name, nothing) for name in self.names]
        self._known = (
            np.array([code for code, *_ in known], dtype=np.int64),
            np.array([arm for _, arm, _, _ in known], dtype=np.float64).reshape(-1, 3),
            np.array([at for *_, at, _ in known], dtype=np.int64),
            np.array([at for *_, at in known], dtype=np.int64),
        )
        return covariance

    def linearise_motion(self, first: int = 0) -> None:
        """As `Chain.linearise_motion` (equations in the module)."""
        m = self.motions
        _linearise_motion.unchecked(
            first, m["transition"], m["begin_shift"], m["end_shift"], m["residual"], m["jacobian"]
        )

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`."""
        aids = self.aids
        wide = jacobian if self.size >= 15 else np.zeros((len(aids), 3, 15))
        position, velocity, dcm, bias, calibration = (states[prefix + name] for name in self.front.state)
        compiled = np.where(self._own[aids["instrument"]], -1, row) if self.front.own else row
        _linearise_aids.unchecked(
            first, (compiled, aids["instrument"], aids["value"]), self._known,
            (position, velocity, dcm, states["raw_rate"], bias, calibration), aids["residual"], wide,
            aids["components"],
        )  # fmt: skip
        if self.front.own:
            arrays = [states[name] for name in self.node_arrays]
            inertial = arrays[0] if len(arrays) == 1 else np.hstack(arrays)
            self.observe_own(first, row, wide, position, velocity, dcm, inertial, bias, calibration)
        if wide is not jacobian:
            here = np.flatnonzero(row[first:] >= 0) + first
            jacobian[here] = wide[here, :, : self.size]

    def move_folds(self, first: int) -> None:
        """As `Chain.move_folds`."""
        folds, names = self.folds, self.front.state
        for name in names:
            folds[f"now_{name}"][first:] = folds[name][first:]
        position, velocity, dcm, bias, calibration = (folds[f"now_{name}"] for name in names)
        states = position, velocity, dcm, bias, calibration
        _move_folds.unchecked(first, folds["transition"], folds["shift"], states, folds["jacobian"])

    def retract(self, step: Array) -> None:
        """As `Chain.retract`."""
        nodes, m = self.nodes, self.motions
        _retract.unchecked(
            step, nodes["position"], nodes["velocity"], nodes["dcm"], nodes["bias"], nodes["calibration"],
            m["begin_shift"], m["end_shift"],
        )  # fmt: skip
        if len(self.folds):
            _retract_folds.unchecked(step, self.folds["node"], self.base, self.folds["shift"])
        self.prior_shift = self.relative_shift(self.prior_shift, step[0])

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
