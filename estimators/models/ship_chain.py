"""The chain of the ship model: dead-reckoning factors between the nodes, and all aids of a window linearised at once.

The motion has a closed form (`simnav.estimators.models.moving_chain`). In the terms of Jiang et al. (2026), section 2:
the part of a motion factor for position and heading is the DR factor of the paper, the Gauss-Markov transition of log
and compass biases its DR error factor (eqs. 4-6, a random walk), and the prior of the first node its marginalization
factor (eqs. 12-17).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.kernel_types import IntegerVector, Matrix, Stack
from simnav.types import Array, InitialState, Instruments

from .chain import Chain, chain_of
from .columns import Columns
from .filtering import AidTable, aid_of
from .moving_chain import MovingChain
from .ship import ShipModel
from .ship_kernels import VELOCITY, linearise_ship
from .ship_observation import PlacedShip

__all__ = ["ShipChain"]


class _Measured(NamedTuple):
    """M measurements: the state of each (-1: none of these states), its instrument, and its value (M, 3)."""

    row: IntegerVector
    instrument: IntegerVector
    value: Matrix


@kernel
def _linearise_aids(
    first: int,
    measured: _Measured,
    aids: AidTable,
    position: Matrix,
    x: Matrix,
    residual: Matrix,
    jacobian: Stack,
) -> None:
    """Residuals and derivatives of M measurements at the states that they are attached to.

    Parameters
    ----------
    first : int
        Index of the first measurement that is computed.
    measured : _Measured
        The measurements.
    aids : AidTable
        The instruments.
    position, x : (K, 3), (K, n) arrays
        The states at which the measurements are predicted.
    residual : (M, 3) array
        Overwritten: measured minus predicted.
    jacobian : (M, 3, n) array
        Overwritten: derivative of the prediction with respect to the state's error.
    """
    value = measured.value
    for i in range(first, measured.row.size):
        k, s = measured.row[i], measured.instrument[i]
        if k < 0:
            continue
        for r in range(3):
            for c in range(x.shape[1]):
                jacobian[i, r, c] = 0.0
        a, b = linearise_ship(aid_of(aids, s), position[k], x[k], value[i, 0], value[i, 1], jacobian[i])
        residual[i, 0], residual[i, 1], residual[i, 2] = a, b, 0.0


class ShipChain(MovingChain):
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
        self._table = self.front.table(self.names)
        self._table.code[self._table.components == 0] = VELOCITY  # what the kernel writes for it is overwritten
        return covariance

    def observe(self, first: int, row: NDArray[np.int64], states: Columns, prefix: str, jacobian: Array) -> None:
        """As `Chain.observe`."""
        aids = self.aids
        _linearise_aids.unchecked(
            first, _Measured(row, aids["instrument"], aids["value"]), self._table,
            states[f"{prefix}position"], states[f"{prefix}x"], aids["residual"], jacobian,
        )  # fmt: skip
        if self.front.own:
            at = PlacedShip(states[f"{prefix}position"], states[f"{prefix}x"])
            self.observe_own(first, row, jacobian, at)


@chain_of.register
def _(model: ShipModel) -> Chain:
    return ShipChain(model)
