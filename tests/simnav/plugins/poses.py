"""A vessel that follows given poses: positions and angles at a few times, interpolated smoothly."""

from __future__ import annotations

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator
from scipy.interpolate import CubicSpline

from simnav.spec import quantity
from simnav.world import SampledTrajectory, Vessel, Voyage, register_vessel

Numbers = tuple[float, ...]


@register_vessel
class Poses(Vessel):
    """Positions relative to an origin and angles, at times of which the first is 0."""

    starts: ClassVar[bool] = False
    obeys: ClassVar[bool] = False

    kind: Literal["poses"] = "poses"
    latitude: float = quantity("deg")
    longitude: float = quantity("deg")
    time: Numbers = quantity("s")
    north: Numbers = quantity("m")
    east: Numbers = quantity("m")
    down: Numbers = quantity("m")
    roll: Numbers = quantity("deg")
    pitch: Numbers = quantity("deg")
    heading: Numbers = quantity("deg")

    @model_validator(mode="after")
    def _as_long(self) -> Self:
        for name in ("north", "east", "down", "roll", "pitch", "heading"):
            if len(getattr(self, name)) != len(self.time):
                raise ValueError(f"{name} has {len(getattr(self, name))} numbers, time_s has {len(self.time)}")
        return self

    def trajectory(self, voyage: Voyage) -> SampledTrajectory:
        """Interpolate the poses."""
        if self.time[0] > 0.0 or self.time[-1] < voyage.duration:
            raise ValueError(f"the poses are from {self.time[0]:g} to {self.time[-1]:g} s, the run takes more")
        return _Splines(self, voyage)


class _Splines(SampledTrajectory):
    def __init__(self, vessel, voyage):
        self.place = CubicSpline(vessel.time, np.stack([vessel.north, vessel.east, vessel.down], axis=1))
        turns = np.unwrap(np.stack([vessel.roll, vessel.pitch, vessel.heading], axis=1), axis=0)
        self.angles = CubicSpline(vessel.time, turns)
        super().__init__(np.array([vessel.latitude, vessel.longitude, -vessel.down[0]]), voyage)

    def motion(self, time):
        """Velocity and attitude at n times."""
        return self.place(time, 1), self.angles(time)
