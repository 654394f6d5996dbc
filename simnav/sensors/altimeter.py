"""An altimeter: the distance to the bottom along one beam.

Its equation, and the errors that it has, are in `simnav.sensors.soundings`; figures of classes and their sources are in
``docs/how-to/use-terrain.md``.
"""

from __future__ import annotations

from typing import Literal

from simnav.kinds import Component, Kind
from simnav.sensors.instrument import register_instrument
from simnav.sensors.soundings import SIDE, SoundingSpec, observe, observe_all, reading_sigma

__all__ = ["Altimeter"]


@register_instrument(
    Kind(
        "distance to the bottom, by the travel time of sound",
        role="other",
        components=(Component("range", "m", limit=12e3),),
        equation=observe,
        datasheet=("axis", "beam_width"),
        side=SIDE,
        reading_sigma=reading_sigma,
        observations=observe_all,
    ),
    example={"rate_hz": 1.0, "sigma_m": 0.05, "lever_arm_m": [0.5, 0.0, 0.2]},
)
class Altimeter(SoundingSpec):
    """Distance to the bottom along one beam, downwards. Its channel is ``down``.

    Examples
    --------
    >>> spec = Altimeter.from_toml({"sigma_m": 0.1, "sound_speed_percent": 0.2})
    >>> spec.channels(), [block.name for block in spec.blocks()]
    (('down',), ['sound_speed'])
    """

    kind: Literal["altimeter"] = "altimeter"

    def channels(self) -> tuple[str, ...]:
        """The beam."""
        return ("down",)
