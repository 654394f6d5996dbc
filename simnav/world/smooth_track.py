"""A trajectory through given poses: smooth at the rate of the IMU, and exact at the poses.

Latitude, longitude and height are cubic splines in time (not-a-knot), so that velocity and acceleration are continuous.
The velocity is their derivative with the radii of the ellipsoid (Groves 2013, eqs. 2.111), and the position of the
truth is its integral by the rule of the mechanization (`simnav.world.trajectory.SampledTrajectory`), a trapezoid over
each sample interval. The errors of the trapezoids add up to dt^2 / 12 times the change of the acceleration (the
Euler-Maclaurin formula), so that the truth goes through the poses to a fraction of a millimetre at the rates of most
IMUs. A run whose rate is so low that it would miss them by a centimetre is refused.

Roll, pitch and heading are cubic splines of the given angles. Without a given heading the bow points along the course
made good. Where the vessel is too slow to have a course, the heading goes over smoothly from the course before to the
course after.

In closed loop the vessel follows the poses by its estimated position, so the true track is aside of them by the error
of the estimate. This offset follows the error through a critically damped lag of second order; where the error jumps,
the lag is as long as the vessel needs at a third of its speed.

Poses that ask for an impossible motion are refused: a jump is a speed, an acceleration or a turn beyond `Limits`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import principal_radii
from simnav.spec import SpecError
from simnav.types import Array
from simnav.world.start import HIGHEST_LATITUDE, POLAR
from simnav.world.trajectory import SampledTrajectory, Voyage

__all__ = ["Limits", "Poses", "SmoothTrack", "metres_per_unit", "smooth_track"]

#: How far the truth may be from a given pose [m]; it decides which rates are refused.
_EXACT = 0.01
#: Shortest time constant with which the vessel follows an error of its estimate [s], and the least speed for it [m/s].
_FOLLOWING, _CREEP = 15.0, 0.2
#: Number of courses between two poses from which the heading is made.
_COURSES = 16
#: Highest pitch of a given attitude [rad].
_PITCH = np.radians(85.0)


@dataclass(frozen=True)
class Limits:
    """What a vessel can do. Poses that ask for more are refused.

    Attributes
    ----------
    speed : float
        Highest speed over ground [m/s].
    acceleration : float
        Largest acceleration [m/s^2].
    turn_rate : float
        Highest rate of roll, pitch and heading [rad/s].
    course_speed : float
        Speed below which the course made good says nothing about the heading [m/s].
    """

    speed: float
    acceleration: float
    turn_rate: float
    course_speed: float = 0.2


@dataclass(frozen=True, eq=False)
class _Offset:
    """How a vessel goes over to another offset from its poses.

    Attributes
    ----------
    wanted, here, rate : (2,) array
        Wanted offset, north and east [m]; the offset and its rate at the last wish [m], [m/s].
    since : float
        Time of the last wish [s].
    lag : float
        Time constant [s].
    """

    wanted: Array
    here: Array
    rate: Array
    since: float
    lag: float


@dataclass(frozen=True, eq=False)
class Poses:
    """n given poses.

    Attributes
    ----------
    source : str
        Where they come from, for messages.
    time : (n,) array
        Ascending times [s]. The run starts at the first.
    position : (n, 3) array
        Latitude, longitude [rad], height [m].
    attitude : (n, 3) array or None
        Roll, pitch, heading [rad]; None: level, with the bow along the course.
    line : sequence of str
        What a message calls each pose, such as ``"line 12"``.
    """

    source: str
    time: Array
    position: Array
    attitude: Array | None
    line: Sequence[str]

    def __post_init__(self) -> None:
        n = len(self.time)
        if n < 2:
            raise SpecError(f"{self.source}: {n} pose is no trajectory; at least 2 are wanted")
        bad = np.flatnonzero(~(np.diff(self.time) > 0.0))
        if bad.size:
            k = int(bad[0]) + 1
            raise SpecError(
                f"{self.source}, {self.line[k]}: the time {self.time[k]:g} s is not after {self.time[k - 1]:g} s of "
                f"{self.line[k - 1]}; poses are in order of time, without duplicates"
            )
        self._refuse(np.any(~np.isfinite(self.position), axis=1), "the position is not finite")
        self._refuse(np.abs(self.position[:, 0]) >= HIGHEST_LATITUDE, f"the latitude {POLAR}")
        if self.attitude is not None:
            self._refuse(np.any(~np.isfinite(self.attitude), axis=1), "the attitude is not finite")
            self._refuse(np.abs(self.attitude[:, 1]) > _PITCH, "the pitch should be within 85 degrees")

    def _refuse(self, wrong: NDArray[np.bool_], what: str) -> None:
        if wrong.any():
            k = int(np.argmax(wrong))
            raise SpecError(f"{self.source}, {self.line[k]}: {what}")


def metres_per_unit(position: Array) -> Array:
    """(n, 3) metres north, east and up per unit of latitude, longitude and height."""
    meridian, prime_vertical = principal_radii(position[:, 0])
    height = position[:, 2]
    return np.stack(
        [meridian + height, (prime_vertical + height) * np.cos(position[:, 0]), np.ones(len(height))], axis=1
    )


#: The value (or the derivative of an order) of a smooth curve at n times: (n,) array, order -> (n, 3) array.
Curve = Callable[[Array, int], Array]


def smooth_track(poses: Poses, departure: float = 0.0) -> Curve:
    """The position as a function of time: geodetic, longitude without jumps at 180 degrees.

    Parameters
    ----------
    poses : Poses
        The given poses.
    departure : float
        Root-mean-square distance along each axis by which the curve may depart from the poses [m], for poses with
        errors; 0: it goes through them. The smoothing spline of C. H. Reinsch, *Smoothing by spline functions*,
        Numerische Mathematik 10, 1967, as FITPACK computes it.
    """
    from scipy.interpolate import BSpline, CubicSpline, splrep

    place = poses.position.copy()
    place[:, 1] = np.unwrap(place[:, 1])
    if departure <= 0.0 or len(place) < 5:
        exact: Curve = CubicSpline(poses.time, place)
        return exact
    scale = metres_per_unit(place)[0] / departure
    middle = place[0]
    fits = [BSpline(*splrep(poses.time, (place[:, i] - middle[i]) * scale[i], s=float(len(place)))) for i in range(3)]

    def curve(time: Array, order: int = 0) -> Array:
        value = np.stack([fit(time, order) / scale[i] for i, fit in enumerate(fits)], axis=-1)
        return value + middle if order == 0 else value

    return curve


class SmoothTrack(SampledTrajectory):
    """The trajectory through given poses (see the module).

    Parameters
    ----------
    poses : Poses
        The given poses.
    voyage : Voyage
        The run.
    limits : Limits
        What the vessel can do.
    departure : float
        See `smooth_track`.
    skip : float
        Time from the first pose to the start of the run [s].

    Raises
    ------
    SpecError
        If the poses end before the run, jump, or change too quickly for the rate of the IMU. The message names the
        poses, and what would be right.
    """

    def __init__(self, poses: Poses, voyage: Voyage, limits: Limits, *, departure: float = 0.0, skip: float = 0.0):
        self._poses, self._limits = poses, limits
        self._first = float(poses.time[0]) + skip
        span = float(poses.time[-1]) - self._first
        if span < voyage.duration - 1e-6:
            raise SpecError(
                f"{poses.source}: the poses reach {max(span, 0.0):g} s from the start of the run, and duration_s = "
                f"{voyage.duration:g}"
            )
        self._last = float(poses.time[-1])
        if departure <= 0.0:
            self._refuse_jumps()
        self._curve = smooth_track(poses, departure)
        self._check_motion(voyage.rate)
        self._angles = self._attitude_curve()
        self._check_turns()
        self._offset: _Offset | None = None
        start = np.array([self._first])
        super().__init__(self._curve(start, 0)[0], voyage)

    def motion(self, time: Array) -> tuple[Array, Array]:
        """See `SampledTrajectory.motion`."""
        moment = np.minimum(self._first + time, self._last)
        velocity = self._velocity_at(moment)
        if self._offset is not None:
            velocity[:, :2] += self._aside(time)[1]
        return velocity, self._angles(moment, 0)

    def steer_by(self, north: float, east: float, heading: float = 0.0) -> None:
        """See `simnav.world.trajectory.Steered.steer_by`. The heading is that of the poses, whatever the estimate."""
        wanted, now = -np.array([north, east]), np.array([self.time])
        here, rate = (a[0] for a in self._aside(now))
        speed = float(np.linalg.norm(self._velocity_at(np.minimum(self._first + now, self._last))[0, :2]))
        # The lag closes a distance d at d / (e tau) at most.
        lag = float(np.linalg.norm(wanted - here)) / (np.e * max(speed / 3.0, _CREEP))
        self._offset = _Offset(wanted, here, rate, self.time, max(lag, _FOLLOWING))

    def _aside(self, time: Array) -> tuple[Array, Array]:
        """(n, 2) offsets from the poses, north and east [m], and their rates [m/s], at n times from now on."""
        if self._offset is None:
            return np.zeros((len(time), 2)), np.zeros((len(time), 2))
        o = self._offset
        t = (time - o.since)[:, None]
        off, slope = o.here - o.wanted, o.rate + (o.here - o.wanted) / o.lag
        decay = np.exp(-t / o.lag)
        return o.wanted + (off + slope * t) * decay, (o.rate - slope * t / o.lag) * decay

    def _velocity_at(self, moment: Array) -> Array:
        velocity = self._curve(moment, 1) * metres_per_unit(self._curve(moment, 0))
        velocity[:, 2] *= -1.0
        return velocity

    def _refuse_jumps(self) -> None:
        """Refuse two poses that are further apart than the vessel can go."""
        poses = self._poses
        place = poses.position.copy()
        place[:, 1] = np.unwrap(place[:, 1])
        middle = 0.5 * (place[1:] + place[:-1])
        distance = np.linalg.norm(np.diff(place, axis=0) * metres_per_unit(middle), axis=1)
        interval = np.diff(poses.time)
        speed = distance / interval
        if (speed > self._limits.speed).any():
            k = int(np.argmax(speed > self._limits.speed))
            raise SpecError(
                f"{poses.source}: the poses jump by {distance[k]:.4g} m in {interval[k]:.4g} s from {poses.line[k]} to "
                f"{poses.line[k + 1]}, which is {speed[k]:.4g} m/s; max_speed_m_s = {self._limits.speed:g}"
            )

    def _check_motion(self, rate: float) -> None:
        """Refuse a speed or an acceleration beyond the limits, and a rate at which the poses would be missed.

        The acceleration of a cubic is linear between the knots, so that its largest value is at one of them.
        """
        knot = self._poses.time
        moment = np.sort(np.concatenate([knot, 0.5 * (knot[1:] + knot[:-1])]))
        speed = np.linalg.norm(self._velocity_at(moment), axis=1)
        self._refuse(moment, speed, self._limits.speed, "moves at", "m/s", "max_speed_m_s", 1.0)
        acceleration = self._curve(knot, 2) * metres_per_unit(self._curve(knot, 0))
        size = np.linalg.norm(acceleration, axis=1)
        self._refuse(knot, size, self._limits.acceleration, "accelerates by", "m/s^2", "max_acceleration_m_s2", 1.0)
        start = np.array([self._first])
        change = acceleration - self._curve(start, 2) * metres_per_unit(self._curve(start, 0))
        most = float(np.linalg.norm(change, axis=1).max())
        if most / (12.0 * rate * rate) > _EXACT:
            raise SpecError(
                f"{self._poses.source}: at {rate:g} samples a second the truth would miss the poses by "
                f"{1e3 * most / (12.0 * rate * rate):.3g} mm, because the acceleration changes by {most:.3g} m/s^2; at "
                f"least {np.ceil(np.sqrt(most / (12.0 * _EXACT))):g} Hz are wanted"
            )

    def _attitude_curve(self) -> Curve:
        from scipy.interpolate import CubicSpline, PchipInterpolator

        poses = self._poses
        if poses.attitude is not None:
            given: Curve = CubicSpline(poses.time, np.unwrap(poses.attitude, axis=0))
            return given
        share = np.arange(_COURSES) / _COURSES
        moment = (poses.time[:-1, None] + np.diff(poses.time)[:, None] * share).ravel()
        moment = np.append(moment, poses.time[-1])
        north, east, _ = self._velocity_at(moment).T
        under_way = np.hypot(north, east) >= self._limits.course_speed
        if not under_way.any():
            raise SpecError(
                f"{poses.source}: the vessel never moves at course_speed_m_s = {self._limits.course_speed:g} or more, "
                "so that its course gives no heading; give the attitude, too"
            )
        course = np.unwrap(np.arctan2(east[under_way], north[under_way]))
        known = moment[under_way]
        if len(known) == 1:  # a single place where it has way
            known, course = np.append(known, known + 1.0), np.append(course, course)
        bend = PchipInterpolator(known, course)

        def heading(moment: Array, order: int) -> Array:
            inside = np.clip(moment, known[0], known[-1])
            return np.where((order > 0) & (inside != moment), 0.0, bend(inside, order))

        def curve(moment: Array, order: int = 0) -> Array:
            level = np.zeros(len(moment))
            return np.stack([level, level, heading(moment, order)], axis=1)

        return curve

    def _check_turns(self) -> None:
        knot = self._poses.time
        moment = np.sort(np.concatenate([knot, 0.5 * (knot[1:] + knot[:-1])]))
        rate = np.abs(self._angles(moment, 1)).max(axis=1)
        self._refuse(moment, rate, self._limits.turn_rate, "turns by", "deg/s", "max_turn_rate_deg_s", np.degrees(1.0))

    def _refuse(self, moment: Array, size: Array, limit: float, does: str, unit: str, key: str, factor: float) -> None:
        if (size > limit).any():
            k = int(np.argmax(size))
            poses = self._poses
            after = int(np.clip(np.searchsorted(poses.time, moment[k]), 1, len(poses.time) - 1))
            raise SpecError(
                f"{poses.source}: the poses jump between {poses.line[after - 1]} and {poses.line[after]}: a smooth "
                f"vessel {does} {factor * size[k]:.4g} {unit} there; {key} = {factor * limit:.4g}"
            )
