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

from .channel_readings import ChannelReadings
from .inertial_errors import ERROR, PART
from .measurement_functions import Kinematics, MeasurementFunction, PredictedReading
from .named_state import NamedState
from .ship_kernels import SHIP

__all__ = ["HEEL", "VERTICAL_SPEED", "PlacedShip", "ShipObservation", "ShipReadings"]

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


class ShipObservation(MeasurementFunction):
    """The measurement equation of one instrument on a ship.

    Parameters
    ----------
    sheet : Datasheet
        Datasheet of the instrument, of a kind with an observation.
    places : mapping of str to int
        Index in the state of the first component of each of the instrument's blocks.
    white : (d,) array
        Variance of the white noise of each component, in the units of the kind.
    height, sway : float
        Variance of the height [m^2], and of the sideways velocity [(m/s)^2].
    """

    def __init__(self, sheet: Datasheet, places: Mapping[str, int], white: Array, height: float, sway: float):
        super().__init__(sheet, places)
        self._white, self._sway = np.diag(white), sway
        self._unknown = np.diag([0.0, 0.0, height, 0.0, 0.0, VERTICAL_SPEED**2, HEEL**2, HEEL**2, 0.0])

    def point(self, time: float, state: NamedState, side: Array = NO_SIDE) -> NavigationPoint:
        """As `MeasurementFunction.point`, at a `PlacedShip`."""
        assert isinstance(state, PlacedShip)
        return NavigationPoint(time, state.position, *_kinematics(state.x), self.blocks(state.x), self.channel, side)

    def noise(self, found: PredictedReading, heading: float) -> Array:
        """The (d, d) covariance of the noise of a reading, with what the state of a ship lacks."""
        own = found.own[:, PART.navigation]
        by_north, by_east = own[:, ERROR.velocity], own[:, ERROR.velocity + 1]
        aside = self._sway**0.5 * (by_east * cos(heading) - by_north * sin(heading))
        noise = self._white + own @ self._unknown @ own.T + np.outer(aside, aside)
        more = self.spread(found.own, found.point)
        return noise if more is None else noise + more

    def _by_motion(self, own: Array, states: Array, jacobian: Array) -> None:
        jacobian[:] = own[:, PART.navigation] @ _navigation(states)

    def _near(self, point: NavigationPoint, states: Array, errors: Array) -> Kinematics:
        north, east = errors[:, SHIP.north], errors[:, SHIP.east]
        places = displace(point.position, np.column_stack([north, east, np.zeros(len(errors))]))
        return Kinematics(places, *_kinematics(states + errors))


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
