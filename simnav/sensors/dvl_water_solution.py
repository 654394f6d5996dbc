"""The velocity through the water that a Doppler velocity log solves from its beams with water track.

It is the second instrument of one device, as `simnav.sensors.dvl_solution` is for bottom track, and solves in the same
way. A reading is the velocity of the transducer relative to the layer of water that the beams hear, in body axes::

    reading = R(mounting)' (C' (v - c) + w x l) (1 + k)

with the attitude C, the velocity over the ground v, the horizontal velocity c of the water (block ``current``), the
angular rate w, the lever arm l, and the relative error k of the assumed speed of sound (block ``sound_speed``). A
phased array has no such error of its level components, and measures the vertical one times
``sqrt((1 + k)^2 - sin^2 s) / cos s`` with the slant angle s of its beams (`simnav.sensors.dvl_beams`).
"""

from __future__ import annotations

from math import cos, radians, sin, sqrt
from typing import ClassVar, Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.geometry.rotation import dcm_from_rotation_vector, skew
from simnav.kinds import Kind, NavigationPoint, speed_components
from simnav.sensors.dvl_beams import CLASSES
from simnav.sensors.dvl_solution import BeamSolution
from simnav.sensors.instrument import ZERO, SigmaTriple, register_instrument
from simnav.spec import NonNegative, Positive, Vector, quantity
from simnav.types import Array, Datasheet

__all__ = ["DvlWaterSolution"]


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The velocity through the water and its Jacobian by block (`simnav.kinds.Observation`)."""
    blocks = point.blocks
    velocity = point.velocity.copy()
    velocity[:2] -= blocks["current"]
    turn = dcm_from_rotation_vector(blocks["mounting"]) if "mounting" in blocks else np.eye(3)
    k = blocks["sound_speed"][0] if "sound_speed" in blocks else 0.0
    if sheet.details["array"] == "phased":
        slant = sheet.details["slant"]
        steered = sqrt((1.0 + k) ** 2 - sin(slant) ** 2)
        scale, slope = (
            np.array([1.0, 1.0, steered / cos(slant)]),
            np.array([0.0, 0.0, (1.0 + k) / steered / cos(slant)]),
        )
    else:
        scale, slope = np.full(3, 1.0 + k), np.ones(3)
    own = turn.T @ (point.dcm.T @ velocity + np.cross(point.angular_rate, sheet.lever_arm))
    by_velocity = scale[:, None] * (point.dcm @ turn).T
    navigation = np.zeros((3, 9))
    navigation[:, 3:6] = by_velocity
    navigation[:, 6:9] = by_velocity @ skew(velocity)
    jacobian = {"navigation": navigation, "current": -by_velocity[:, :2]}
    if "mounting" in blocks:
        jacobian["mounting"] = scale[:, None] * skew(own)
    if "sound_speed" in blocks:
        jacobian["sound_speed"] = (slope * own)[:, None]
    return scale * own, jacobian


@register_instrument(
    Kind(
        "velocity through the water of the transducer that the beams give, in body axes",
        role="velocity",
        components=speed_components("forward", "starboard", "down"),
        equation=observe,
        datasheet=("array", "slant"),
    ),
    example={"beams": "water_track", "sigma_m_s": [0.01, 0.01, 0.005]},
    beside={"water_track": {"kind": "dvl_beams", "frequency_khz": 600, "track": "water"}},
)
class DvlWaterSolution(BeamSolution):
    """Velocity through the water in body axes, solved from the beams of another instrument with water track.

    Attributes
    ----------
    array : str
        ``piston`` or ``phased``, as of the beams.
    slant : float
        Angle of the beams from straight down [rad], for a phased array.
    sigma, bias, sound_speed, mounting, lever_arm
        What the datasheet says about the velocity; the error itself comes from the beams.
    current, current_time : float
        One sigma of each horizontal component of the velocity of the water [m/s], and its correlation time [s].

    Examples
    --------
    >>> spec = DvlWaterSolution.from_toml({"sigma_m_s": [0.01, 0.01, 0.005], "mounting_deg": [0.1, 0.1, 0.1]})
    >>> [block.name for block in spec.blocks()]
    ['mounting', 'current']
    """

    errors: ClassVar[tuple[str, ...]] = (*BeamSolution.errors, "sound_speed", "mounting", "current")
    track: ClassVar[Literal["bottom", "water"]] = "water"

    kind: Literal["dvl_water_solution"] = "dvl_water_solution"
    array: Literal["piston", "phased"] = "piston"
    slant: float = quantity("deg", CLASSES[600.0].slant, gt=0.0, le=radians(60.0))
    sigma: SigmaTriple = quantity("m_s")
    bias: SigmaTriple = quantity("m_s", ZERO)
    sound_speed: NonNegative = quantity("percent", 0.0)
    mounting: SigmaTriple = quantity("deg", ZERO)
    current: Positive = quantity("m_s", 0.5)
    current_time: Positive = quantity("s", 1800.0)
    lever_arm: Vector = quantity("m", ZERO)

    def blocks(self) -> tuple[StateBlock, ...]:
        """Speed of sound and mounting as far as they have errors, and the velocity of the water."""
        found = []
        if self.sound_speed:
            found.append(StateBlock("sound_speed", 1, "", self.sound_speed))
        if any(self.mounting):
            found.append(StateBlock("mounting", 3, "deg", self.mounting))
        found.append(StateBlock("current", 2, "m_s", self.current, "gauss_markov", correlation_time=self.current_time))
        return tuple(found)
