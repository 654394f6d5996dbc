"""Fixes of an ultra-short baseline (USBL): a transceiver under a ship measures where the transponder of the vehicle is.

The transceiver measures range, bearing and elevation: the vector m from itself to the transponder in the level axes of
the ship (bow, starboard, down). With the true vector v, its errors are those of the range, along v, and of both angles,
across it, as a share of the range. The ship turns it with its heading h and adds its own position s, and sends the
vehicle the fix ::

    fix = s + R(h) exp(a + n) (1 + k) m

with the error a of the ship's attitude and of the mounting of the transceiver (block ``alignment``, constant in a run),
white noise n of the attitude, and the relative error k of the speed of sound (block ``sound_speed``). ``sigma``,
``bias`` and ``bias_instability`` are errors of s. Roll and pitch of the ship are compensated. Each reading says (its
side information) the measured vector m and h. Its sigma follows from them: that is the fix with its own sigma that such
systems deliver.

A fix is valid when the transponder answers. It comes to the vehicle when the answer has gone to the ship, and, by
sound, the message back: ``latency`` of the table ``timing`` is what the ship's computer and the modem take besides.
The next interrogation waits for the answer. There is no fix beyond the cone of the transceiver or its reach, in a
shadow of the sound, or while the transponder is not under water.

Figures of classes and their sources are in ``docs/how-to/use-acoustic-positioning.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi, radians
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from simnav.blocks import StateBlock
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rotation_vector
from simnav.kinds import Component, Datasheet, Kind, NavigationPoint, geodetic_components
from simnav.recording import AidStream
from simnav.sensors.acoustics import AcousticInstrument, AcousticSpec, paths
from simnav.sensors.instrument import ZERO, Instrument, SigmaTriple, Triple, register_instrument
from simnav.sensors.planned_track import PlannedTrack, check_track
from simnav.spec import NonNegative, Vector, quantity
from simnav.types import NO_SIDE, Array, TapStates
from simnav.world.water_column import Figures

__all__ = ["GRADES", "Grade", "UsblFix"]


@dataclass(frozen=True)
class Grade:
    """Figures of a class of instruments. They are defaults; every one is a key of its own.

    Attributes
    ----------
    accuracy : float
        One sigma of the position in each direction across the line of sight, as a share of the slant range.
    range_noise : float
        One sigma of the range [m].
    cone : float
        Largest angle from straight down [rad].
    """

    accuracy: float
    range_noise: float
    cone: float


_IDENTITY = np.eye(3)
#: Their sources are in ``docs/how-to/use-acoustic-positioning.md``.
GRADES: Mapping[str, Grade] = {
    "precise": Grade(0.00085, 0.02, radians(100.0)),
    "ordinary": Grade(0.00144, 0.02, radians(100.0)),
    "simple": Grade(0.00244, 0.02, radians(60.0)),
}


def _ship_axes(heading: Array) -> Array:
    """(n, 3, 3) matrices from the level axes of the ship (bow, starboard, down) to north-east-down."""
    c, s = np.cos(heading), np.sin(heading)
    turn = np.zeros((len(c), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    return turn


def _moves(vector: Array) -> Array:
    """(n, 3, 3) matrices whose products with a small rotation vector are what it moves (n, 3) vectors by."""
    x, y, z = vector.T
    found = np.zeros((len(vector), 3, 3))
    found[:, 0, 1], found[:, 0, 2], found[:, 1, 2] = z, -y, x
    found[:, 1, 0], found[:, 2, 0], found[:, 2, 1] = -z, y, -x
    return found


def observe(point: NavigationPoint, sheet: Datasheet) -> tuple[Array, dict[str, Array]]:
    """The fix and its Jacobian by block (`simnav.kinds.Observation`)."""
    blocks, arm = point.blocks, point.dcm @ sheet.lever_arm
    measured, heading = point.side[:3], point.side[3:4]
    scale = blocks["sound_speed"][0] if "sound_speed" in blocks else 0.0
    turned = dcm_from_rotation_vector(blocks["alignment"]) @ measured if "alignment" in blocks else measured
    ship = _ship_axes(heading)[0]
    navigation = np.zeros((3, 9))
    navigation[:, :3] = _IDENTITY
    navigation[:, 6:9] = _moves(arm[None])[0]
    jacobian = {"navigation": navigation}
    if "alignment" in blocks:
        jacobian["alignment"] = ship @ _moves(turned[None])[0]
    if "sound_speed" in blocks:
        jacobian["sound_speed"] = (ship @ turned)[:, None]
    # The measured vector is itself wrong by a small share; in the error of a small turn this is of second order.
    reading = displace(point.position, arm + ship @ ((1.0 + scale) * turned - measured))
    return reading, jacobian


def _across(side: Array, accuracy: float, range_noise: float, attitude: Array) -> Array:
    """(..., 3) variances north-east-down [m^2] of the noise of range, angles and attitude, from side information."""
    given = np.atleast_2d(side)
    ship = _ship_axes(given[:, 3])
    vector = (ship @ given[:, :3, None])[:, :, 0]
    square = np.sum(vector**2, axis=1)[:, None]
    share = vector**2 / np.maximum(square, 1e-12)
    variance: Array = range_noise**2 * share + accuracy**2 * square * (1.0 - share)
    variance += ((ship @ _moves(given[:, :3])) ** 2) @ attitude**2
    return variance.reshape(*side.shape[:-1], 3)


def reading_sigma(side: Array, sheet: Datasheet) -> Array:
    """The noise of a fix (`simnav.kinds.ReadingSigma`)."""
    details = sheet.details
    noise = np.asarray(details["attitude_noise"])
    return np.asarray(np.sqrt(sheet.sigma**2 + _across(side, details["accuracy"], details["range_noise"], noise)))


@register_instrument(
    Kind(
        "position of the transponder, by an ultra-short baseline under a ship",
        role="fix",
        components=geodetic_components(height=True),
        equation=observe,
        geodetic=True,
        datasheet=("accuracy", "range_noise", "attitude_noise"),
        side=(
            Component("forward", "m"),
            Component("starboard", "m"),
            Component("down", "m"),
            Component("ship_heading", "deg"),
        ),
        reading_sigma=reading_sigma,
    ),
    example={
        "rate_hz": 0.5,
        "latitude_deg": 54.0,
        "longitude_deg": 7.9,
        "alignment_deg": 0.1,
        "lever_arm_m": [0, 0, 3],
    },
)
class UsblFix(AcousticSpec):
    """Position of the vehicle by an ultra-short baseline under a ship. Its channel is ``transponder``.

    The ship sails at constant speed along straight legs, from the first point to the last one, and stops there.

    Attributes
    ----------
    grade : str
        Class of the instrument, for the next three figures where they are not given: ``precise``, ``ordinary`` or
        ``simple``.
    accuracy : float
        One sigma of the position in each direction across the line of sight, as a share of the slant range.
    range_noise : float
        One sigma of the range [m].
    cone : float
        Largest angle from straight down at which there is a fix [rad].
    sigma, bias, bias_instability : tuple of float
        Errors of the position of the transceiver, north-east-down [m].
    alignment : tuple of float
        One sigma of the error of attitude and mounting, constant in a run, about bow, starboard and down [rad].
    attitude_noise : tuple of float
        One sigma of the white part of the error of the ship's attitude [rad].
    latitude, longitude : float
        Origin of the points [rad].
    north, east : tuple of float
        Points of the way of the ship [m]; with one point it lies there.
    speed : float
        Speed of the ship [m/s].
    heading : float
        Heading of a ship that lies still [rad]; one that sails has that of its leg.
    transceiver_depth : float
        Depth of the transceiver [m].
    returned : str
        How the fix comes back to the vehicle: by ``sound`` or ``cable``.
    reflection_angle : float
        One sigma of the error of both angles of an echo [rad].

    Examples
    --------
    >>> spec = UsblFix.from_toml({"latitude_deg": 54.0, "longitude_deg": 7.9, "grade": "simple"})
    >>> spec.accuracy, spec.channels(), spec.blocks()
    (0.00244, ('transponder',), ())
    """

    errors: ClassVar[tuple[str, ...]] = (*AcousticSpec.errors, "accuracy", "range_noise", "attitude_noise", "alignment")

    kind: Literal["usbl_fix"] = "usbl_fix"
    grade: Literal["precise", "ordinary", "simple"] = "ordinary"
    accuracy: float = quantity("percent", GRADES["ordinary"].accuracy, ge=0.0, le=0.1)
    range_noise: NonNegative = quantity("m", GRADES["ordinary"].range_noise)
    cone: float = quantity("deg", GRADES["ordinary"].cone, gt=0.0, le=pi)
    sigma: SigmaTriple = quantity("m", (0.2, 0.2, 0.2))
    bias: SigmaTriple = quantity("m", ZERO)
    bias_instability: SigmaTriple = quantity("m", ZERO)
    alignment: SigmaTriple = quantity("deg", ZERO)
    attitude_noise: SigmaTriple = quantity("deg", ZERO)
    latitude: float = quantity("deg", ge=-pi / 2, le=pi / 2)
    longitude: float = quantity("deg")
    north: Figures = quantity("m", (0.0,))
    east: Figures = quantity("m", (0.0,))
    speed: NonNegative = quantity("m_s", 0.0)
    heading: float = quantity("deg", 0.0)
    transceiver_depth: float = quantity("m", 5.0)
    returned: Literal["sound", "cable"] = "sound"
    reflection_angle: NonNegative = quantity("deg", radians(5.0))
    lever_arm: Vector = quantity("m", ZERO)
    fixed_bias: Triple = quantity("m", ZERO)

    @model_validator(mode="before")
    @classmethod
    def _figures_of_the_grade(cls, given: Any) -> Any:
        """What is not given is that of the class."""
        grade = GRADES.get(given.get("grade", "ordinary")) if isinstance(given, Mapping) else None
        return given if grade is None else {**vars(grade), **given}

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not self.transceiver_depth > 0.0:
            raise ValueError(
                f"transceiver_depth_m = {self.transceiver_depth:g}: the transceiver should be below the surface, so "
                "the depth above 0"
            )
        check_track(self.north, self.east, self.speed)
        return self

    def channels(self) -> tuple[str, ...]:
        """The transponder."""
        return ("transponder",)

    def blocks(self) -> tuple[StateBlock, ...]:
        """Alignment and speed of sound, as far as they have errors."""
        found = []
        if any(self.alignment):
            found.append(StateBlock("alignment", 3, "deg", self.alignment))
        if self.sound_speed:
            found.append(StateBlock("sound_speed", 1, "", self.sound_speed))
        return tuple(found)

    def travels(self) -> int:
        """See `AcousticSpec.travels`."""
        return 2 if self.returned == "sound" else 1

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _UsblFix(self, name, seed)


@dataclass(frozen=True)
class _Fixes:
    """What n interrogations give: fixes without errors of the ship's position, error by echoes, side information."""

    there: NDArray[np.bool_]
    value: Array
    false: Array
    side: Array
    time: Array


class _UsblFix(AcousticInstrument):
    """Parameters as of `ChannelInstrument`."""

    def __init__(self, spec: UsblFix, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec
        self.origin = np.array([spec.latitude, spec.longitude, -spec.transceiver_depth])
        self.track = PlannedTrack(spec.north, spec.east, spec.speed, spec.heading)
        self._angles = self._stream("transponder", "angles")

    def ship(self, time: Array) -> tuple[Array, Array]:
        """(n, 3) true positions of the transceiver and (n,) headings of the ship at n times."""
        offset, heading = self.track.at(time)
        return displace(self.origin, np.column_stack([offset, np.zeros(len(time))])), heading

    def observe(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.observe`."""
        fixes = self.heard(tap)
        return np.asarray(self.definition.add_error(fixes.value, fixes.false)[:, None])

    def side_information(self, tap: TapStates) -> Array:
        """See `ChannelInstrument.side_information`."""
        return np.asarray(self.heard(tap).side[:, None])

    def available(self, tap: TapStates) -> NDArray[np.bool_]:
        """See `ChannelInstrument.available`."""
        return np.asarray(self.heard(tap).there[:, None])

    def noise_sigma(self, observed: Array, side: Array = NO_SIDE) -> Array:
        """See `ChannelInstrument.noise_sigma`: of the ship's position. That of the acoustics is in `observe`."""
        return np.broadcast_to(self.sigma, observed.shape).copy()

    def sense(self, tap: TapStates) -> AidStream:
        """See `ChannelInstrument.sense`."""
        found, fixes, spec = super().sense(tap), self.heard(tap), self.spec
        more = _across(found.side, spec.accuracy, spec.range_noise, np.array(spec.attitude_noise))
        found = replace(found, sigma=np.sqrt(found.sigma**2 + more))
        return self.labelled(tap, found, fixes.false[:, None], spec.travels() * fixes.time[:, None])

    def _hear(self, tap: TapStates) -> _Fixes:
        spec, n = self.spec, len(tap.time)
        drawn = self._angles.standard_normal((n, 6))
        detour, turned = (a[:, 0] for a in self.echoes(tap))
        place, heading = self.ship(tap.time)
        path = paths(self.surroundings, place, displace(tap.position, self.lever_displacement(tap)))
        down = np.divide(path.vector[:, 2], path.distance, out=np.ones(n), where=path.distance > 0.0)
        there = np.isfinite(path.time) & (path.distance <= spec.reach) & (down >= np.cos(spec.cone) - 1e-12)
        there &= self.pinged(tap.time, np.where(there, path.time, np.nan)[:, None])
        axes = _ship_axes(heading)
        seen = np.einsum("nji,nj->ni", axes, path.vectors(spec.correction, spec.assumed_speed))
        seen = np.where(there[:, None], seen, 0.0)
        length = np.linalg.norm(seen, axis=1)
        sight = np.where(length[:, None] > 0.0, seen / np.where(length > 0.0, length, 1.0)[:, None], [0.0, 0.0, 1.0])
        first = np.cross(sight, np.where(abs(sight[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
        first /= np.linalg.norm(first, axis=1)[:, None]
        across = np.stack([first, np.cross(sight, first)], axis=1)
        angles = spec.accuracy * drawn[:, 1:3]
        noise = (spec.range_noise * drawn[:, 0])[:, None] * sight
        noise += length[:, None] * np.einsum("nk,nki->ni", angles, across)
        bent = sight + spec.reflection_angle * np.einsum("nk,nki->ni", turned, across)
        bent /= np.linalg.norm(bent, axis=1)[:, None]
        echo = np.where(detour[:, None] > 0.0, (length + detour)[:, None] * bent - seen, 0.0)
        scale = 1.0 + self.speed_error(tap.time)[:, None]
        measured = scale * (seen + noise)
        error = np.array(spec.attitude_noise) * drawn[:, 3:6]
        if any(spec.alignment):
            error = error + self.block("alignment", tap.time)
        turn = axes @ dcm_from_rotation_vector(error)
        ned = np.einsum("nij,nj->ni", turn, measured)
        false = np.einsum("nij,nj->ni", turn, scale * echo)
        value = displace(place, ned)
        # The error of a fix by an echo in its own metres, as `Kind.add_error` adds it.
        false = np.where(detour[:, None] > 0.0, relative_position(displace(value, false), value), 0.0)
        side = np.concatenate([measured + scale * echo, heading[:, None]], axis=1)
        return _Fixes(there, value, false, side, path.time)
