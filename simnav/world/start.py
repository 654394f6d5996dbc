"""The state of the vessel at the start of a run."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from simnav.spec import NonNegative, Spec, quantity

__all__ = ["HIGHEST_LATITUDE", "POLAR", "Start"]

#: Latitudes from here on, north or south, are refused [rad].
HIGHEST_LATITUDE = math.radians(89.0)
#: What a message says of them.
POLAR = (
    "should be less than 89 degrees north or south: nearer to a pole the axes north and east, in which states and "
    "errors are, turn too fast"
)


def _not_polar(latitude: float) -> float:
    if not abs(latitude) < HIGHEST_LATITUDE - 1e-12:
        raise ValueError(POLAR)
    return latitude


class Start(Spec):
    """State of the vessel at time 0, on an even keel.

    Attributes
    ----------
    latitude, longitude : float
        Geodetic latitude and longitude [rad]; the latitude is below `HIGHEST_LATITUDE`, north or south.
    height : float
        Height of the vessel's reference point above the ellipsoid [m]; the sea surface is at 0.
    depth : float
        Depth of the reference point, positive down [m]; instead of ``height``.
    heading : float
        Direction of the bow, clockwise from north [rad].
    speed : float
        Speed through the water [m/s].
    """

    latitude: Annotated[float, AfterValidator(_not_polar)] = quantity("deg")
    longitude: Annotated[float, Field(ge=-3.1416, le=3.1416)] = quantity("deg")
    height: float = quantity("m", 0.0)
    depth: float | None = quantity("m", None)
    heading: Annotated[float, Field(ge=-6.2832, le=6.2832)] = quantity("deg", 0.0)
    speed: NonNegative = quantity("m_s", 0.0)

    @model_validator(mode="after")
    def _one_of_height_and_depth(self) -> Self:
        if self.depth is not None and self.height != 0.0:
            raise ValueError("give height_m or depth_m, not both")
        return self

    @property
    def altitude(self) -> float:
        """Height above the ellipsoid [m], from ``height`` or ``depth``."""
        return self.height if self.depth is None else -self.depth
