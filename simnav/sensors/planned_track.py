"""The planned track of another vessel: straight legs at constant speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from simnav.types import Array

__all__ = ["PlannedTrack", "check_track"]


def check_track(north: Sequence[float], east: Sequence[float], speed: float) -> None:
    """ValueError, a sentence, where points [m] and speed [m/s] are no track."""
    if not len(north) == len(east) > 0:
        raise ValueError(
            f"north_m has {len(north)} numbers and east_m {len(east)}; each point of the track has one of each"
        )
    if len(north) > 1 and not speed:
        raise ValueError("speed_m_s = 0: a ship with a track of several points needs a speed")
    steps = np.hypot(np.diff(north), np.diff(east))
    if (steps == 0.0).any():
        raise ValueError("north_m and east_m: two points of the track that follow each other are the same")


class PlannedTrack:
    """A track from the first point to the last one, where the vessel stops, or from there to the first one again.

    Parameters
    ----------
    north, east : sequence of float
        The points [m]; with one point the vessel lies there.
    speed : float
        Speed [m/s].
    heading : float
        Heading of a vessel that lies still [rad].
    repeats : bool
        Whether it sails along the points again and again.

    Examples
    --------
    >>> offset, course = PlannedTrack([0.0, 30.0], [0.0, 0.0], 2.0, repeats=True).at(np.array([5.0, 20.0]))
    >>> offset[:, 0].tolist(), np.degrees(course).tolist()
    ([10.0, 20.0], [0.0, 180.0])
    """

    def __init__(
        self, north: Sequence[float], east: Sequence[float], speed: float, heading: float = 0.0, repeats: bool = False
    ):
        self.points = np.stack([north, east], axis=1)
        if repeats and len(self.points) > 1 and (self.points[0] != self.points[-1]).any():
            self.points = np.concatenate([self.points, self.points[:1]])
        self.speed, self.repeats = speed, repeats
        legs = np.diff(self.points, axis=0)
        lengths = np.hypot(legs[:, 0], legs[:, 1])
        self.begins = np.concatenate([[0.0], np.cumsum(lengths)])
        self.courses = np.arctan2(legs[:, 1], legs[:, 0]) if len(legs) else np.array([heading])

    def at(self, time: Array) -> tuple[Array, Array]:
        """(n, 2) offsets north and east [m] and (n,) headings [rad] at n times [s]; before 0 those at 0."""
        run = self.speed * np.maximum(time, 0.0)
        whole = self.begins[-1]
        run = run % whole if self.repeats and whole else np.minimum(run, whole)
        north, east = (np.interp(run, self.begins, self.points[:, k]) for k in (0, 1))
        leg = np.clip(np.searchsorted(self.begins, run, side="right") - 1, 0, len(self.courses) - 1)
        return np.stack([north, east], axis=1), self.courses[leg]

    def velocity(self, time: Array) -> Array:
        """(n, 2) velocities north and east [m/s] at n times [s]."""
        _, course = self.at(time)
        moves = np.full(len(time), bool(self.begins[-1])) if self.repeats else self.speed * time < self.begins[-1]
        return np.where(moves[:, None], self.speed * np.stack([np.cos(course), np.sin(course)], axis=1), 0.0)
