"""The planned tracks of many voyages, as lines of points."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import principal_radii, relative_position
from simnav.scenario import Scenario
from simnav.types import Array
from simnav.world import AirFlow, KinematicVessel, Wind, World
from simnav.world.track import PlannedTrack

from .guidance_kernels import Tracks

__all__ = ["Routes"]


class Routes:
    """The tracks that the manoeuvres of n voyages plan; one for all where nothing is drawn.

    Parameters
    ----------
    n : int
        Number of voyages.

    Attributes
    ----------
    of : (n,) int array
        Which track is each voyage's.
    length : (r,) int array
        Points of each track.
    points : (r, p, 4) array
        North and east of the start [m], heading [rad], speed through the water [m/s].
    geodetic : (r, p, 4) array
        Latitude, longitude [rad], and metres per radian of both.
    course, along : (r, p) array
        Course of the track [rad], and the distance from its start [m].
    dives : (r, p, 2) array
        Depth that is steered for [m], and largest path angle [rad].
    """

    def __init__(self, n: int):
        self._n = n
        self.of, self.length = np.zeros(n, np.int64), np.zeros(0, np.int64)
        self.points, self.geodetic = np.zeros((0, 0, 4)), np.zeros((0, 0, 4))
        self.course, self.along = np.zeros((0, 0)), np.zeros((0, 0))
        self.dives = np.zeros((0, 0, 2))

    @cached_property
    def tracks(self) -> Tracks:
        """All of them, as the kernels take them; `put` forgets them where it replaces an array."""
        return Tracks(self.of, self.length, self.points, self.geodetic, self.course, self.along)

    def dive(self, at: NDArray[np.int64]) -> Array:
        """(n, 2) array: the values of `dives` at a point of each voyage's track."""
        dive: Array = self.dives[self.of, at]
        return dive

    def put(self, b: int, template: Scenario, drawn: Scenario) -> None:
        """Plan the track of a voyage, from its scenario before and after what is drawn."""
        shared = not template.distributions
        self.of[b] = 0 if shared else b
        if shared and len(self.length):
            return
        track = _planned(drawn)
        keep = np.concatenate([[True], np.hypot(*np.diff(track.points[:, :2], axis=0).T) > 0.05])
        position, points = track.position[keep], track.points[keep]
        steps = relative_position(position[1:], position[:-1])[:, :2]
        course = np.arctan2(steps[:, 1], steps[:, 0])
        course = np.append(course, course[-1:]) if len(steps) else np.array([track.points[0, 2]])
        meridian, prime_vertical = principal_radii(position[:, 0])
        north, east = meridian + position[:, 2], (prime_vertical + position[:, 2]) * np.cos(position[:, 0])
        r, k = int(self.of[b]), len(points)
        rows = 1 if shared else self._n
        if rows > len(self.length) or k > self.points.shape[1]:
            p = max(k, self.points.shape[1])
            self.length = np.pad(self.length, (0, rows - len(self.length)))
            self.points, self.geodetic = (_room(a, rows, p) for a in (self.points, self.geodetic))
            self.dives = _room(self.dives, rows, p)
            self.course, self.along = (_room(a, rows, p) for a in (self.course, self.along))
            self.__dict__.pop("tracks", None)
        self.length[r], self.points[r, :k], self.course[r, :k] = k, points, course
        self.dives[r, :k] = track.dives[keep]
        self.geodetic[r, :k] = np.stack([position[:, 0], position[:, 1], north, east], axis=1)
        self.along[r, :k] = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])


_tracks: dict[str, PlannedTrack] = {}


def _planned(scenario: Scenario) -> PlannedTrack:
    """The track that the manoeuvres plan; the last ones are kept, since that of half a day takes half a second."""
    vessel = scenario.craft
    assert scenario.start is not None
    assert isinstance(vessel, KinematicVessel)
    voyage = scenario.start, vessel, scenario.manoeuvres, scenario.current
    wind = next((spec for spec in scenario.surroundings.values() if isinstance(spec, Wind)), None)
    key = repr((voyage, wind, scenario.duration))
    if key not in _tracks:
        if len(_tracks) > 4:
            _tracks.pop(next(iter(_tracks)))
        _tracks[key] = track = World.plan(*voyage, None if wind is None else AirFlow(wind, 0))
        track.reach(scenario.duration)
    return _tracks[key]


def _room(array: Array, rows: int, points: int) -> Array:
    """The array with room for so many tracks of so many points."""
    shape = (rows, points, *array.shape[2:])
    new: NDArray[np.float64] = np.zeros(shape)
    new[: array.shape[0], : array.shape[1]] = array
    return new
