"""Manoeuvres: the commands of the vessel, one after the other.

Each manoeuvre is a `Spec`. `table` converts a list of them into the numeric rows that the motion kernel executes. After
the last one the vessel holds its course, speed and depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from simnav.spec import NonNegative, Positive, Spec, quantity
from simnav.structures import filled, length, structure
from simnav.types import Array

__all__ = ["Accelerate", "Dive", "Hold", "LawnMower", "Manoeuvre", "Surface", "Turn", "Waypoints", "ZigZag", "table"]

HOLD, ACCELERATE, TURN, ZIGZAG, WAYPOINTS, DEPTH = range(6)
#: A manoeuvre of each kind: its duration [s]; speed [m/s] and acceleration [m/s^2]; angle of a turn, of a zigzag or of
#: the path to a depth [rad], rate [rad/s], and radius of a turn or around a point [m]; the first of its points, the one
#: after the last, and 1 if they are relative to the start of the manoeuvre; depth [m].
MANOEUVRE = structure(
    kind=int, duration=float, speed=float, acceleration=float, angle=float, rate=float, radius=float, first_point=int,
    end_point=int, relative=int, depth=float,
)  # fmt: skip
#: Length of an array that holds it.
ROW = length(MANOEUVRE)

Angle = Annotated[float, Field(gt=0.0, lt=1.5707963267948966)]
Point = tuple[float, float]


def _through(first: int, end: int, radius: float, relative: bool = False) -> Array:
    """The kernel's row for points; the arguments are those of `MANOEUVRE`."""
    return filled(
        MANOEUVRE, kind=WAYPOINTS, duration=inf, first_point=first, end_point=end, radius=radius, relative=relative
    )


class Hold(Spec):
    """Hold course, speed and depth for a time."""

    kind: Literal["hold"] = "hold"
    duration: Positive = quantity("s")

    def row(self, points: list[Point]) -> Array:
        """The kernel's row."""
        return filled(MANOEUVRE, kind=HOLD, duration=self.duration)


class Accelerate(Spec):
    """Change to a speed, with a constant acceleration or as fast as possible; hold it until the end of the duration."""

    kind: Literal["accelerate"] = "accelerate"
    speed: NonNegative = quantity("m_s")
    acceleration: Positive | None = quantity("m_s2", None)
    duration: Positive | None = quantity("s", None)

    def row(self, points: list[Point]) -> Array:
        """The kernel's row."""
        return filled(
            MANOEUVRE,
            kind=ACCELERATE,
            duration=self.duration or inf,
            speed=self.speed,
            acceleration=self.acceleration or inf,
        )


class Turn(Spec):
    """Turn by an angle (positive to starboard) or for a time, at a rate or on a radius.

    Without rate and radius the turn rate of the vessel is used. With a duration and no angle, the sign of the rate
    decides the direction.
    """

    kind: Literal["turn"] = "turn"
    angle: float | None = quantity("deg", None)
    rate: float | None = quantity("deg_s", None)
    radius: Positive | None = quantity("m", None)
    duration: Positive | None = quantity("s", None)

    @model_validator(mode="after")
    def _determined(self) -> Self:
        if self.rate is not None and self.radius is not None:
            raise ValueError("a turn has rate_deg_s or radius_m, not both")
        if self.rate == 0.0:
            raise ValueError("rate_deg_s = 0 does not turn; use a hold")
        if (self.angle is None) == (self.duration is None):
            raise ValueError("a turn has angle_deg or duration_s, one of the two")
        if self.angle == 0.0:
            raise ValueError("angle_deg = 0 does not turn; use a hold")
        return self

    def row(self, points: list[Point]) -> Array:
        """The kernel's row."""
        sign = -1.0 if (self.angle if self.angle is not None else self.rate or 1.0) < 0.0 else 1.0
        angle = sign * inf if self.angle is None else self.angle
        return filled(
            MANOEUVRE,
            kind=TURN,
            duration=self.duration or inf,
            angle=angle,
            rate=abs(self.rate or 0.0),
            radius=self.radius or 0.0,
        )


class ZigZag(Spec):
    """Turn until the heading differs from the course by the angle, then by the same angle to the other side."""

    kind: Literal["zigzag"] = "zigzag"
    angle: Angle = quantity("deg")
    rate: Positive | None = quantity("deg_s", None)
    duration: Positive = quantity("s")

    def row(self, points: list[Point]) -> Array:
        """The kernel's row."""
        return filled(MANOEUVRE, kind=ZIGZAG, duration=self.duration, angle=self.angle, rate=self.rate or 0.0)


class Waypoints(Spec):
    """Steer for points (north, east of the start) one after the other; a point is reached within the radius."""

    kind: Literal["waypoints"] = "waypoints"
    points: Annotated[tuple[Point, ...], Field(min_length=1)] = quantity("m")
    acceptance_radius: Positive = quantity("m", 50.0)

    def row(self, points: list[Point]) -> Array:
        """The kernel's row; appends the points."""
        first = len(points)
        points.extend(self.points)
        return _through(first, len(points), self.acceptance_radius)


class LawnMower(Spec):
    """Survey parallel legs, from the present position and along the present heading."""

    kind: Literal["lawn_mower"] = "lawn_mower"
    leg: Positive = quantity("m")
    spacing: Positive = quantity("m")
    legs: Annotated[int, Field(ge=1)] = 4
    first_turn: Literal["starboard", "port"] = "starboard"
    acceptance_radius: Positive = quantity("m", 10.0)

    def row(self, points: list[Point]) -> Array:
        """The kernel's row; appends the ends of the legs, in the axes of the vessel at the start of the survey."""
        first = len(points)
        side = self.spacing if self.first_turn == "starboard" else -self.spacing
        for i in range(self.legs):
            ends = (0.0, self.leg) if i % 2 == 0 else (self.leg, 0.0)
            points.extend((end, i * side) for end in ends)
        del points[first]  # the vessel is at this point already
        return _through(first, len(points), self.acceptance_radius, relative=True)


class Dive(Spec):
    """Go to a depth at a path angle, and hold it."""

    kind: Literal["dive"] = "dive"
    depth: NonNegative = quantity("m")
    angle: Angle = quantity("deg", 0.2617993877991494)

    def row(self, points: list[Point]) -> Array:
        """The kernel's row."""
        return filled(MANOEUVRE, kind=DEPTH, duration=inf, depth=self.depth, angle=self.angle)


class Surface(Spec):
    """Go to the surface at a path angle."""

    kind: Literal["surface"] = "surface"
    angle: Angle = quantity("deg", 0.2617993877991494)

    def row(self, points: list[Point]) -> Array:
        """The kernel's row."""
        return filled(MANOEUVRE, kind=DEPTH, duration=inf, angle=self.angle)


Manoeuvre = Hold | Accelerate | Turn | ZigZag | Waypoints | LawnMower | Dive | Surface


def table(manoeuvres: Sequence[Manoeuvre]) -> tuple[Array, Array]:
    """Rows and points for the motion kernel.

    Returns
    -------
    rows : (n, 11) array
        One `MANOEUVRE` a row.
    points : (m, 2) array
        The waypoints that rows refer to: north and east [m].
    """
    points: list[Point] = []
    rows = [m.row(points) for m in manoeuvres]
    return np.array(rows, dtype=np.float64).reshape(-1, ROW), np.array(points, dtype=np.float64).reshape(-1, 2)
