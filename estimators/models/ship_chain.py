"""The chain of the ship model: dead-reckoning factors between the nodes, and all aids of a window linearised at once.

No preintegration is needed. The motion has a closed form, and a motion factor is the propagation of the model from the
present state of the older node: it is exact for any shift of the node. Its noise is that of the propagation of the
front.

In the terms of Jiang et al. (2026), section 2: the part of a motion factor for position and heading is the DR factor of
the paper, the Gauss-Markov transition of log and compass biases its DR error factor (eqs. 4-6, a random walk), and the
prior of the first node its marginalization factor (eqs. 12-17).
"""

from __future__ import annotations

from math import atan2, cos, sin

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.estimators.algebra.block_tridiagonal import error_after_step
from simnav.geometry.earth import radii_scalar
from simnav.types import Array, InitialState, Instruments, Integers

from .chain import Chain, Columns, chain_of
from .ship import ShipModel
from .ship_kernels import (
    VELOCITY,
    E,
    N,
    correct_ship,
    decay_of,
    fill_jacobian,
    residual_of,
    sail_step,
    set_identity,
    steps_of,
)

__all__ = ["ShipChain"]


@kernel("void(i8, f8[::1], f8[:, ::1], f8[:, ::1], f8[::1], f8, f8[:, ::1], f8[:, :, ::1])")
def _linearise_motion(
    first: int, time: Array, position: Array, x: Array, rate: Array, turn_time: float, residual: Array, jacobian: Array
) -> None:
    """Residual and derivative of the motion factors from a row on.

    Parameters
    ----------
    first : int
        Index of the first factor that is computed.
    time : (K + 1,) array
        Times of the nodes [s].
    position, x : (K + 1, 3), (K + 1, n) arrays
        States of the nodes (see `simnav.estimators.models.ship_kernels`).
    rate : (n,) array
        Rates of decay of the states [1/s].
    turn_time : float
        Correlation time of the turn rate [s].
    residual : (K, n) array
        Overwritten with the newer node minus its prediction from the older one.
    jacobian : (K, n, n) array
        Overwritten with the derivative of the prediction with respect to the older node.
    """
    count, n = residual.shape
    p, y, decay = np.empty(3), np.empty(n), np.empty(n)
    for k in range(first, count):
        for i in range(3):
            p[i] = position[k, i]
        for i in range(n):
            y[i] = x[k, i]
        F = jacobian[k]
        set_identity(F)
        steps, dt, turning = steps_of(time[k + 1] - time[k], turn_time)
        decay_of(rate, dt, decay)
        for _ in range(steps):
            sail_step(p, y, F, decay, turning, dt)
        meridian, prime = radii_scalar(sin(p[0]))
        east = position[k + 1, 1] - p[1]
        residual[k, N] = (position[k + 1, 0] - p[0]) * (meridian + p[2])
        residual[k, E] = atan2(sin(east), cos(east)) * (prime + p[2]) * cos(p[0])
        for i in range(2, n):
            residual[k, i] = x[k + 1, i] - y[i]


@kernel(
    "void(i8, Tuple((i8[::1], i8[::1], f8[:, ::1])), i8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], "
    "f8[:, :, ::1])"
)
def _linearise_aids(
    first: int, measured: tuple[Integers, Integers, Array], codes: Integers, aids: Array, position: Array, x: Array,
    residual: Array, jacobian: Array,
) -> None:  # fmt: skip
    """Residuals and derivatives of M measurements at the states that they are attached to.

    Parameters
    ----------
    first : int
        Index of the first measurement that is computed.
    measured : (M,) int, (M,) int and (M, 3) arrays
        Number of the state of each measurement (-1: none of these states); number of its instrument; its value.
    codes, aids : (i,), (i, ...) arrays
        Parameters of each instrument for `simnav.estimators.models.ship_kernels.residual_of`.
    position, x : (K, 3), (K, n) arrays
        The states at which the measurements are predicted.
    residual : (M, 3) array
        Overwritten: measured minus predicted.
    jacobian : (M, 3, n) array
        Overwritten: derivative of the prediction with respect to the state's error.
    """
    row, instrument, value = measured
    for i in range(first, row.size):
        k, s = row[i], instrument[i]
        if k < 0:
            continue
        a, b = residual_of(codes[s], aids[s], position[k], x[k], value[i, 0], value[i, 1])
        residual[i, 0], residual[i, 1], residual[i, 2] = a, b, 0.0
        for r in range(3):
            for c in range(x.shape[1]):
                jacobian[i, r, c] = 0.0
        fill_jacobian(codes[s], aids[s], x[k], jacobian[i])


@kernel(
    "void(i8, Tuple((i8[::1], i8, f8[::1])), Tuple((f8[::1], f8[:, ::1], f8[:, ::1])), f8[::1], f8, f8[:, ::1], "
    "f8[:, ::1], f8[:, :, ::1])"
)
def _move_folds(
    first: int, folds: tuple[Integers, int, Array], nodes: tuple[Array, Array, Array], rate: Array, turn_time: float,
    now_position: Array, now_x: Array, jacobian: Array,
) -> None:  # fmt: skip
    """States at the times of folds, each from its node.

    Parameters
    ----------
    first : int
        Fold to begin with.
    folds : (F,) int array, int, (F,) array
        Number of the node of each fold; number of the first node that is kept; times of the folds [s].
    nodes : (K,), (K, 3) and (K, n) arrays
        Times [s], positions and states of the nodes.
    rate, turn_time
        As of `_linearise_motion`.
    now_position, now_x : (F, 3), (F, n) arrays
        Overwritten: the states at the folds.
    jacobian : (F, n, n) array
        Overwritten: derivative of the fold's state with respect to the node.
    """
    node, base, fold_time = folds
    time, position, x = nodes
    decay = np.empty(rate.size)
    for i in range(first, node.size):
        k = node[i] - base
        for j in range(3):
            now_position[i, j] = position[k, j]
        for j in range(rate.size):
            now_x[i, j] = x[k, j]
        set_identity(jacobian[i])
        steps, dt, turning = steps_of(fold_time[i] - time[k], turn_time)
        decay_of(rate, dt, decay)
        for _ in range(steps):
            sail_step(now_position[i], now_x[i], jacobian[i], decay, turning, dt)


@kernel("void(f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def _retract(step: Array, position: Array, x: Array) -> None:
    for k in range(step.shape[0]):
        correct_ship(position[k], x[k], step[k])


@kernel("void(f8[::1], f8[:, ::1], f8[:, ::1], f8[::1], f8, f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1])")
def _along_motion(
    time: Array, position: Array, x: Array, rate: Array, turn_time: float, residual: Array, jacobian: Array,
    step: Array, along: Array,
) -> None:  # fmt: skip
    """A step that follows the motion exactly, from one that solves the linear problem (`Chain.along_motion`).

    Parameters
    ----------
    time, position, x, rate, turn_time, residual, jacobian
        As of `_linearise_motion`.
    step : (K + 1, n) array
        Step of each node that solves the linear problem.
    along : (K + 1, n) array
        Overwritten: the same first step, and after it the motion with the errors that the linear solution leaves to it.
    """
    count, n = residual.shape
    p, y, decay, error, F = np.empty(3), np.empty(n), np.empty(n), np.empty(n), np.empty((n, n))
    along[0] = step[0]
    for k in range(count):
        error_after_step(residual[k], jacobian[k], step[k], step[k + 1], error)
        for i in range(3):
            p[i] = position[k, i]
        for i in range(n):
            y[i] = x[k, i]
        correct_ship(p, y, along[k])
        set_identity(F)
        steps, dt, turning = steps_of(time[k + 1] - time[k], turn_time)
        decay_of(rate, dt, decay)
        for _ in range(steps):
            sail_step(p, y, F, decay, turning, dt)
        meridian, prime = radii_scalar(sin(position[k + 1, 0]))
        east = p[1] - position[k + 1, 1]
        along[k + 1, N] = error[N] + (p[0] - position[k + 1, 0]) * (meridian + p[2])
        along[k + 1, E] = error[E] + atan2(sin(east), cos(east)) * (prime + p[2]) * cos(position[k + 1, 0])
        for i in range(2, n):
            along[k + 1, i] = error[i] + y[i] - x[k + 1, i]


class ShipChain(Chain):
    """The chain of a ship model.

    Parameters
    ----------
    front : ShipModel
        The model that runs ahead and leaves the nodes behind.
    """

    front: ShipModel

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """One node, at the start; its covariance. UnsuitableScenario without any aid."""
        covariance = super().begin(start, instruments)
        known = self.front.aids
        self._codes = np.zeros((len(self.names), 3), dtype=np.int64)
        self._aids = np.zeros((len(self.names), 7))
        for i, name in enumerate(self.names):
            if name in known:
                self._codes[i], self._aids[i], _ = known[name]
            else:  # no bias: what the compiled loop writes for it is overwritten
                self._codes[i] = VELOCITY, -1, -1
        return covariance

    def linearise_motion(self, first: int = 0) -> None:
        """As `Chain.linearise_motion`, by the model's own step."""
        nodes, m, front = self.nodes, self.motions, self.front
        _linearise_motion(
            first, nodes["time"], nodes["position"], nodes["x"], front.decay, front.turn_time, m["residual"],
            m["jacobian"],
        )  # fmt: skip

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`."""
        aids = self.aids
        _linearise_aids(
            first, (row, aids["instrument"], aids["value"]), self._codes, self._aids,
            states[f"{prefix}position"], states[f"{prefix}x"], aids["residual"], jacobian,
        )  # fmt: skip
        if self.front.own:
            self.observe_own(first, row, jacobian, states[f"{prefix}position"], states[f"{prefix}x"])

    def move_folds(self, first: int) -> None:
        """As `Chain.move_folds`, by the model's own step."""
        nodes, folds, front = self.nodes, self.folds, self.front
        _move_folds(
            first, (folds["node"], self.base, folds["time"]), (nodes["time"], nodes["position"], nodes["x"]),
            front.decay, front.turn_time, folds["now_position"], folds["now_x"], folds["jacobian"],
        )  # fmt: skip

    def retract(self, step: Array) -> None:
        """As `Chain.retract`; the motion factors need no shifts."""
        _retract(step, self.nodes["position"], self.nodes["x"])
        self.prior_shift = self.relative_shift(self.prior_shift, step[0])

    def along_motion(self, step: Array) -> Array:
        """As `Chain.along_motion`."""
        nodes, m, front = self.nodes, self.motions, self.front
        along = np.empty_like(step)
        _along_motion(
            nodes["time"], nodes["position"], nodes["x"], front.decay, front.turn_time, m["residual"], m["jacobian"],
            step, along,
        )  # fmt: skip
        return along


@chain_of.register
def _(model: ShipModel) -> Chain:
    return ShipChain(model)
