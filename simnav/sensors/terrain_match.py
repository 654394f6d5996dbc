"""A terrain-matching computer: horizontal position fixes from the soundings of another instrument and a chart.

It collects the soundings of the instrument ``sounder`` over a window of time. The shape of the track in the window
follows from the velocity over the ground (``velocity``) and the heading, by dead reckoning, and the depth of the
vehicle from its depth sensor; with all their faults and errors. The vehicle counts as level. The profile of depths is
laid on the chart everywhere in a search area (`simnav.world.profile_match`). There is a fix, valid at the end of the
window, if

- there are enough soundings, and no gap of three readings of the other instruments,
- the difference between profile and chart is small,
- the profile fits nowhere else in the area nearly as well, and
- the place is inside of the area, and as sure as the method can tell: to two spacings of the chart.

So a wrong fix comes from the terrain: hills that resemble each other, a bottom without shape, false soundings, the
drift of dead reckoning, and the error of the chart. No label says that a fix is a false match: the device does not know
it. The search area is the whole chart, or a square about a place where the voyage begins, until there is a fix, and
then a square about the last fix, moved by dead reckoning. Both grow with the way. After some windows without a fix the
search begins anew, in the first area.

The sigma of a fix is that of the match, and what the datasheets say of the errors of the track and of the chart. The
faults of a fix are those of the readings that it used; its ``fault_error`` is the difference from the
fix of the same search without them, zero if there is none.

Source of the method: J. P. Golden, *Terrain contour matching (TERCOM): a cruise missile guidance aid*, Proceedings of
SPIE 238, 1980.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, model_validator

from simnav import kinds
from simnav.geometry.earth import displace
from simnav.kinds import KINDS, Kind, geodetic_components
from simnav.recording import AidStream
from simnav.sensors.derived import DerivedInstrument
from simnav.sensors.instrument import AidSpec, Instrument, SigmaPair, register_instrument
from simnav.sensors.observation import HORIZONTAL_POSITION, CompiledInstrument
from simnav.sensors.soundings import beam_angles
from simnav.spec import NonNegative, Positive, quantity
from simnav.types import Array, Datasheet
from simnav.world.depth_grid import DepthGrid, grid_of
from simnav.world.profile_match import Match, Profile, match

__all__ = ["TerrainMatch"]

#: Times closer than this are one and the same [s].
_SAME = 1e-6
#: A gap of more than so many intervals of an instrument is one without readings.
_GAP = 3.0
#: By what the velocity may be wrong in such a gap, in which the last one goes on [m/s].
_UNKNOWN = 1.0
#: A sounding is false if it is so much deeper or shallower than all of the chart [m].
_BEYOND = 10.0
#: Largest standard deviation of a fix, in spacings of the chart, for which the quadratic form of the difference holds.
_UNSURE = 2.0
#: The least share of soundings that fit.
_FITTING = 0.7


@register_instrument(
    Kind("horizontal position", "fix", geodetic_components(height=False), kinds.HORIZONTAL_POSITION, geodetic=True),
    example={"rate_hz": 0.02, "window_s": 50.0},
)
class TerrainMatch(AidSpec):
    """Latitude and longitude of the reference point of the vessel, by matching soundings with the chart.

    Attributes
    ----------
    sounder : str
        Name of the instrument of kind ``altimeter`` or ``multibeam_profile`` whose soundings it matches.
    velocity, heading, depth : str
        Names of the instruments that tell the track in a window: of kind ``dvl``, of kind ``gyrocompass`` or
        ``magnetic_compass``, and of kind ``depth``.
    window : float
        Length of the part of the track whose soundings are matched, at most 1 / rate [s].
    least_soundings : int
        With fewer soundings in a window there is no fix.
    remove_offset : bool
        Whether a common difference of the depths is taken away: a tide, or the bias of a depth sensor.
    largest_difference : float
        There is no fix where the difference between profile and chart is larger: the mean of the smallest four fifths
        of the absolute differences [m].
    uniqueness : float
        There is no fix where the difference is more than this times that of the best place elsewhere; 1: that is not
        asked.
    latitude, longitude : float or None
        Where the voyage begins, by its plan [rad]. Without them the first search is over the whole chart.
    first_search : float
        Half of the sides of the area of the first search about that place [m].
    search : float
        Half of the sides of the area of a search about the last fix [m].
    search_growth : float
        How much these become longer with the way.
    give_up : int
        After so many windows without a fix the search begins anew.
    sigma : (float, float)
        What the datasheet says about a fix; each states its own sigma [m].
    """

    states_sigma: ClassVar[bool] = True

    kind: Literal["terrain_match"] = "terrain_match"
    rate: Positive = quantity("hz", 0.02)
    sounder: str = "altimeter"
    velocity: str = "dvl"
    heading: str = "gyrocompass"
    depth: str = "depth"
    window: Positive = quantity("s", 50.0)
    least_soundings: int = Field(20, ge=6)
    remove_offset: bool = True
    largest_difference: Positive = quantity("m", 0.3)
    uniqueness: float = Field(0.6, gt=0.0, le=1.0)
    latitude: float | None = quantity("deg", None, ge=-np.pi / 2, le=np.pi / 2)
    longitude: float | None = quantity("deg", None)
    first_search: Positive = quantity("m", 300.0)
    search: Positive = quantity("m", 60.0)
    search_growth: NonNegative = quantity("percent", 0.05)
    give_up: int = Field(3, ge=1)
    sigma: SigmaPair = quantity("m", (5.0, 5.0))
    _exact: bool = PrivateAttr(False)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.window * self.rate > 1.0 + 1e-9:
            raise ValueError(
                f"window_s = {self.window:g}: should be at most 1 / rate_hz = {1.0 / self.rate:g} s; windows that "
                "overlap would use a sounding twice"
            )
        if (self.latitude is None) != (self.longitude is None):
            raise ValueError("latitude_deg and longitude_deg of the beginning belong together")
        names = [self.sounder, self.velocity, self.heading, self.depth]
        for key, name in zip(("velocity", "heading", "depth"), names[1:], strict=True):
            if names.count(name) > 1:
                raise ValueError(f"{key} = {name!r}: should be an instrument of its own, but another key names it, too")
        return self

    def sources(self) -> Mapping[str, str | tuple[str, ...]]:
        """See `AidSpec.sources`."""
        return {
            self.sounder: ("altimeter", "multibeam_profile"),
            self.velocity: "dvl",
            self.heading: ("gyrocompass", "magnetic_compass"),
            self.depth: "depth",
        }

    def solves(self) -> tuple[str, ...]:
        """The soundings: what velocity, heading and depth tell of a window is little beside them."""
        return (self.sounder,)

    def fits(self, chart: Callable[[str], Mapping[str, Any] | None]) -> None:
        """See `AidSpec.fits`. Over a bottom of which nothing is known, or a level one, there are no fixes."""
        bottom = chart("bottom")
        if bottom is None or np.size(bottom["depth"]) == 1:
            return
        spacing = float(max(bottom["spacing"]))
        for key, value in (("search_m", self.search), ("first_search_m", self.first_search)):
            if value < spacing:
                raise ValueError(
                    f"{key} = {value:g} is below the spacing of the chart; it should be {spacing:g} or more"
                )
        if self.latitude is not None and self.longitude is not None:
            grid = grid_of(bottom)
            if not grid.lies(self.latitude, self.longitude):
                place = np.array([self.latitude, self.longitude, 0.0])
                raise ValueError(f"latitude_deg and longitude_deg: {grid.outside(place)}")

    def ideal(self) -> Self:
        """A device that is always right: its fixes are the true place, at all times."""
        made = super().ideal()
        made._exact = True
        return made

    def build(self, name: str, seed: int) -> Instrument:
        """See `AidSpec.build`."""
        return _Exact(self, name, seed) if self._exact else _Matcher(self, name, seed)


class _Exact(CompiledInstrument):
    code = HORIZONTAL_POSITION


class _Readings(NamedTuple):
    """Readings of one instrument that are still needed: (n,), (n, d), (n, d), (n,), (n,) and (n, s) arrays."""

    time: Array
    value: Array
    wrong: Array
    faults: NDArray[np.uint32]
    channel: NDArray[np.int16]
    side: Array

    @classmethod
    def of(cls, stream: AidStream) -> _Readings:
        n = len(stream)
        own = (stream.channel, stream.side) if stream.channels else (np.zeros(n, np.int16), np.zeros((n, 0)))
        return cls(stream.time, stream.value, stream.fault_error, stream.faults, *own)

    def joined(self, later: _Readings) -> _Readings:
        columns: list[tuple[Array, Array]] = list(zip(self, later, strict=True))  # type: ignore[arg-type]
        return _Readings._make(np.concatenate(pair) for pair in columns)

    def rows(self, part: slice | NDArray[Any]) -> _Readings:
        return _Readings._make(array[part] for array in self)

    def until(self, time: float) -> _Readings:
        return self.rows(slice(0, int(np.searchsorted(self.time, time + _SAME))))

    def after(self, time: float) -> _Readings:
        return self.rows(slice(int(np.searchsorted(self.time, time + _SAME)), None))

    def from_last(self, time: float) -> _Readings:
        """Those after a time, and the last one until then."""
        return self.rows(slice(max(int(np.searchsorted(self.time, time + _SAME)) - 1, 0), None))

    def right(self) -> _Readings:
        """As they would be without faults."""
        return self._replace(value=self.value - self.wrong)

    def gaps(self, begin: float, end: float, rate: float) -> float:
        """How long it was without readings [s]."""
        edges = np.concatenate([[begin], np.clip(self.time, begin, end), [end]])
        between = np.diff(edges)
        return float(between[between > _GAP / rate + _SAME].sum())


@dataclass(frozen=True, eq=False)
class _Track:
    """The way of the reference point by dead reckoning.

    Attributes
    ----------
    time : (k,) array
        [s]
    place : (k, 2) array
        North and east of the place at the end [m].
    heading : (k,) array
        Without jumps [rad].
    """

    time: Array
    place: Array
    heading: Array

    def at(self, time: Array) -> tuple[Array, Array]:
        """(n, 2) places and (n,) headings."""
        place = np.column_stack([np.interp(time, self.time, self.place[:, j]) for j in range(2)])
        return place, np.interp(time, self.time, self.heading)

    @property
    def length(self) -> float:
        """[m]"""
        return float(np.linalg.norm(np.diff(self.place, axis=0), axis=1).sum())


def _turned(heading: Array, forward: Array | float, starboard: Array | float) -> Array:
    """(n, 2) north and east of level vectors of the vessel."""
    sine, cosine = np.sin(heading), np.cos(heading)
    return np.column_stack([cosine * forward - sine * starboard, sine * forward + cosine * starboard])


def _track(begin: float, end: float, velocity: _Readings, heading: _Readings, arm: Array) -> _Track | None:
    """The track between two times; None where there is no velocity or heading. ``arm`` is that of the velocity."""
    if not len(velocity.time) or not len(heading.time):
        return None
    inside = (velocity.time > begin + _SAME) & (velocity.time < end - _SAME)
    time = np.concatenate([[begin], velocity.time[inside], [end]])
    angle = np.interp(time, heading.time, np.unwrap(heading.value[:, 0]))
    speed = _turned(angle, *(np.interp(time, velocity.time, velocity.value[:, j]) for j in range(2)))
    place = np.zeros((len(time), 2))
    place[1:] = np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time)[:, None], axis=0)
    place -= _turned(angle, arm[0], arm[1])
    return _Track(time, place - place[-1], angle)


class _Search:
    """Where a profile is looked for.

    Attributes
    ----------
    middle, reach : (2,) array
        Middle of the area, north and east of that of the chart, and half of its sides [m].
    """

    def __init__(self, spec: TerrainMatch, grid: DepthGrid):
        self._spec, self._failures = spec, 0
        self._everywhere = spec.latitude is None
        if spec.latitude is None or spec.longitude is None:
            self._begin, self._first = np.zeros(2), grid.half.copy()
        else:
            self._begin = grid.offset(np.array([[spec.latitude, spec.longitude, 0.0]]))[0]
            self._first = np.full(2, spec.first_search)
        self.middle, self.reach = self._begin, self._first

    def move(self, motion: Array, growth: float) -> None:
        """Go on by dead reckoning (2,) [m], by which the areas grow."""
        self.middle, self.reach = self.middle + motion, self.reach + growth
        if not self._everywhere:
            self._begin, self._first = self._begin + motion, self._first + growth

    def fixed(self, place: Array | None) -> None:
        """What the search has found."""
        if place is not None:
            self.middle, self.reach, self._failures = place, np.full(2, self._spec.search), 0
            return
        self._failures += 1
        if self._failures >= self._spec.give_up:
            self.middle, self.reach = self._begin, self._first


#: Value, sigma, faults and the error by faults of a fix.
_Row = tuple[Array, Array, int, Array]


class _Fix(NamedTuple):
    """A fix: place north and east of the middle of the chart, sigma, and the places of the soundings that it used."""

    place: Array
    sigma: Array
    used: NDArray[np.intp]


class _Matcher(DerivedInstrument):
    """Parameters as of `Instrument`."""

    def __init__(self, spec: TerrainMatch, name: str, seed: int):
        super().__init__(spec, name, seed)
        self.spec = spec
        self._kept: dict[str, _Readings] = {}
        self._since = 0.0
        self._search: _Search | None = None

    def derive(self, time: Array, streams: Mapping[str, AidStream], sheets: Mapping[str, Datasheet]) -> AidStream:
        """See `DerivedInstrument.derive`."""
        for name in self.spec.sources():
            new = _Readings.of(streams[name])
            self._kept[name] = self._kept[name].joined(new) if name in self._kept else new
        bottom = sheets[self.spec.sounder].details.get("bottom")
        grid = None if bottom is None or np.size(bottom["depth"]) == 1 else grid_of(bottom)
        kept, lost, rows = [], [], []
        for t in time.tolist():
            found = None if grid is None else self._fix(t, grid, sheets)
            for name, readings in self._kept.items():
                self._kept[name] = readings.from_last(t)
            self._since = t
            if found is None:
                lost.append(t)
            else:
                kept.append(t)
                rows.append(found)
        value, sigma, wrong = (np.array([row[k] for row in rows]).reshape(-1, 2) for k in (0, 1, 3))
        faults = np.array([row[2] for row in rows], dtype=np.uint32)
        return AidStream(
            self.name, self.kind, np.array(kept), value, faults, wrong, sigma, np.array(lost), side=sigma.copy()
        )

    def _fix(
        self, t: float, grid: DepthGrid, sheets: Mapping[str, Datasheet]
    ) -> tuple[Array, Array, int, Array] | None:
        """Value, sigma, faults and their error of the fix at a time; the search goes on."""
        spec = self.spec
        search = self._search = self._search or _Search(spec, grid)
        read = {name: readings.until(t) for name, readings in self._kept.items()}
        velocity, heading = read[spec.velocity], read[spec.heading]
        track = _track(self._since, t, velocity, heading, sheets[spec.velocity].lever_arm)
        blind = max(
            readings.gaps(self._since, t, sheets[name].rate)
            for name, readings in ((spec.velocity, velocity), (spec.heading, heading))
        )
        length = 0.0 if track is None else track.length
        motion = np.zeros(2) if track is None else -track.place[0]
        search.move(motion, spec.search_growth * length + _UNKNOWN * blind)
        found = self._solved(t, grid, read, sheets, search)
        search.fixed(None if found is None else found.place)
        if found is None:
            return None
        value = self._position(grid, found.place)
        begin = max(t - spec.window, 0.0)
        of = [read[spec.sounder].after(begin).rows(found.used)]
        of += [read[name].after(begin) for name in (spec.velocity, spec.heading, spec.depth)]
        faults = 0
        for readings in of:
            faults |= int(np.bitwise_or.reduce(readings.faults, initial=0))
        wrong = np.zeros(2)
        if any(readings.wrong.any() for readings in of):
            right = {name: readings.right() for name, readings in read.items()}
            healthy = self._solved(t, grid, right, sheets, search)
            if healthy is not None:
                wrong = self.definition.difference(value, self._position(grid, healthy.place))
        return value, found.sigma, faults, wrong

    def _position(self, grid: DepthGrid, place: Array) -> Array:
        return displace(grid.middle, np.array([place[0], place[1], 0.0]))[:2]

    def _solved(
        self, t: float, grid: DepthGrid, read: Mapping[str, _Readings], sheets: Mapping[str, Datasheet], search: _Search
    ) -> _Fix | None:
        """The place at the end of a window, if there is one."""
        spec, begin = self.spec, max(t - self.spec.window, 0.0)
        for name in (spec.velocity, spec.heading, spec.depth):
            if not len(read[name].time) or read[name].gaps(begin, t, sheets[name].rate):
                return None
        arm = sheets[spec.velocity].lever_arm
        track = _track(begin, t, read[spec.velocity], read[spec.heading], arm)
        if track is None:
            return None
        time, profile = self._profile(begin, track, read, sheets)
        likely = (profile.depth > grid.depth.min() - _BEYOND) & (profile.depth < grid.depth.max() + _BEYOND)
        index = np.flatnonzero(likely)
        if len(index) < spec.least_soundings:
            return None
        profile = Profile(profile.place[index], profile.depth[index], profile.sigma[index], profile.ping[index])
        found = match(grid, profile, search.middle, search.reach, remove_offset=spec.remove_offset)
        if not found or found[0].difference > spec.largest_difference:
            return None
        best = found[0]
        unique = len(found) == 1 or best.difference <= spec.uniqueness * found[1].difference
        inside = (abs(best.place - search.middle) <= search.reach).all()
        if not unique or not inside or np.mean(best.used) < _FITTING:
            return None
        covariance = best.covariance + self._lasting(best, profile, time[index] - t, sheets)
        sigma = np.sqrt(np.diag(covariance))
        if (sigma > _UNSURE * grid.spacing).any():
            return None
        return _Fix(best.place, sigma, index[best.used])

    def _profile(
        self, begin: float, track: _Track, read: Mapping[str, _Readings], sheets: Mapping[str, Datasheet]
    ) -> tuple[Array, Profile]:
        """The soundings after a time: their times, and where they met the bottom."""
        spec, sheet = self.spec, sheets[self.spec.sounder]
        readings, depth = read[spec.sounder].after(begin), read[spec.depth]
        angle = beam_angles(len(sheet.channels), sheet.details.get("swath", 0.0))[readings.channel]
        distance = readings.value[:, 0]
        place, heading = track.at(readings.time)
        arm = sheet.lever_arm
        place = place + _turned(heading, arm[0], arm[1] + distance * np.sin(angle))
        below = arm[2] - sheets[spec.depth].lever_arm[2] + distance * np.cos(angle)
        noise = KINDS[sheet.kind].reading_sigma
        sigma = sheet.sigma if noise is None else noise(readings.side, sheet)[:, 0]
        _, ping = np.unique(readings.time, return_inverse=True)
        return readings.time, Profile(
            place,
            np.interp(readings.time, depth.time, depth.value[:, 0]) + below,
            np.hypot(sigma * np.cos(angle), sheets[spec.depth].sigma[0]),
            ping,
        )

    def _lasting(self, best: Match, profile: Profile, time: Array, sheets: Mapping[str, Datasheet]) -> Array:
        """(2, 2) covariance by the errors of the track and of the chart that the datasheets state.

        Parameters
        ----------
        best, profile
            The match and the soundings.
        time : (n,) array
            Of the soundings, from the end of the window [s].
        sheets : mapping
            The datasheets.
        """
        velocity, heading, pull = sheets[self.spec.velocity], sheets[self.spec.heading], best.pull
        turned = np.column_stack([-profile.place[:, 1], profile.place[:, 0]])
        by_turn, by_scale = (np.einsum("nij,nj->i", pull, wrong) for wrong in (turned, profile.place))
        angle = float(heading.bias[0] ** 2 + heading.bias_instability[0] ** 2 + velocity.misalignment[2] ** 2)
        lasting = float(np.max(velocity.bias[:2] ** 2 + velocity.bias_instability[:2] ** 2))
        by_speed = np.einsum("nij,n->ij", pull, time)
        found = angle * np.outer(by_turn, by_turn) + velocity.scale**2 * np.outer(by_scale, by_scale)
        found += lasting * by_speed @ by_speed.T
        # White noise of velocity and heading moves all places before it.
        moments, first = np.unique(time, return_index=True)
        sums = np.add.reduceat(pull, first, axis=0).cumsum(axis=0)
        lengths = np.diff(np.append(moments, 0.0))
        speed = float(np.linalg.norm(profile.place[0])) / max(-float(time[0]), 1e-9)
        white = float(np.max(velocity.sigma[:2]) ** 2 / velocity.rate + (heading.sigma[0] * speed) ** 2 / heading.rate)
        found += white * np.einsum("n,nij,nkj->ik", lengths, sums, sums)
        for block in sheets[self.spec.sounder].blocks:
            if block.name == "chart":
                gain = np.add.reduceat(best.gain, first, axis=0)
                alike = np.exp(-abs(moments[:, None] - moments) / block.correlation_time)
                found += np.square(block.sigma)[0] * gain.T @ alike @ gain
        return np.asarray(found)
