"""Readings of instruments whose kind has a measurement equation of its own, at the state of a ship.

Such an equation takes a whole navigation state (`simnav.kinds.Observation`). A ship's state has fewer components
(`simnav.estimators.models.ship`): the vessel is level, at the height of the start, and moves ahead through the water.
What a reading depends on beyond that is noise: height, vertical speed, roll and pitch, and the sideways velocity.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import displace
from simnav.kinds import NavigationPoint
from simnav.types import NO_SIDE, Array, Datasheet

from .ambiguity import innovation_of
from .base import Linearised
from .channel_readings import ChannelReadings
from .inertial_errors import ERROR, PART
from .measurement_functions import Kinematics, MeasurementFunction
from .named_state import NamedState
from .ship_kernels import SHIP

__all__ = ["HEEL", "VERTICAL_SPEED", "PlacedShip", "PredictedReading", "ShipObservation", "ShipReadings"]

#: Roll and pitch, which the model takes for zero, one sigma [rad].
HEEL = 0.03
#: Vertical speed, which the model takes for zero, one sigma [m/s].
VERTICAL_SPEED = 1.0


class PlacedShip(NamedTuple):
    """A state of a ship, or K of them.

    Attributes
    ----------
    position : (3,) or (K, 3) array
        Latitude, longitude [rad] and height [m].
    x : (n,) or (K, n) array
        The other states (`simnav.estimators.models.ship_kernels`).
    """

    position: Array
    x: Array


class PredictedReading(NamedTuple):
    """A reading of d components, compared with what the state of a ship predicts.

    Attributes
    ----------
    innovation : (d,) array
        Measured minus predicted, in the units of the kind's errors.
    jacobian : (d, n) array
        Derivative of the prediction by the state of the ship.
    own : (d, 9 + b) array
        That by the navigation state and the b components of blocks, as `MeasurementFunction.predict` gives it.
    point : NavigationPoint
        Where the reading is predicted.
    """

    innovation: Array
    jacobian: Array
    own: Array
    point: NavigationPoint


class ShipObservation(MeasurementFunction):
    """The measurement equation of one instrument on a ship.

    Parameters
    ----------
    sheet : Datasheet
        Datasheet of the instrument, of a kind with an observation.
    places : mapping of str to int
        Index in the state of the first component of each of the instrument's blocks.
    bias_at : int
        Index of the instrument's first bias in the state; -1 if it has none.
    white : (d,) array
        Variance of the white noise of each component, in the units of the kind.
    height, sway : float
        Variance of the height [m^2], and of the sideways velocity [(m/s)^2].
    """

    def __init__(
        self, sheet: Datasheet, places: Mapping[str, int], bias_at: int, white: Array, height: float, sway: float
    ):
        super().__init__(sheet, places)
        self._bias_at, self._white, self._sway = bias_at, np.diag(white), sway
        self._unknown = np.diag([0.0, 0.0, height, 0.0, 0.0, VERTICAL_SPEED**2, HEEL**2, HEEL**2, 0.0])

    def measure(self, time: float, value: Array, position: Array, x: Array, side: Array = NO_SIDE) -> Linearised | None:
        """Linearise one measurement.

        Parameters
        ----------
        time : float
            Time of validity [s].
        value : (d,) array
            The measured value.
        position, x : (3,), (n,) array
            State of the ship (`simnav.estimators.models.ship_kernels`).
        side : (s,) array
            Side information of the reading.

        Returns
        -------
        Linearised or None
            None where the state has no reading.
        """
        found = self.observe(time, value, position, x, side)
        if found is None:
            return None
        own = found.own[:, PART.navigation]
        by_north, by_east = own[:, ERROR.velocity], own[:, ERROR.velocity + 1]
        aside = self._sway**0.5 * (by_east * cos(x[SHIP.heading]) - by_north * sin(x[SHIP.heading]))
        noise = self._white + own @ self._unknown @ own.T + np.outer(aside, aside)
        more = self.spread(found.own, found.point)
        return Linearised(found.innovation, found.jacobian, noise if more is None else noise + more)

    def observe(
        self, time: float, value: Array, position: Array, x: Array, side: Array = NO_SIDE
    ) -> PredictedReading | None:
        """As `measure`, without the noise."""
        point = self._point(time, position, x, side)
        predicted = self.predict(point)
        if predicted is None:
            return None
        reading, own = predicted
        jacobian, at, d = own[:, PART.navigation] @ _navigation(x), self._bias_at, len(reading)
        self.place(own, jacobian, 0)
        if at >= 0:
            jacobian[:, at : at + d] = np.eye(d)
            reading = self.kind.add_error(reading, x[at : at + d])
        return PredictedReading(innovation_of(self.kind, self.sheet, value, reading), jacobian, own, point)

    def differences_at(self, time: float, position: Array, x: Array, errors: Array, side: Array = NO_SIDE) -> Array:
        """What the instrument should read at k states, minus what it should read at one.

        Parameters
        ----------
        time : float
            Time of validity [s].
        position, x : (3,), (n,) array
            The state that the k states are compared with; it has a reading.
        errors : (k, n) array
            Differences of the k states from it: metres north and east, then those of ``x``.
        side : (s,) array
            Side information of the reading.

        Returns
        -------
        (k, d) array
            A state that has no reading gets the difference by the Jacobian.
        """
        point = self._point(time, position, x, side)
        predicted = self.predict(point)
        assert predicted is not None, "the model's own state has a reading"
        reading, own = predicted
        north, east = errors[:, SHIP.north], errors[:, SHIP.east]
        places = displace(position, np.column_stack([north, east, np.zeros(len(errors))]))
        if self.observations is not None:
            states = Kinematics(places, *_kinematics(x + errors))
            differences = np.asarray(self.kind.difference(self.read_many(point, states, errors, 0), reading))
        else:
            jacobian = own[:, PART.navigation] @ _navigation(x)
            self.place(own, jacobian, 0)
            differences = errors @ jacobian.T
            for k, error in enumerate(errors):
                found = self.read(self._point(time, places[k], x + error, side))
                if found is not None:
                    differences[k] = self.kind.difference(found, reading)
        at = self._bias_at
        if at >= 0:
            differences += errors[:, at : at + len(reading)]
        return differences

    def _point(self, time: float, position: Array, x: Array, side: Array) -> NavigationPoint:
        """The navigation state of a ship."""
        return NavigationPoint(time, position, *_kinematics(x), self.blocks(x), self.channel, side)


class ShipReadings(ChannelReadings):
    """The readings of all channels of an instrument, at states of a ship (`PlacedShip`)."""

    first_own = 0

    def _own_states(self, states: NamedState) -> Array:
        assert isinstance(states, PlacedShip)
        return states.x

    def _navigation(self, states: NamedState, row: NDArray[np.intp], own: Array) -> Kinematics:
        assert isinstance(states, PlacedShip)
        return Kinematics(states.position.take(row, axis=0), *_kinematics(own))

    def _by_navigation(self, derivative: Array, own: Array, jacobian: Array) -> None:
        c, s, u = np.cos(own[:, SHIP.heading, None]), np.sin(own[:, SHIP.heading, None]), own[:, SHIP.speed, None]
        by_north, by_east = derivative[:, :, ERROR.velocity], derivative[:, :, ERROR.velocity + 1]
        jacobian[:, :, SHIP.north] = derivative[:, :, ERROR.position]
        jacobian[:, :, SHIP.east] = derivative[:, :, ERROR.position + 1]
        jacobian[:, :, SHIP.current_north], jacobian[:, :, SHIP.current_east] = by_north, by_east
        jacobian[:, :, SHIP.speed] = by_north * c + by_east * s
        jacobian[:, :, SHIP.heading] = derivative[:, :, ERROR.attitude + 2] + (by_east * c - by_north * s) * u


def _kinematics(x: Array) -> tuple[Array, Array, Array]:
    """Velocity, DCM and angular rate of (..., n) states of a ship."""
    c, s = np.cos(x[..., SHIP.heading]), np.sin(x[..., SHIP.heading])
    velocity, dcm, turning = np.zeros((*x.shape[:-1], 3)), np.zeros((*x.shape[:-1], 3, 3)), np.zeros((*x.shape[:-1], 3))
    velocity[..., 0] = x[..., SHIP.speed] * c + x[..., SHIP.current_north]
    velocity[..., 1] = x[..., SHIP.speed] * s + x[..., SHIP.current_east]
    dcm[..., 0, 0] = dcm[..., 1, 1] = c
    dcm[..., 0, 1], dcm[..., 1, 0], dcm[..., 2, 2] = -s, s, 1.0
    turning[..., 2] = x[..., SHIP.turn_rate]
    return velocity, dcm, turning


def _navigation(x: Array) -> Array:
    """(9, n) derivative of the navigation state's error with respect to that of the ship's state."""
    c, s = cos(x[SHIP.heading]), sin(x[SHIP.heading])
    G = np.zeros((PART.navigation.stop, len(x)))
    north, east = ERROR.velocity, ERROR.velocity + 1
    G[ERROR.position, SHIP.north] = G[ERROR.position + 1, SHIP.east] = G[ERROR.attitude + 2, SHIP.heading] = 1.0
    G[north, SHIP.current_north] = G[east, SHIP.current_east] = 1.0
    G[north, SHIP.speed], G[north, SHIP.heading] = c, -x[SHIP.speed] * s
    G[east, SHIP.speed], G[east, SHIP.heading] = s, x[SHIP.speed] * c
    return G
