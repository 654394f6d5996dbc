"""Ranges to beacons that sail on known straight lines, measured with a clock whose error and drift are states."""

from __future__ import annotations

from math import inf
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace, relative_position
from simnav.kinds import Component, Kind
from simnav.sensors import AidSpec, ChannelInstrument, register_instrument
from simnav.spec import NonNegative, Positive, quantity

Numbers = tuple[float, ...]


def observe(point, sheet):
    """Distance to the beacon and the error of the clock, as a length; the Jacobian by block."""
    away = relative_position(point.side[:3], point.position)
    distance = np.linalg.norm(away)
    navigation = np.zeros((1, 9))
    navigation[0, 0:3] = -away / distance
    return np.array([distance + point.blocks["clock"][0]]), {"navigation": navigation, "clock": np.array([[1.0, 0.0]])}


def sigma(side, sheet):
    """The noise of a range: that of the receiver, and what the beacon says about its own position."""
    return np.hypot(sheet.sigma, side[3:])


@register_instrument(
    Kind(
        "ranges to beacons that move, with the error of a clock",
        role="range",
        components=(Component("range", "m", limit=50e3),),
        equation=observe,
        side=(
            Component("latitude", "deg"),
            Component("longitude", "deg"),
            Component("height", "m"),
            Component("uncertainty", "m"),
        ),
        reading_sigma=sigma,
    ),
    example={
        "latitude_deg": 54.0, "longitude_deg": 7.9, "beacons": ["A", "B", "C", "D"],
        "north_m": [300.0, -250.0, 100.0, -50.0], "east_m": [100.0, 200.0, -400.0, 350.0],
        "depth_m": [5.0, 40.0, 20.0, 60.0], "course_deg": [90.0, 0.0, 45.0, 200.0], "speed_m_s": [1.0, 1.5, 1.0, 0.5],
        "sigma_m": 0.5, "clock_m": 30.0, "drift_m_s": 0.05,
    },
)  # fmt: skip
class MovingBeacons(AidSpec):
    """Ranges to beacons that say where they are."""

    errors = (*AidSpec.errors, "clock", "drift", "clock_noise", "drift_noise")

    kind: Literal["moving_beacons"] = "moving_beacons"
    latitude: float = quantity("deg")
    longitude: float = quantity("deg")
    beacons: tuple[str, ...]
    north: Numbers = quantity("m")
    east: Numbers = quantity("m")
    depth: Numbers = quantity("m")
    course: Numbers = quantity("deg")
    speed: Numbers = quantity("m_s")
    uncertainty: Numbers = quantity("m", ())
    reach: Positive = quantity("m", inf)
    sigma: NonNegative = quantity("m")
    bias: NonNegative = quantity("m", 0.0)
    bias_instability: NonNegative = quantity("m", 0.0)
    clock: NonNegative = quantity("m", 0.0)
    drift: NonNegative = quantity("m_s", 0.0)
    clock_noise: NonNegative = 0.0
    drift_noise: NonNegative = 0.0

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        for name in ("north", "east", "depth", "course", "speed", *(["uncertainty"] if self.uncertainty else [])):
            if len(getattr(self, name)) != len(self.beacons):
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} numbers, there are {len(self.beacons)} beacons"
                )
        return self

    def channels(self):
        """The names of the beacons."""
        return self.beacons

    def blocks(self):
        """Bias [m] and drift [m/s] of the clock, which all ranges have in common."""
        sigma, density = (self.clock, self.drift), (self.clock_noise, self.drift_noise)
        return (StateBlock("clock", 2, ("m", "m_s"), sigma, "clock", density, shared="receiver_clock"),)

    def build(self, name, seed):
        """The receiver of one run."""
        return _MovingBeacons(self, name, seed)


class _MovingBeacons(ChannelInstrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.origin, self.reach = np.array([spec.latitude, spec.longitude, 0.0]), spec.reach
        self.first = np.stack([spec.north, spec.east, spec.depth], axis=1)
        course, level = np.array(spec.course), np.zeros(len(spec.beacons))
        self.velocity = np.array(spec.speed)[:, None] * np.stack([np.cos(course), np.sin(course), level], axis=1)
        self.uncertainty = np.array(spec.uncertainty) if spec.uncertainty else level

    def places(self, time):
        """(n, c, 3) positions of the beacons."""
        return displace(self.origin, self.first + self.velocity * time[:, None, None])

    def distances(self, tap):
        """(n, c) distances to the beacons [m]."""
        north, east, down = np.moveaxis(relative_position(self.places(tap.time), tap.position[:, None]), 2, 0)
        return np.sqrt(north**2 + east**2 + down**2)

    def side_information(self, tap):
        """(n, c, 4) positions of the beacons, and how well they know them."""
        places = self.places(tap.time)
        return np.concatenate([places, np.broadcast_to(self.uncertainty[:, None], (*places.shape[:2], 1))], axis=2)

    def observe(self, tap):
        """(n, c, 1) ranges, before bias and noise."""
        return (self.distances(tap) + self.block("clock", tap.time)[:, :1])[:, :, None]

    def available(self, tap):
        """Which beacons are within reach."""
        return self.distances(tap) <= self.reach
