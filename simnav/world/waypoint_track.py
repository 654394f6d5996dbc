"""Vessels on a trajectory of the user: their limits, and the kind that passes waypoints at given times or speeds.

Kinds that read their poses from files are in `simnav.log.own_track`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, model_validator

from simnav.spec import Positive, SpecError, quantity
from simnav.types import Array
from simnav.world.smooth_track import Limits, Poses, SmoothTrack, metres_per_unit
from simnav.world.trajectory import Voyage
from simnav.world.vessel import Vessel, register_vessel

__all__ = ["TrackVessel", "WaypointTrack"]

#: Pieces of a leg between which the time is integrated from the speed.
_PIECES = 64


def _numbers(value: Any) -> Any:
    return (value,) if isinstance(value, (int, float)) and not isinstance(value, bool) else value


#: Several numbers; TOML may have one number without a list.
Numbers = Annotated[tuple[float, ...], BeforeValidator(_numbers)]


class TrackVessel(Vessel):
    """Base of the vessels that follow a trajectory of the user.

    Attributes
    ----------
    max_speed, max_acceleration, max_turn_rate, course_speed : float
        See `simnav.world.smooth_track.Limits`.
    """

    starts: ClassVar[bool] = False
    obeys: ClassVar[bool] = False
    steered: ClassVar[bool] = True

    max_speed: Positive = quantity("m_s", 40.0, description="a faster motion is refused as a jump")
    max_acceleration: Positive = quantity("m_s2", 6.0, description="a larger acceleration is refused as a jump")
    max_turn_rate: Positive = quantity(
        "deg_s", 1.0471975511965976, description="a quicker roll, pitch or turn is refused as a jump"
    )
    course_speed: Positive = quantity(
        "m_s", 0.2, description="below it the course made good says nothing about the heading"
    )

    def limits(self) -> Limits:
        """The limits of the vessel."""
        return Limits(self.max_speed, self.max_acceleration, self.max_turn_rate, self.course_speed)


@register_vessel
class WaypointTrack(TrackVessel):
    """A vessel that passes given waypoints, at given times or at given speeds, on a smooth curve.

    Attributes
    ----------
    latitude, longitude : tuple of float
        The waypoints [rad]; the run starts at the first.
    height, depth : tuple of float
        Height above the ellipsoid, or depth below it [m]: one for each waypoint, or one for all. Default: 0.
    time : tuple of float
        Times of the waypoints, ascending [s].
    speed : tuple of float
        Instead of times: the speed over ground at each waypoint, or one for all [m/s]. In between it changes smoothly
        and monotonically with the distance (the cubic of F. N. Fritsch and R. E. Carlson, *Monotone piecewise cubic
        interpolation*, SIAM J. Numerical Analysis 17(2), 1980).
    """

    kind: Literal["waypoint_track"] = "waypoint_track"
    latitude: Numbers = quantity("deg", description="of the waypoints")
    longitude: Numbers = quantity("deg", description="of the waypoints")
    height: Numbers = quantity("m", (), description="above the ellipsoid; one each, or one for all; default 0")
    depth: Numbers = quantity("m", (), description="instead of the height")
    time: Numbers = quantity("s", (), description="of the waypoints")
    speed: Numbers = quantity("m_s", (), description="instead of times; one each, or one for all")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        n = len(self.latitude)
        if n < 2:
            raise ValueError(f"latitude_deg has {n} waypoint; at least 2 are wanted")
        for name, key, one in (
            ("longitude", "longitude_deg", False),
            ("height", "height_m", True),
            ("depth", "depth_m", True),
            ("time", "time_s", False),
            ("speed", "speed_m_s", True),
        ):
            length = len(getattr(self, name))
            if length and length != n and not (one and length == 1):
                raise ValueError(
                    f"{key} has {length} numbers, latitude_deg has {n}" + ("; give one each, or one for all" * one)
                )
        if self.height and self.depth:
            raise ValueError("give height_m or depth_m, not both")
        if bool(self.time) == bool(self.speed):
            raise ValueError("give the time_s of each waypoint or the speed_m_s there" + ", not both" * bool(self.time))
        if any(not v > 0.0 for v in self.speed):
            raise ValueError(
                f"speed_m_s = {list(self.speed)}: should be greater than 0; give times for a vessel that stops"
            )
        return self

    def poses(self) -> Poses:
        """The waypoints with their times, and with speeds also poses in between.

        Raises
        ------
        SpecError
            If they are no trajectory.
        """
        n = len(self.latitude)
        height = -np.array(self.depth) if self.depth else np.array(self.height or (0.0,))
        place = np.stack([self.latitude, np.unwrap(self.longitude), np.broadcast_to(height, n)], axis=1)
        names = [f"waypoint {k}" for k in range(1, n + 1)]
        if self.time:
            return Poses("vessel", np.array(self.time), place, None, names)
        leg = np.linalg.norm(np.diff(place, axis=0) * metres_per_unit(0.5 * (place[1:] + place[:-1])), axis=1)
        if not (leg > 0.0).all():
            k = int(np.argmin(leg)) + 1
            raise SpecError(f"waypoint {k + 1} is where waypoint {k} is; give times for a vessel that stops")
        time, between = _timed(place, leg, np.broadcast_to(np.array(self.speed), n))
        number = np.arange(len(time)) / _PIECES + 1.0
        return Poses("vessel", time, between, None, [f"waypoint {k:.3g}" for k in number])

    def trajectory(self, voyage: Voyage) -> SmoothTrack:
        """See `Vessel.trajectory`."""
        return SmoothTrack(self.poses(), voyage, self.limits())


def _timed(place: Array, leg: Array, speed: Array) -> tuple[Array, Array]:
    """Times and positions along a smooth curve through waypoints, `_PIECES` for each leg.

    Parameters
    ----------
    place : (n, 3) array
        Waypoints: latitude, longitude [rad], height [m].
    leg : (n - 1,) array
        Straight distances between them [m]; their sums are the parameter of the curve.
    speed : (n,) array
        Speeds at the waypoints [m/s].
    """
    from scipy.interpolate import CubicSpline, PchipInterpolator

    chord = np.concatenate([[0.0], np.cumsum(leg)])
    curve = CubicSpline(chord, place)
    node = np.concatenate([(chord[:-1, None] + leg[:, None] * np.arange(_PIECES) / _PIECES).ravel(), chord[-1:]])
    # Gauss-Legendre in each piece, first for the length of the curve and then for the time.
    at, weight = np.polynomial.legendre.leggauss(5)
    half = 0.5 * np.diff(node)

    def lengths(u: Array) -> Array:
        return np.asarray(np.linalg.norm(curve(u, 1) * metres_per_unit(curve(u)), axis=1))

    inner = (node[:-1, None] + half[:, None] * (1.0 + at)).ravel()
    rate = lengths(inner).reshape(-1, 5)
    length = np.concatenate([[0.0], np.cumsum((rate * weight).sum(axis=1) * half)])
    profile = PchipInterpolator(length[::_PIECES], speed)
    # The length at the inner points: the curve's length is smooth, so that a spline through the nodes gives it.
    along = CubicSpline(node, length)(inner)
    slowness = (rate / profile(along).reshape(-1, 5) * weight).sum(axis=1) * half
    return np.concatenate([[0.0], np.cumsum(slowness)]), curve(node)
