"""The planned track: where the vessel would go in calm water if it knew exactly where it is."""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot
from typing import ClassVar, Protocol

import numpy as np

from simnav.types import Array, NavigationStates

__all__ = ["PlannedTrack"]


class _Mover(Protocol):
    """A world, as far as it is needed here."""

    @property
    def track(self) -> Array: ...

    def advance(self, until: float, taps: Mapping[str, Array]) -> object: ...

    def state(self) -> NavigationStates: ...


class PlannedTrack:
    """The track of a vessel's manoeuvres, a point a second, made as far as it is asked for.

    Parameters
    ----------
    world : World
        A world of its own, without waves, at time 0; it is advanced here and sampled at `RATE`.

    Attributes
    ----------
    points : (k, 4) array
        North and east of the start [m], heading [rad], speed through the water [m/s].
    position : (k, 3) array
        Latitude, longitude [rad] and height [m].
    """

    #: Samples per second [Hz]: the lags of a vessel are exact at any rate.
    RATE: ClassVar[float] = 10.0
    #: Points are looked for this far before and after the last one [s].
    WINDOW: ClassVar[int] = 60

    def __init__(self, world: _Mover):
        self._world = world
        self.points = world.track[None]
        self.position = world.state().position.copy()
        self._at = 0

    def reach(self, time: float) -> None:
        """Make the track at least so long [s]."""
        points, positions = [self.points], [self.position]
        for second in range(len(self.points), int(time) + 2):
            self._world.advance(float(second), {})
            points.append(self._world.track[None])
            positions.append(self._world.state().position.copy())
        self.points, self.position = np.concatenate(points), np.concatenate(positions)

    def aside(self, north: float, east: float, time: float) -> tuple[float, float]:
        """How far to starboard of the track a position is [m], and the planned speed there [m/s].

        The nearest point is looked for around the last one that was found, no more than `WINDOW` seconds from it.

        Parameters
        ----------
        north, east : float
            Of the start [m].
        time : float
            Now [s].
        """
        if int(time) + self.WINDOW >= len(self.points):
            self.reach(time + 4 * self.WINDOW)
        points = self.points
        low, high = max(0, self._at - self.WINDOW), min(len(points) - 1, self._at + self.WINDOW)
        squares = (points[low : high + 1, 0] - north) ** 2 + (points[low : high + 1, 1] - east) ** 2
        at = low + int(np.argmin(squares))
        self._at = at
        before, after = points[max(at - 1, 0)], points[min(at + 1, len(points) - 1)]
        along_north, along_east = float(after[0] - before[0]), float(after[1] - before[1])
        length = hypot(along_north, along_east)
        if length < 1e-6:  # she lies still
            return 0.0, float(points[at, 3])
        d_north, d_east = north - float(points[at, 0]), east - float(points[at, 1])
        return (along_north * d_east - along_east * d_north) / length, float(points[at, 3])
