"""What an instrument should read at a navigation state: the compiled equations as one table of functions.

`simnav.estimators.models.measurements` computes the same for the inertial state, with Jacobians and compiled. Here each
equation (`simnav.kinds.EQUATIONS`) is a short function of a `simnav.kinds.NavigationPoint`, for models that have no
compiled form (`simnav.estimators.models.general`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import atan2, hypot

import numpy as np

from simnav import kinds
from simnav.geometry.earth import displace
from simnav.kinds import NavigationPoint
from simnav.types import Array, Datasheet

__all__ = ["READINGS"]

#: Smallest cosine of the pitch at which there is a heading [-].
LEAST_LEVEL = 0.1


def _position(point: NavigationPoint, sheet: Datasheet) -> Array:
    return displace(point.position, point.dcm @ sheet.lever_arm)


def _horizontal_position(point: NavigationPoint, sheet: Datasheet) -> Array:
    return _position(point, sheet)[:2]


def _velocity(point: NavigationPoint, sheet: Datasheet) -> Array:
    return np.asarray(point.velocity + point.dcm @ np.cross(point.angular_rate, sheet.lever_arm))


def _body_velocity(point: NavigationPoint, sheet: Datasheet) -> Array:
    return np.asarray(point.dcm.T @ point.velocity + np.cross(point.angular_rate, sheet.lever_arm))


def _forward_speed(point: NavigationPoint, sheet: Datasheet) -> Array:
    return _body_velocity(point, sheet)[:1]


def _heading(point: NavigationPoint, sheet: Datasheet) -> Array | None:
    forward = point.dcm[:, 0]
    if hypot(forward[0], forward[1]) < LEAST_LEVEL:
        return None
    return np.array([atan2(forward[1], forward[0])])


def _depth(point: NavigationPoint, sheet: Datasheet) -> Array:
    return np.array([(point.dcm @ sheet.lever_arm)[2] - point.position[2]])


#: By equation, the function that returns the (d,) reading at a state, without bias and scale, or None. In still water:
#: a speed log reads the forward velocity over the ground.
READINGS: Mapping[str, Callable[[NavigationPoint, Datasheet], Array | None]] = {
    kinds.POSITION: _position,
    kinds.HORIZONTAL_POSITION: _horizontal_position,
    kinds.VELOCITY: _velocity,
    kinds.BODY_VELOCITY: _body_velocity,
    kinds.WATER_SPEED: _forward_speed,
    kinds.HEADING: _heading,
    kinds.DEPTH: _depth,
}
