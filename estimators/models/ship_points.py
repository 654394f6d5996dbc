"""The ship model for sigma-point solvers: its motion and measurements for many states at once.

All states but the position are plain numbers (the heading is not wrapped); a point differs from the model's state by
what is added to it, in metres for the position.
"""

from __future__ import annotations

import numpy as np

from simnav.types import Array, Measurement

from .equations import equation_of
from .points import PointModel
from .ship import ShipModel, components_of
from .ship_kernels import move_ships, read_ships

__all__ = ["ShipPoints"]


class ShipPoints(ShipModel, PointModel):
    """`ShipModel` with points; the parameters are its own."""

    def states(self, errors: Array) -> Array:
        """(k, n) states of points: metres north and east of the model's own position, and its other states."""
        return np.asarray(self.x + errors)

    def move(self, states: Array, elapsed: float) -> None:
        """Advance (k, n) states by the model's motion, in place, in its own steps (`ShipModel`)."""
        if elapsed > 0.0:
            move_ships(states, self.decay, self.turn_time, elapsed)

    def propagate_points(self, errors: Array, until: float) -> Array:
        """Advance the state and the points; return the process noise."""
        noise = np.zeros((self.size, self.size))
        states = self.states(np.concatenate([np.zeros((1, self.size)), errors]))
        elapsed = until - self.time
        self.move(states, elapsed)
        errors[:] = states[1:] - states[0]
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
            own = self.own[measurement.instrument]
            return own.differences_at(measurement.time, self.position, self.x, errors, measurement.side)
        reading = self.read(measurement, self.states(np.concatenate([np.zeros((1, self.size)), errors])))
        difference = reading[1:] - reading[0]
        if equation_of(self.instruments[measurement.instrument]).is_heading:
            difference = np.arctan2(np.sin(difference), np.cos(difference))
        return np.asarray(difference)
