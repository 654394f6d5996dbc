"""The planned track: the track of the vessel in calm water, if its position were known exactly."""

from __future__ import annotations

from math import sqrt
from threading import Lock
from typing import ClassVar, Protocol

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import Matrix
from simnav.types import Array, NavigationStates

__all__ = ["Follower", "PlannedTrack"]

_EXTENDING = Lock()


@kernel
def _aside(points: Matrix, at: int, window: int, north: float, east: float) -> tuple[float, int]:
    """The distance of a position to starboard of the nearest point [m], and the index of this point."""
    low, high = max(0, at - window), min(points.shape[0] - 1, at + window)
    least = np.inf
    for i in range(low, high + 1):
        d_north, d_east = points[i, 0] - north, points[i, 1] - east
        square = d_north * d_north + d_east * d_east
        if square < least:
            at, least = i, square
    before, after = max(at - 1, 0), min(at + 1, points.shape[0] - 1)
    along_north, along_east = points[after, 0] - points[before, 0], points[after, 1] - points[before, 1]
    length = sqrt(along_north * along_north + along_east * along_east)
    if length < 1e-6:  # the vessel does not move
        return 0.0, at
    d_north, d_east = north - points[at, 0], east - points[at, 1]
    return (along_north * d_east - along_east * d_north) / length, at


class _Mover(Protocol):
    """The part of the interface of a world that is needed here."""

    @property
    def track(self) -> Array: ...

    @property
    def dive(self) -> Array: ...

    def trace(self, seconds: int) -> tuple[Array, Array, Array]: ...

    def state(self) -> NavigationStates: ...


class PlannedTrack:
    """The track of a vessel's manoeuvres, one point a second. It is extended when a later time is needed.

    Parameters
    ----------
    world : World
        A separate world without waves, at time 0. It is advanced here and sampled at `RATE`.

    Attributes
    ----------
    points : (k, 4) array
        Distances north and east of the start [m], heading [rad], speed through the water [m/s].
    position : (k, 3) array
        Latitude, longitude [rad] and height [m].
    dives : (k, 2) array
        Depth that is steered for [m], and largest path angle [rad].
    """

    #: Samples per second [Hz]: the lags of a vessel are exact at any rate.
    RATE: ClassVar[float] = 10.0
    #: Points are looked for this far before and after the last one [s].
    WINDOW: ClassVar[int] = 60

    def __init__(self, world: _Mover):
        self._world = world
        self.points = world.track[None]
        self.position = world.state().position.copy()
        self.dives = world.dive[None]

    def reach(self, time: float) -> None:
        """Extend the track up to a time [s]."""
        with _EXTENDING:  # runs in several threads may share a track
            more = int(time) + 2 - len(self.points)
            if more > 0:
                track, position, dives = self._world.trace(more)
                self.points = np.concatenate([self.points, track])
                self.position = np.concatenate([self.position, position])
                self.dives = np.concatenate([self.dives, dives])


class Follower:
    """Where a run is along a planned track, which may be that of many runs.

    Parameters
    ----------
    track : PlannedTrack
        The track.
    """

    def __init__(self, track: PlannedTrack):
        self._track, self._at, self._length = track, 0, 1

    def aside(self, north: float, east: float, time: float) -> tuple[float, float]:
        """The distance of a position to starboard of the track [m], and the planned speed there [m/s].

        The nearest point is searched within `PlannedTrack.WINDOW` seconds of the last nearest point.

        Parameters
        ----------
        north, east : float
            Distance of the position from the start, north and east [m].
        time : float
            Present time of the run [s].
        """
        window = PlannedTrack.WINDOW
        if int(time) + window >= self._length:
            # Other runs may have extended the track further: it is as long as if it were this run's alone.
            until = time + 4 * window
            self._length = max(self._length, int(until) + 2)
            self._track.reach(until)
        points = self._track.points[: self._length]
        aside, self._at = _aside(points, self._at, window, north, east)
        return aside, float(points[self._at, 3])
