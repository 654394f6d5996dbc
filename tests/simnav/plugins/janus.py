"""A DVL that gives the velocity along each of its four beams, which share the error of the speed of sound."""

from __future__ import annotations

from math import inf
from typing import Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.kinds import Component, Kind, speed_components
from simnav.sensors import AidSpec, ChannelInstrument, register_instrument
from simnav.sensors.instrument import turn_to_body
from simnav.spec import NonNegative, Positive, quantity

#: Azimuths of the beams, from forward to starboard [rad].
AZIMUTHS = np.radians([45.0, 135.0, 225.0, 315.0])


def direction(azimuth, slant):
    """(..., 3) unit vectors of beams in body axes; the slant is from straight down."""
    level = np.sin(slant)
    return np.stack(np.broadcast_arrays(level * np.cos(azimuth), level * np.sin(azimuth), np.cos(slant)), axis=-1)


def observe(point, sheet):
    """The velocity along the beam, with the scale of the speed of sound; the Jacobian by block."""
    scale = 1.0 + point.blocks["sound_speed"][0]
    along, v = point.dcm @ direction(*point.side), point.velocity
    navigation = np.zeros((1, 9))
    navigation[0, 3:6] = scale * along
    navigation[0, 6:9] = scale * np.cross(along, v)
    return np.array([scale * along @ v]), {"navigation": navigation, "sound_speed": np.array([[along @ v]])}


@register_instrument(
    Kind(
        "velocities along the beams",
        role="velocity",
        components=speed_components("radial"),
        equation=observe,
        side=(Component("azimuth", "deg"), Component("slant", "deg")),
    ),
    example={"sigma_m_s": 0.01, "sound_speed": 0.01},
)
class Janus(AidSpec):
    """The velocities of the vessel along four acoustic beams to the bottom."""

    errors = (*AidSpec.errors, "sound_speed")

    kind: Literal["janus"] = "janus"
    sigma: NonNegative = quantity("m_s")
    bias: NonNegative = quantity("m_s", 0.0)
    slant: float = quantity("deg", np.radians(30.0))
    reach: Positive = quantity("m", inf)
    sound_speed: NonNegative = 0.0

    def channels(self):
        """The beams."""
        return ("1", "2", "3", "4")

    def blocks(self):
        """One state, which all beams share: the scale [-] of the speed of sound."""
        return (StateBlock("sound_speed", 1, "", self.sound_speed),)

    def build(self, name, seed):
        """The instrument of one run."""
        return _Janus(self, name, seed)


class _Janus(ChannelInstrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.beams, self.slant, self.reach = direction(AZIMUTHS, spec.slant), spec.slant, spec.reach

    def observe(self, tap):
        """(n, 4, 1) velocities along the beams, before noise."""
        forward, starboard, down = turn_to_body(tap.attitude, tap.velocity).T[:, :, None]
        x, y, z = self.beams.T
        scale = 1.0 + self.block("sound_speed", tap.time)
        return (scale * (x * forward + y * starboard + z * down))[:, :, None]

    def side_information(self, tap):
        """(n, 4, 2) azimuth and slant of the beams."""
        beams = np.stack([AZIMUTHS, np.full(4, self.slant)], axis=1)
        return np.broadcast_to(beams, (len(tap.time), 4, 2))

    def available(self, tap):
        """Which beams meet the bottom within reach."""
        bottom = self.surroundings.get("bottom")
        if bottom is None:
            return None
        roll, pitch, _ = tap.attitude.T[:, :, None]
        x, y, z = self.beams.T
        downwards = -np.sin(pitch) * x + np.cos(pitch) * (np.sin(roll) * y + np.cos(roll) * z)
        altitude = tap.position[:, 2] + bottom.depth(tap.position, tap.time)
        return altitude[:, None] <= self.reach * downwards
