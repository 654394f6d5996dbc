"""The state of the vessel at the start of a run."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from simnav.spec import NonNegative, Spec, quantity

__all__ = ["Start"]


class Start(Spec):
    """State of the vessel at time 0, on an even keel.

    Attributes
    ----------
    latitude, longitude : float
        Geodetic latitude and longitude [rad].
    height : float
        Height of the vessel's reference point above the ellipsoid [m]; the sea surface is at 0.
    depth : float
        Depth of the reference point, positive down [m]; instead of ``height``.
    heading : float
        Direction of the bow, clockwise from north [rad].
    speed : float
        Speed through the water [m/s].
    """

    latitude: Annotated[float, Field(gt=-1.5533, lt=1.5533)] = quantity("deg")
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
