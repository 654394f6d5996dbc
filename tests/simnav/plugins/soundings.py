"""An echo sounder, and the surroundings that it asks: a bottom that slopes, and the speed of sound."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.geometry.earth import relative_position
from simnav.kinds import Component, Kind
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.spec import NonNegative, Positive, quantity
from simnav.streams import stream
from simnav.world import SurroundingSpec, register_surrounding

#: Speed of sound for which the sounder is set [m/s].
SET_SPEED = 1500.0


@register_surrounding
class Slope(SurroundingSpec):
    """A bottom that is deeper further north."""

    kind: Literal["slope"] = "slope"
    latitude: float = quantity("deg")
    longitude: float = quantity("deg")
    depth: Positive = quantity("m")
    gradient: float = 0.0

    def build(self, name, seed):
        """The bottom of one run."""
        return _Slope(self)


class _Slope:
    def __init__(self, spec):
        self.spec, self.origin = spec, np.array([spec.latitude, spec.longitude, 0.0])

    def depth(self, position, time):
        """(n,) depths below the mean sea surface [m]."""
        return self.spec.depth + self.spec.gradient * relative_position(position, self.origin)[:, 0]


@register_surrounding
class SoundSpeed(SurroundingSpec):
    """A speed of sound that is drawn for each run."""

    kind: Literal["sound_speed"] = "sound_speed"
    mean: Positive = quantity("m_s", 1500.0)
    spread: NonNegative = quantity("m_s", 0.0)

    def build(self, name, seed):
        """The speed of sound of one run [m/s]."""
        return self.mean + self.spread * stream(seed, "surroundings", name).standard_normal()


@register_instrument(
    Kind("distance from the keel to the bottom", role="other", components=(Component("sounding", "m", limit=2e4),)),
    example={"sigma_m": 0.1},
)
class EchoSounder(AidSpec):
    """Distance to the bottom below the keel, for a fixed speed of sound."""

    kind: Literal["echo_sounder"] = "echo_sounder"
    sigma: NonNegative = quantity("m")

    def build(self, name, seed):
        """The sounder of one run."""
        return _EchoSounder(self, name, seed)


class _EchoSounder(Instrument):
    def observe(self, tap):
        """(n, 1) soundings [m]."""
        altitude = tap.position[:, 2] + self.surroundings["bottom"].depth(tap.position, tap.time)
        speed = self.surroundings.get("sound_speed") or SET_SPEED
        return (altitude * SET_SPEED / speed)[:, None]
