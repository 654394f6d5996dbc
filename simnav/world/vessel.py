"""The vessel: its initial state and its response to commands."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from simnav.spec import NonNegative, Positive, Spec, quantity

__all__ = ["Start", "Vessel"]

_HALF_PI = 1.5707963267948966


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


class Vessel(Spec):
    """Response of a vessel to its commands: critically damped second-order lags, so that accelerations are continuous.

    Attributes
    ----------
    kind : str
        ``ship`` stays on the surface; ``uuv`` follows dive commands, and its wave motion decreases with depth.
    speed_time_constant, turn_time_constant, climb_time_constant : float
        Time constants of speed, yaw rate and flight-path angle [s].
    turn_rate : float
        Limit of the autopilot's yaw rate [rad/s].
    heel : float
        Outward heel in a turn, as a multiple of the centripetal acceleration in g [-]; about the ratio of the height
        of the centre of gravity above the centre of lateral resistance to the metacentric height.
    """

    kind: Literal["ship", "uuv"] = "ship"
    speed_time_constant: Positive = quantity("s", 15.0)
    turn_time_constant: Positive = quantity("s", 4.0)
    climb_time_constant: Positive = quantity("s", 3.0)
    turn_rate: Annotated[float, Field(gt=0.0, lt=_HALF_PI)] = quantity("deg_s", 0.017453292519943295)
    heel: NonNegative = 0.0
