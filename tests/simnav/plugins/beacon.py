"""A range-and-bearing beacon: how far away, and in which direction from the bow, a transponder at a known place is."""

from __future__ import annotations

from math import inf
from typing import Literal

import numpy as np

from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import wrap_angle
from simnav.kinds import Component, Kind
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.spec import NonNegative, Positive, Vector, quantity

#: Below this horizontal distance the bearing says nothing [m].
NEAREST = 1.0


def observe(point, sheet):
    """What the beacon should read at a state, and the Jacobian over position, velocity and attitude."""
    place = np.array([sheet.details[name] for name in ("latitude", "longitude", "height")])
    arm = point.dcm @ sheet.lever_arm
    north, east, _ = to_beacon = relative_position(place, displace(point.position, arm))
    distance, level = np.linalg.norm(to_beacon), np.hypot(north, east)
    if level < NEAREST:
        return None
    forward_north, forward_east = point.dcm[0, 0], point.dcm[1, 0]
    heading = np.arctan2(forward_east, forward_north)
    reading = np.array([distance, wrap_angle(np.arctan2(east, north) - heading)])
    jacobian = np.zeros((2, 9))
    jacobian[0, 0:3] = -to_beacon / distance
    jacobian[1, 0:3] = [east / level**2, -north / level**2, 0.0]
    jacobian[:, 6:9] = np.cross(arm, jacobian[:, 0:3])  # the antenna swings with the attitude
    slope = -point.dcm[2, 0] / (forward_north**2 + forward_east**2)
    jacobian[1, 6:9] -= [slope * forward_north, slope * forward_east, 1.0]  # of the heading
    return reading, jacobian


@register_instrument(
    Kind(
        "range and bearing of a beacon",
        role="range",
        components=(Component("range", "m", limit=50e3), Component("bearing", "deg", cyclic=True)),
        equation=observe,
        datasheet=("latitude", "longitude", "height"),
    ),
    example={
        "latitude_deg": 54.003,
        "longitude_deg": 7.903,
        "height_m": -20.0,
        "sigma_range_m": 0.5,
        "sigma_bearing_deg": 1.0,
    },
)
class Beacon(AidSpec):
    """Range and bearing, relative to the bow, of a transponder at a known place."""

    kind: Literal["beacon"] = "beacon"
    latitude: float = quantity("deg")
    longitude: float = quantity("deg")
    height: float = quantity("m", 0.0)
    sigma_range: NonNegative = quantity("m")
    sigma_bearing: NonNegative = quantity("deg")
    bias_range: NonNegative = quantity("m", 0.0)
    bias_bearing: NonNegative = quantity("deg", 0.0)
    lever_arm: Vector = quantity("m", (0.0, 0.0, 0.0))
    reach: Positive = quantity("m", inf)

    def build(self, name, seed):
        """The beacon of one run."""
        return _Beacon(self, name, seed)


class _Beacon(Instrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.place = np.array([spec.latitude, spec.longitude, spec.height])
        self.reach = spec.reach

    def to_beacon(self, tap):
        """(n, 3) north-east-down vectors from the instrument to the beacon [m]."""
        return relative_position(self.place, displace(tap.position, self.lever_displacement(tap)))

    def observe(self, tap):
        """(n, 2) ranges and bearings, before bias and noise."""
        north, east, down = self.to_beacon(tap).T
        bearing = wrap_angle(np.arctan2(east, north) - tap.attitude[:, 2])
        return np.stack([np.sqrt(north**2 + east**2 + down**2), bearing], axis=1)

    def available(self, tap):
        """Which of the n readings are delivered: those within reach."""
        return np.linalg.norm(self.to_beacon(tap), axis=1) <= self.reach
