"""One beam of a DVL. Four of them on a vessel share the error of the speed of sound."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.kinds import Kind, speed_components
from simnav.sensors import AidSpec, Instrument, register_instrument
from simnav.sensors.instrument import turn_to_body
from simnav.spec import NonNegative, quantity


def direction(azimuth, slant):
    """(3,) unit vector of the beam in body axes; the slant is from straight down."""
    level = np.sin(slant)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.cos(slant)])


def observe(point, sheet):
    """The velocity along the beam, with the scale of the speed of sound; the Jacobian by block."""
    beam = direction(sheet.details["azimuth"], sheet.details["slant"])
    scale = 1.0 + point.blocks["sound_speed"][0]
    along, v = point.dcm @ beam, point.velocity
    navigation = np.zeros((1, 9))
    navigation[0, 3:6] = scale * along
    navigation[0, 6:9] = scale * np.cross(along, v)
    return np.array([scale * along @ v]), {"navigation": navigation, "sound_speed": np.array([[along @ v]])}


@register_instrument(
    Kind(
        "velocity along one beam",
        role="velocity",
        components=speed_components("radial"),
        equation=observe,
        datasheet=("azimuth", "slant"),
    ),
    example={"sigma_m_s": 0.01, "azimuth_deg": 45.0, "sound_speed": 0.01},
)
class Beam(AidSpec):
    """The velocity of the vessel along one acoustic beam to the bottom."""

    errors = (*AidSpec.errors, "sound_speed")

    kind: Literal["beam"] = "beam"
    sigma: NonNegative = quantity("m_s")
    azimuth: float = quantity("deg")
    slant: float = quantity("deg", np.radians(30.0))
    sound_speed: NonNegative = 0.0

    def blocks(self):
        """One state, which all beams of a vessel share: the scale [-] of the speed of sound."""
        return (StateBlock("sound_speed", 1, "", self.sound_speed, shared="sound_speed"),)

    def build(self, name, seed):
        """The beam of one run."""
        return _Beam(self, name, seed)


class _Beam(Instrument):
    def __init__(self, spec, name, seed):
        super().__init__(spec, name, seed)
        self.direction = direction(spec.azimuth, spec.slant)

    def observe(self, tap):
        """(n, 1) velocities along the beam, before noise."""
        x, y, z = self.direction
        forward, starboard, down = turn_to_body(tap.attitude, tap.velocity).T
        return ((1.0 + self.block("sound_speed", tap.time)[:, 0]) * (x * forward + y * starboard + z * down))[:, None]
