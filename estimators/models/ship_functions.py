"""The equations of the ship model as the functions of a filter, over its flat state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.joseph import project
from simnav.kernel_types import Vector
from simnav.structures import length, structure
from simnav.types import Array

from .filtering import Dynamics, ModelFunctions, Prediction, Readings, aid_of
from .propagation import Samples
from .ship_kernels import SHIP_NOISE, advance_ship, correct_ship, observe_ship

__all__ = ["SHIP_FUNCTIONS", "SHIP_MOTION", "SHIP_NUMBERS", "ShipState", "ship_state"]


class ShipState(NamedTuple):
    """The named blocks of a flat state of a ship.

    Attributes
    ----------
    clock : (1,) array
        Time of the state [s].
    position : (3,) array
        Latitude, longitude [rad] and height [m].
    x : (n,) array
        The other states (`simnav.estimators.models.ship_kernels`).
    """

    clock: Vector
    position: Vector
    x: Vector


#: Figures of the motion: correlation time of the turn rate [s]. Of a ship that stands still without a fix: time after
#: the last fix from which it stands, and the time of the last fix [s].
SHIP_MOTION = structure(turn_time=float, patience=float, last_fix=float)
#: A flat state of a ship, behind which are its n other states; the blocks are those of `ShipState`.
SHIP_STATE = structure(clock=1, position=3)
#: Numbers of a flat state before its n states, and of the noise of an instrument.
SHIP_NUMBERS, SHIP_NOISE_NUMBERS = length(SHIP_STATE), length(SHIP_NOISE)


@helper
def ship_state(numbers: Array) -> ShipState:
    """The named blocks of a flat state, as views."""
    own = numbers[:SHIP_NUMBERS].view(SHIP_STATE)[0]
    return ShipState(own.clock[:], own.position[:], numbers[SHIP_NUMBERS:])


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time."""
    state = ship_state(dynamics.numbers)
    elapsed = until - state.clock[0]
    if elapsed > 0.0:
        advance_ship(
            state.position, state.x, dynamics.covariance, dynamics.transition, dynamics.decay, dynamics.density,
            dynamics.constants.view(SHIP_MOTION)[0].turn_time, elapsed,
        )  # fmt: skip
        state.clock[0] = until


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Compute what a reading should be, and the covariance of that (`observe_ship`)."""
    row, d, aids, state = readings.instrument[k], readings.components[k], dynamics.aids, ship_state(dynamics.numbers)
    jacobian = np.zeros((d, state.x.size))
    aid, noise, value = aid_of(aids, row), aids.noise[row, :SHIP_NOISE_NUMBERS], readings.value[k]
    observe_ship(
        aid, noise, state.position, state.x, value[0], value[d - 1], prediction.innovation, jacobian, prediction.nominal
    )
    project(dynamics.covariance, jacobian, prediction.cross, prediction.predicted)
    return True


@kernel(passed=True)
def retract(dynamics: Dynamics) -> None:
    """Add the correction to the state."""
    state = ship_state(dynamics.numbers)
    correct_ship(state.position, state.x, dynamics.correction)


SHIP_FUNCTIONS = ModelFunctions(propagate, predict, retract)
