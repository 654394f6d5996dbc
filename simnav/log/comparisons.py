"""Comparisons between the streams of a log: what two of them say about the same motion, and how they differ.

Each comparison takes all `Streams` as they are read, and gives the differences as a `Residual`, or None where a stream
is absent or the motion says nothing. It has parameters for what is no mistake of reading: biases, small mounting
angles, lever arms, scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from simnav.geometry.earth import displace, earth_rate, gravity, relative_position
from simnav.geometry.rotation import dcm_from_rotation_vector, dcm_from_rpy, rotation_vector_from_dcm, skew, wrap_angle
from simnav.kinds import BODY_VELOCITY, DEPTH, HEADING, HORIZONTAL_POSITION, POSITION, VELOCITY, WATER_SPEED
from simnav.log.channel import Series
from simnav.log.inertial import Inertial
from simnav.log.likelihood import Residual
from simnav.log.reference import Track
from simnav.types import KINDS, Array

__all__ = ["COURSE_FROM", "GAP", "MOST", "Streams", "comparisons"]

#: Times at which streams are compared at most; interval of the IMU [s].
MOST, _INTERVAL = 593, 1.0  # a prime number: in hours of a log they do not keep step with fixes that are held out
#: Holes of the reference that are bridged, in its usual spacings.
GAP = 3.0
#: A course has a meaning from this speed on [m/s]; over so many seconds it is taken.
COURSE_FROM, _COURSE_OVER = 0.7, 8.0
#: Over so many seconds a heading is differenced.
_TURN_OVER = 4.0
#: By how many times its interpolation error the usual size of a difference is larger.
_BETWEEN = 2.2
#: Readings of which a mean is taken for the scale.
_FEW = 9
#: Where in a spacing series are read, to average them.
_PHASES = np.array([-0.375, -0.125, 0.125, 0.375])
#: Prior standard deviations of parameters of small effect; that of a lever arm is of large ships.
_MOUNTING, _GYROSCOPE, _ACCELEROMETER = np.radians(4.0), 0.003, 0.3
_ARM, _SCALE, _DVL_BIAS = 20.0, 0.03, 0.05
#: Usual sizes of differences: turn in a second [rad], force [m/s^2], velocity [m/s], heading, position [m].
_TURN, _FORCE, _SPEED, _HEADING, _PLACE = np.radians(0.3), 0.3, 0.15, np.radians(4.0), 2.0


#: What follows from each part of the reference.
_FROM = {
    "position": ("position", "moved", "velocity"),
    "velocity": ("velocity", "given velocity"),
    "attitude": ("attitude", "dcm", "rate"),
}


@dataclass(frozen=True, eq=False)
class Streams:
    """All streams of a recording, as they are read.

    Attributes
    ----------
    position : Series
        Of the reference.
    velocity, attitude : Series or None
        Of the reference.
    imu : Inertial or None
        The IMU.
    instruments : mapping of str to (str, Series, (3,) array)
        Kind, readings and lever arm of the instruments that are measured.
    field : mapping of str to array
        Field of the Earth at the magnetometers, north-east-down [T].
    begin : float
        Before this time nothing is compared [s].
    late : float
        By how much the clock of the reference is late [s].
    """

    position: Series
    velocity: Series | None
    attitude: Series | None
    imu: Inertial | None
    instruments: Mapping[str, tuple[str, Series, Array]]
    field: Mapping[str, Array] = field(default_factory=dict)
    begin: float = -np.inf
    late: float = 0.0

    def altered(self, **changes: Any) -> Streams:
        """The same streams, with some read otherwise; what does not change is not interpolated again."""
        other = replace(self, **changes)
        changed = set(changes) & set(_FROM)
        if not changed:
            other.__dict__.update(tracks=self.tracks, known=self.known)
            return other
        gone = {what for part in changed for what in _FROM[part]}
        other.__dict__["tracks"] = {part: track for part, track in self.tracks.items() if part not in changed}
        other.__dict__["known"] = {key: found for key, found in self.known.items() if key[0] not in gone}
        return other

    def with_instrument(self, name: str, **changes: Any) -> Streams:
        """The same streams, with another series of one instrument."""
        kind, series, arm = self.instruments[name]
        return self.altered(instruments={**self.instruments, name: (kind, replace(series, **changes), arm)})

    def with_reference(self, part: str, **changes: Any) -> Streams:
        """The same streams, with another series of one part of the reference."""
        return self.altered(**{part: replace(getattr(self, part), **changes)})

    def series(self, name: str) -> Series:
        """The readings of an instrument, or of a part of the reference."""
        part = name.removeprefix("reference.")
        return self.instruments[name][1] if part == name else getattr(self, part)

    @cached_property
    def known(self) -> dict[tuple[Any, ...], Array]:
        """What the reference says at times at which it was asked already."""
        return {}

    @cached_property
    def tracks(self) -> dict[str, Track | None]:
        """The parts of the reference as splines, as far as they were needed."""
        return {}

    def _part(self, part: str, time: Array) -> Array:
        """(n, 3) values of a part of the reference at n times, its clock set right; of positions metres."""
        if part not in self.tracks:
            series: Series | None = getattr(self, part)
            gap = GAP * self.spacing
            if series is None:
                self.tracks[part] = None
            elif part == "position":
                self.tracks[part] = Track(series.time, relative_position(series.value, series.value[0]), gap)
            else:
                value = np.unwrap(series.value, axis=0) if part == "attitude" else series.value
                self.tracks[part] = Track(series.time, value, gap)
        track = self.tracks[part]
        return np.full((len(time), 3), np.nan) if track is None else track.known(time + self.late)

    def _once(self, what: str, time: Array, found: Callable[[], Array], span: float = 0.0) -> Array:
        key = (what, span, self.late, time.tobytes())
        if key not in self.known:
            self.known[key] = found()
            self.known[key].flags.writeable = False
        return self.known[key]

    @cached_property
    def spacing(self) -> float:
        """Usual spacing of the positions [s]."""
        return float(np.median(np.diff(self.position.time))) if len(self.position.time) > 1 else 1.0

    @cached_property
    def level_known(self) -> bool:
        """Whether the attitude has roll and pitch, and not only constants in their place."""
        return self.attitude is not None and bool(np.ptp(self.attitude.value[:, :2], axis=0).all())

    @cached_property
    def height_known(self) -> bool:
        """Whether the positions have a height, and not only a constant in its place."""
        return bool(np.ptp(self.position.value[:, 2]))

    @cached_property
    def grid(self) -> Array:
        """Times of the comparisons [s]."""
        first = max(float(self.position.time[0]), self.begin)
        last = float(self.position.time[-1])
        step = max(_INTERVAL, (last - first) / MOST)
        return np.asarray(first + step * np.arange(max(0, int((last - first) / step))), dtype=np.float64)

    def places(self, time: Array) -> Array:
        """(n, 3) positions of the reference [rad, rad, m]."""
        return self._once("position", time, lambda: displace(self.position.value[0], self._part("position", time)))

    def velocities(self, time: Array) -> Array:
        """(n, 3) velocities of the reference, else by differences of its positions over a few seconds [m/s]."""

        def both() -> Array:
            found = self.given_velocities(time)
            whole = bool(np.isfinite(found).all())
            return (
                found if whole else np.where(np.isfinite(found), found, self.moved(time, max(2.0, 2.0 * self.spacing)))
            )

        return self._once("velocity", time, both)

    def given_velocities(self, time: Array) -> Array:
        """(n, 3) velocities that the reference states [m/s]; not a number without them."""
        return self._once("given velocity", time, lambda: self._part("velocity", time))

    def moved(self, time: Array, span: float) -> Array:
        """(n, 3) mean velocities from differences of the positions about n times [m/s].

        They are averaged over a spacing of the positions: between two fixes an interpolation has less noise than at a
        fix, and a delay of half a spacing would seem the better one.
        """

        def mean() -> Array:
            found = []
            for shift in _PHASES * self.spacing:
                a, b = self.places(time + shift - 0.5 * span), self.places(time + shift + 0.5 * span)
                found.append(relative_position(b, a) / span)
            return np.asarray(np.mean(found, axis=0))

        return self._once("moved", time, mean, span)

    @cached_property
    def between(self) -> float:
        """Variance of the error with which the stated velocity is interpolated [m^2/s^2].

        Each of its values is interpolated from its neighbours by a cubic. The reference of a vessel in waves that has a
        value a second does not say how she moves between them.
        """
        if self.velocity is None or len(self.velocity.time) < 8:
            return 0.0
        v = self.velocity.value
        error = v[3:-3] - (9.0 * (v[2:-4] + v[4:-2]) - (v[:-6] + v[6:])) / 16.0
        return float(np.nan_to_num(np.nanmedian(np.abs(error), axis=0)).max() * 1.4826) ** 2

    def attitudes(self, time: Array) -> Array:
        """(n, 3) roll, pitch, yaw of the reference [rad]."""
        return self._once("attitude", time, lambda: wrap_angle(self._part("attitude", time)))

    def headings(self) -> dict[str, Callable[[Array], Array]]:
        """By name, what gives the heading at n times [rad]: the reference and the compasses."""
        found: dict[str, Callable[[Array], Array]] = {}
        if self.attitude is not None:
            found["reference.attitude"] = lambda time: self.attitudes(time)[:, 2]
        for name, (kind, series, _) in self.instruments.items():
            if KINDS[kind].equation == HEADING and len(series.time) > 1:
                found[name] = _interpolated(series)
        return found

    def pose(self, time: Array) -> Array | None:
        """(n, 3) roll, pitch, yaw of the reference, else the heading of a compass and no tilt."""
        if self.attitude is not None:
            return self.attitudes(time)
        for of in self.headings().values():
            yaw = of(time)
            return np.stack([0.0 * yaw, 0.0 * yaw, yaw], axis=-1)
        return None


def _interpolated(series: Series) -> Callable[[Array], Array]:
    angle = np.unwrap(series.value[:, 0])
    spacing = float(np.median(np.diff(series.time)))
    longest = max(2.0, 4.0 * spacing)

    def at(time: Array) -> Array:
        after = np.clip(np.searchsorted(series.time, time), 1, len(series.time) - 1)
        gap = series.time[after] - series.time[after - 1]
        known = (time >= series.time[0]) & (time <= series.time[-1]) & (gap <= longest)
        mean = np.mean([np.interp(time + shift, series.time, angle) for shift in _PHASES * max(spacing, 1.0)], axis=0)
        return np.where(known, mean, np.nan)

    return at


def _scaled(value: Array) -> Array:
    """(n, d, 1) derivatives by the scale of an instrument: its readings, as means over a few.

    With the readings themselves a scale that makes the noise smaller would be fitted to it.
    """
    known = np.isfinite(value)
    count = uniform_filter1d(known.astype(np.float64), _FEW, axis=0, mode="nearest")
    mean = uniform_filter1d(np.where(known, value, 0.0), _FEW, axis=0, mode="nearest")
    return np.asarray(np.where(known, mean / np.maximum(count, 1e-9), np.nan))[:, :, None]


def _constant(n: int, d: int) -> Array:
    return np.tile(np.eye(d), (n, 1, 1))


def _residual(value: Array, size: float | Array, *parts: tuple[Array, float]) -> Residual | None:
    """From differences, their usual size and pairs of derivatives and prior standard deviations.

    Derivatives are those of the instrument, not of the reference: the noise of the latter would be fitted to itself.
    """
    d = value.shape[1]
    design = np.concatenate([p for p, _ in parts], axis=2) if parts else np.zeros((*value.shape, 0))
    spread = np.concatenate([np.full(p.shape[2], s) for p, s in parts]) if parts else np.zeros(0)
    known = np.isfinite(value) & np.isfinite(design).all(axis=2)
    some = known.any(axis=1)
    if np.sum(some) < 8:
        return None
    value = np.where(known, value, np.nan)
    return Residual(value[some], np.broadcast_to(np.asarray(size, dtype=np.float64), (d,)), design[some], spread)


def comparisons(s: Streams) -> dict[tuple[str, ...], Callable[[Streams], Residual | None]]:
    """All comparisons of some streams, by the names of the streams that take part.

    Streams are ``gyroscope``, ``accelerometer``, ``reference.position``, ``reference.velocity``,
    ``reference.attitude``, and instruments by name.
    """
    found: dict[tuple[str, ...], Callable[[Streams], Residual | None]] = {}
    place, speed, pose = "reference.position", "reference.velocity", "reference.attitude"
    motion = (speed,) if s.velocity is not None else (place,)
    if s.imu is not None:
        found["gyroscope", "accelerometer"] = _turn_of_gravity
        if s.level_known:
            found["gyroscope", pose] = _turn_of_attitude
            found[("accelerometer", pose, *motion)] = _force
        else:
            found[("accelerometer", *motion)] = _force_along_course
        for name in s.headings():
            if not (name == pose and s.level_known):
                found["gyroscope", "accelerometer", name] = lambda t, name=name: _turn_of_heading(t, name)  # type: ignore[misc]
        found["gyroscope", "accelerometer", place] = _turn_of_course
    if s.velocity is not None:
        found[speed, place] = _velocity_and_positions
    orientation = (pose,) if s.attitude is not None else tuple(s.headings())[:1]
    for name in s.headings():
        found[name, place] = lambda t, name=name: _heading_and_course(t, name)  # type: ignore[misc]
    for name, (kind, _, _) in s.instruments.items():
        equation = KINDS[kind].equation
        compare: Callable[[Streams, str], Residual | None] | None = None
        others: tuple[str, ...] = ()
        if equation in (POSITION, HORIZONTAL_POSITION):
            compare, others = _fix, (place,)
        elif equation == BODY_VELOCITY and orientation:
            compare, others = _body_velocity, (*motion, *orientation)
        elif equation == VELOCITY:
            compare, others = _velocity, motion
        elif equation == HEADING and s.attitude is not None:
            compare, others = _heading, (pose,)
        elif equation == WATER_SPEED and orientation:
            compare, others = _water_speed, (*motion, *orientation)
        elif equation == DEPTH and s.height_known:
            compare, others = _depth, (place,)
        elif name in s.field and s.level_known:
            compare, others = _magnetic_field, (pose,)
        if compare is not None:
            found[(name, *others)] = lambda t, name=name, compare=compare: compare(t, name)  # type: ignore[misc]
    return found


def _imu(s: Streams) -> Inertial:
    assert s.imu is not None
    return s.imu


def _turn_of_attitude(s: Streams) -> Residual | None:
    """Rotation vectors of the gyroscopes and of the reference, over intervals, with the rate of the Earth."""
    time, n = s.grid, len(s.grid)
    own = _imu(s).turns(time, time + _INTERVAL)
    first, second = s.attitudes(time), s.attitudes(time + _INTERVAL)
    known = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    a, b = dcm_from_rpy(np.nan_to_num(first)), dcm_from_rpy(np.nan_to_num(second))
    turned = np.asarray(rotation_vector_from_dcm(np.swapaxes(a, 1, 2) @ b))
    turned += _INTERVAL * np.einsum("nji,j->ni", a, earth_rate(float(s.position.value[0, 0])))
    turned[~known] = np.nan
    return _residual(own - turned, _TURN, (_constant(n, 3) * _INTERVAL, _GYROSCOPE), (skew(own), _MOUNTING))


def _turn_of_gravity(s: Streams) -> Residual | None:
    """The specific force turns backwards in the body as the body turns; without a reference."""
    time = s.grid
    middle = time + _INTERVAL
    before, after = _imu(s).forces(time, middle), _imu(s).forces(middle, middle + _INTERVAL)
    turned = _imu(s).turns(time + 0.5 * _INTERVAL, middle + 0.5 * _INTERVAL)
    known = np.asarray(np.isfinite(turned).all(axis=1), dtype=np.bool_)
    dcm = dcm_from_rotation_vector(np.where(known[:, None], turned, 0.0))
    difference = after - np.asarray(np.einsum("nji,nj->ni", dcm, before))
    difference[~known] = np.nan
    later = _imu(s).turns(middle, middle + _INTERVAL) - _imu(s).turns(time, middle)
    rates = [_imu(s).turns(t - 0.5, t + 0.5) for t in (time, time + _INTERVAL, time + 2.0 * _INTERVAL)]
    jerk = rates[2] - 2.0 * rates[1] + rates[0]  # of the lever arm from the point about which the vessel rolls
    return _residual(difference, _FORCE, (skew(jerk), _ARM), (_constant(len(time), 3), 0.01), (skew(later), 0.3))


def _force(s: Streams) -> Residual | None:
    """Specific forces of the accelerometers and of the reference: gravity and its change of velocity."""
    time, n = s.grid, len(s.grid)
    own = _imu(s).forces(time, time + _INTERVAL)
    pose = s.attitudes(time + 0.5 * _INTERVAL)
    known = np.isfinite(pose).all(axis=1)
    dcm = dcm_from_rpy(np.nan_to_num(pose))
    place = s.position.value[0]
    up = np.array([0.0, 0.0, -float(gravity(place[0], place[2]))])
    change: Array = np.zeros((n, 3))
    if s.velocity is not None:
        change = np.nan_to_num((s.velocities(time + _INTERVAL) - s.velocities(time)) / _INTERVAL)
    pull = np.einsum("nji,nj->ni", dcm, up + change)
    pull[~known] = np.nan
    turned = [_imu(s).turns(t - 0.5, t + 0.5) for t in (time, time + _INTERVAL)]
    return _residual(own - pull, _FORCE, (_constant(n, 3), _ACCELEROMETER), (skew(own), _MOUNTING),
                     (skew(turned[1] - turned[0]), _ARM))  # fmt: skip


def _force_along_course(s: Streams) -> Residual | None:
    """Without roll and pitch: acceleration along the course, speed times turn across it, and gravity."""
    time, n, span = s.grid, len(s.grid), max(2.0, 2.0 * s.spacing)
    own = _imu(s).forces(time - 0.5 * span, time + 0.5 * span)
    velocity = s.velocities(time)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    change = (s.velocities(time + 0.5 * span) - s.velocities(time - 0.5 * span)) / span
    moving = speed > 3.0 * COURSE_FROM
    c, e = velocity[:, 0] / np.where(moving, speed, np.nan), velocity[:, 1] / np.where(moving, speed, np.nan)
    place = s.position.value[0]
    wanted = np.stack([c * change[:, 0] + e * change[:, 1], c * change[:, 1] - e * change[:, 0],
                       change[:, 2] - float(gravity(place[0], place[2]))], axis=-1)  # fmt: skip
    return _residual(own - wanted, 2.0 * _FORCE, (_constant(n, 3), _ACCELEROMETER), (skew(own), _MOUNTING))


def _yaw_change(s: Streams, time: Array, span: float) -> Array:
    """(n,) turns about the vertical by the gyroscopes, the vertical being that of the accelerometers [rad]."""
    imu = _imu(s)
    pull = imu.forces(time - 1.0, time + span + 1.0)
    down = -pull / np.linalg.norm(pull, axis=1)[:, None]
    parts = [imu.turns(time + k * 0.25 * span, time + (k + 1) * 0.25 * span) for k in range(4)]
    return np.asarray(np.sum(sum(parts) * down, axis=1))


def _turn_of_heading(s: Streams, name: str) -> Residual | None:
    """Turn of the gyroscopes and of a heading over a few seconds."""
    time, heading = s.grid, s.headings()[name]
    difference = _yaw_change(s, time, _TURN_OVER) - heading(time + _TURN_OVER) + heading(time)
    return _residual(wrap_angle(difference[:, None]), np.radians(1.0),
                     (_constant(len(time), 1), _TURN_OVER * _GYROSCOPE))  # fmt: skip


def _courses(s: Streams, time: Array) -> Array:
    """(n,) courses from the positions alone [rad]; not a number where the vessel is slow."""
    moved = s.moved(time, max(4.0, 3.0 * s.spacing))
    slow = ~(np.hypot(moved[:, 0], moved[:, 1]) > COURSE_FROM)
    return np.where(slow, np.nan, np.arctan2(moved[:, 1], moved[:, 0]))


def _turn_of_course(s: Streams) -> Residual | None:
    """Turn of the gyroscopes and of the course."""
    time = s.grid
    course = wrap_angle(_courses(s, time + _COURSE_OVER) - _courses(s, time))
    difference = np.asarray(wrap_angle(_yaw_change(s, time, _COURSE_OVER) - course))
    return _residual(difference[:, None], 2.0 * _HEADING, (_constant(len(time), 1), _COURSE_OVER * _GYROSCOPE))


def _heading_and_course(s: Streams, name: str) -> Residual | None:
    """A heading and the course: they part by leeway and current, and more where a vessel moves sideways."""
    time = s.grid
    difference = wrap_angle(s.headings()[name](time) - _courses(s, time))
    return _residual(np.stack([2.0 * np.sin(0.5 * difference)], axis=-1), 4.0 * _HEADING)


def _velocity_and_positions(s: Streams) -> Residual | None:
    """The velocity of the reference and the differences of its positions."""
    time, span = s.grid, max(2.0, 2.0 * s.spacing)
    steps = [s.given_velocities(time + k * 0.25 * span) for k in (-2, -1, 0, 1, 2)]
    mean = (steps[0] + 4.0 * steps[1] + 2.0 * steps[2] + 4.0 * steps[3] + steps[4]) / 12.0  # Simpson's rule
    moved = s.moved(time, span)
    return _residual(mean - moved, 2.0 * _SPEED, (np.nan_to_num(_scaled(mean)), _SCALE))


def _picked(series: Series, begin: float) -> tuple[Array, Array]:
    inside = np.flatnonzero(series.time >= begin)
    if len(inside) > MOST:
        inside = inside[np.linspace(0, len(inside) - 1, MOST).round().astype(np.intp)]
    return series.time[inside], series.value[inside]


def _rotated(s: Streams, time: Array) -> tuple[Array, Array] | None:
    """(n, 3, 3) attitudes and (n, 3) angular rates at n times; not a number where they are not known."""
    pose = s.pose(time)
    if pose is None:
        return None
    if s.attitude is not None:
        dcm = s._once("dcm", time, lambda: _turned(s, time, pose)[0])
        return dcm, s._once("rate", time, lambda: _turned(s, time, pose)[1])
    return _turned(s, time, pose)


def _turned(s: Streams, time: Array, pose: Array) -> tuple[Array, Array]:
    around = np.stack([p for p in (s.pose(time - 0.5), s.pose(time + 0.5)) if p is not None])
    dcm = dcm_from_rpy(np.nan_to_num(pose))
    before, after = dcm_from_rpy(np.nan_to_num(around))
    rate = np.asarray(rotation_vector_from_dcm(np.swapaxes(before, 1, 2) @ after))
    rate[~np.isfinite(around).all(axis=(0, 2))] = 0.0
    dcm[~np.isfinite(pose).all(axis=1)] = np.nan
    return dcm, rate


def _body_velocity(s: Streams, name: str) -> Residual | None:
    """A DVL and the velocity of the reference in body axes."""
    _, series, arm = s.instruments[name]
    time, value = _picked(series, s.begin)
    turned = _rotated(s, time)
    if turned is None:
        return None
    dcm, rate = turned
    own = np.einsum("nji,nj->ni", dcm, s.velocities(time)) + np.cross(rate, arm)
    size = float(np.hypot(_SPEED, _BETWEEN * s.between**0.5)) if s.velocity is not None else 2.0 * _SPEED
    return _residual(value - own, size, (_constant(len(time), 3), _DVL_BIAS), (skew(value), _MOUNTING),
                     (skew(rate), _ARM), (_scaled(value), _SCALE))  # fmt: skip


def _velocity(s: Streams, name: str) -> Residual | None:
    """Velocities over the ground of an instrument and of the reference."""
    time, value = _picked(s.instruments[name][1], s.begin)
    velocity = s.velocities(time)
    turned = _rotated(s, time)
    arm = () if turned is None else ((np.nan_to_num(turned[0]) @ skew(turned[1]), _ARM),)
    return _residual(value - velocity, 2.0 * _SPEED, (_constant(len(time), 3), _DVL_BIAS), *arm)


def _fix(s: Streams, name: str) -> Residual | None:
    """Positions of an instrument and of the reference, apart by a lever arm or a constant offset."""
    _, series, arm = s.instruments[name]
    time, value = _picked(series, s.begin)
    place = s.places(time)
    d = value.shape[1]
    measured = value if d == 3 else np.column_stack([value, place[:, 2]])
    difference = relative_position(measured, np.where(np.isfinite(place), place, np.nan))[:, :d]
    turned = _rotated(s, time)
    if turned is None:
        return _residual(difference, _PLACE, (_constant(len(time), d), _ARM))
    dcm = np.nan_to_num(turned[0])[:, :d]
    return _residual(difference - dcm @ arm, _PLACE, (_constant(len(time), d), _ARM), (dcm, _ARM))


def _heading(s: Streams, name: str) -> Residual | None:
    """A compass and the heading of the reference."""
    time, value = _picked(s.instruments[name][1], s.begin)
    difference = wrap_angle(value - s.attitudes(time)[:, 2:])
    return _residual(2.0 * np.sin(0.5 * difference), _HEADING, (_constant(len(time), 1), _MOUNTING))


def _water_speed(s: Streams, name: str) -> Residual | None:
    """A speed log and the forward speed of the reference, which differ by the current."""
    time, value = _picked(s.instruments[name][1], s.begin)
    pose, velocity = s.pose(time), s.velocities(time)
    if pose is None:
        return None
    ahead = velocity[:, 0] * np.cos(pose[:, 2]) + velocity[:, 1] * np.sin(pose[:, 2])
    return _residual(value - ahead[:, None], 1.5 * _SPEED, (_constant(len(time), 1), 0.7),
                     (_scaled(value), 0.05))  # fmt: skip


def _depth(s: Streams, name: str) -> Residual | None:
    """A depth and the height of the reference, which differ by tide and geoid."""
    time, value = _picked(s.instruments[name][1], s.begin)
    return _residual(value + s.places(time)[:, 2:], 0.5, (_constant(len(time), 1), 20.0))


def _magnetic_field(s: Streams, name: str) -> Residual | None:
    """A magnetometer and the field of the Earth in body axes, apart by hard and soft iron."""
    time, value = _picked(s.instruments[name][1], s.begin)
    turned = _rotated(s, time)
    if turned is None:
        return None
    strength = float(np.linalg.norm(s.field[name]))
    own = np.einsum("nji,j->ni", turned[0], s.field[name]) / strength
    known = np.nan_to_num(own)
    return _residual(value / strength - own, 0.05, (_constant(len(time), 3), 0.2),
                     (skew(known), _MOUNTING), (known[:, :, None], 0.1))  # fmt: skip
