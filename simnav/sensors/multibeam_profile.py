"""A multibeam echo sounder that gives profiles across the track: the distance to the bottom along each of its beams.

Its equation, and the errors that it has, are in `simnav.sensors.soundings`; figures and their sources are in
``docs/how-to/use-terrain.md``.
"""

from __future__ import annotations

from math import radians
from typing import Literal

from pydantic import Field

from simnav.kinds import Component, Kind
from simnav.sensors.instrument import register_instrument
from simnav.sensors.soundings import SIDE, SoundingSpec, observe, observe_all, reading_sigma
from simnav.spec import quantity

__all__ = ["MultibeamProfile"]


@register_instrument(
    Kind(
        "distance to the bottom along each beam of a profile across the track",
        role="other",
        components=(Component("slant_range", "m", limit=12e3),),
        equation=observe,
        datasheet=("axis", "beam_width", "swath"),
        side=SIDE,
        reading_sigma=reading_sigma,
        observations=observe_all,
    ),
    example={"rate_hz": 0.5, "beams": 5, "sigma_m": 0.05, "lever_arm_m": [0.5, 0.0, 0.2]},
)
class MultibeamProfile(SoundingSpec):
    """Distances to the bottom along beams across the track. Its channels are ``1``, ``2``, ..., from port to starboard.

    Attributes
    ----------
    beams : int
        Their number.
    swath : float
        Angle from the first beam to the last one [rad].

    Examples
    --------
    >>> MultibeamProfile.from_toml({"beams": 3}).channels()
    ('1', '2', '3')
    """

    kind: Literal["multibeam_profile"] = "multibeam_profile"
    beams: int = Field(15, ge=2, le=512)
    swath: float = quantity("deg", radians(90.0), gt=0.0, le=radians(140.0))

    def channels(self) -> tuple[str, ...]:
        """The beams."""
        return tuple(str(k) for k in range(1, self.beams + 1))
