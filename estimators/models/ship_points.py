"""The ship model for sigma-point solvers: its motion and measurements for many states at once.

All states but the position are plain numbers (the heading is not wrapped); a point differs from the model's state by
what is added to it, in metres for the position.
"""

from __future__ import annotations

from math import atan2, cos, sin

import numpy as np

from simnav.compiled import helper, kernel
from simnav.kernel_types import Matrix, Vector
from simnav.types import Array, Measurement

from .filtering import Aid, Dynamics, ModelFunctions, Prediction, Readings, aid_of
from .points import PointModel, predict_through, propagate_through
from .propagation import Samples
from .ship import ShipModel, components_of
from .ship_functions import SHIP_MOTION, retract, ship_state
from .ship_functions import predict as linearise
from .ship_functions import propagate as propagate_linearised
from .ship_kernels import HEADING, move_ships, read_ships
from .ship_observation import PlacedShip

__all__ = ["ShipPoints"]


@helper
def states_at(x: Array, errors: Array) -> Array:
    """(k + 1, n) states: the one that k points differ from, and they."""
    k, n = errors.shape
    states = np.empty((k + 1, n))
    for i in range(n):
        states[0, i] = x[i]
        for j in range(k):
            states[j + 1, i] = x[i] + errors[j, i]
    return states


@kernel
def move_points(x: Vector, decay: Vector, turn_time: float, elapsed: float, errors: Matrix) -> None:
    """Move points from their differences from a state to those from the state after a time, in place."""
    states = states_at(x, errors)
    move_ships(states, decay, turn_time, elapsed)
    for j in range(errors.shape[0]):
        for i in range(errors.shape[1]):
            errors[j, i] = states[j + 1, i] - states[0, i]


@kernel
def observe_points(aid: Aid, x: Vector, errors: Matrix, differences: Matrix) -> None:
    """Fill in what an instrument should read at points, minus what it should read at the state."""
    k, d = differences.shape
    readings = np.empty((k + 1, d))
    read_ships(aid, states_at(x, errors), readings)
    for j in range(k):
        for i in range(d):
            difference = readings[j + 1, i] - readings[0, i]
            differences[j, i] = atan2(sin(difference), cos(difference)) if aid.code == HEADING else difference


@kernel
def move(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance state and points; the covariance becomes that of the process noise."""
    state = ship_state(dynamics.numbers)
    turn_time = dynamics.constants.view(SHIP_MOTION)[0].turn_time
    move_points(state.x, dynamics.decay, turn_time, until - state.clock[0], dynamics.points.errors)
    dynamics.covariance[:] = 0.0
    propagate_linearised(dynamics, samples, until)


@kernel(passed=True)
def propagate(dynamics: Dynamics, samples: Samples, until: float) -> None:
    """Advance the state and its covariance to a time, through points."""
    if until > ship_state(dynamics.numbers).clock[0]:
        propagate_through(move, retract, dynamics, samples, until)


@kernel
def read(dynamics: Dynamics, readings: Readings, k: int, differences: Matrix) -> None:
    """What an instrument should read at the points, minus what it should read at the state."""
    aid, x = aid_of(dynamics.aids, readings.instrument[k]), ship_state(dynamics.numbers).x
    observe_points(aid, x, dynamics.points.errors, differences)


@kernel(passed=True)
def predict(dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
    """Compute what a reading should be, and the covariance of that, from points."""
    return predict_through(linearise, read, dynamics, readings, k, prediction)


POINT_FUNCTIONS = ModelFunctions(propagate, predict, retract)


class ShipPoints(ShipModel, PointModel):
    """`ShipModel` with points; the parameters are its own."""

    def point_functions(self) -> ModelFunctions | None:
        """As `PointModel.point_functions`; None where `functions` is."""
        return None if self.functions() is None else POINT_FUNCTIONS

    def move(self, states: Array, elapsed: float) -> None:
        """Advance (k, n) states by the model's motion, in place, in its own steps (`ShipModel`)."""
        if elapsed > 0.0:
            move_ships(states, self.decay, self.turn_time, elapsed)

    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state and the points; return the process noise."""
        noise = np.zeros((self.size, self.size))
        move_points(self.x, self.decay, self.turn_time, until - self.time, errors)
        self.propagate(noise, until)
        return noise

    def read(self, measurement: Measurement, states: Array) -> Array:
        """(k, m) what an instrument should read at k states; positions in metres from the model's own."""
        aid = self.aids[measurement.instrument]
        readings = np.empty((len(states), components_of(aid)))
        read_ships(aid, states, readings)
        return readings

    def observe_points(self, measurement: Measurement, errors: Array) -> Array:
        """What the instrument should read at the points, minus what it should read at the state."""
        if measurement.instrument in self.own:
            own, bias_at = self.own[measurement.instrument], self.bias_at.get(measurement.instrument, -1)
            point = own.point(measurement.time, PlacedShip(self.position, self.x), measurement.side)
            return own.differences(point, self.x, errors, 0, bias_at)
        aid = self.aids[measurement.instrument]
        differences = np.empty((len(errors), components_of(aid)))
        observe_points(aid, self.x, errors, differences)
        return differences
