"""An IMU as its integral: turns and mean forces over any interval, and read with other axes, units or clock."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from simnav.log.imu_series import ImuSeries
from simnav.types import Array

__all__ = ["Inertial"]


@dataclass(frozen=True, eq=False)
class Inertial:
    """An IMU as its integral, so that its axes, units and clock can be altered without reading it again.

    Attributes
    ----------
    series : ImuSeries
        As it was read.
    gyroscope, accelerometer : (3, 3) array
        Multiply the angular rates and the specific forces.
    delay : float
        By how much its clock is late [s].
    """

    series: ImuSeries
    gyroscope: Array = field(default_factory=lambda: np.eye(3))
    accelerometer: Array = field(default_factory=lambda: np.eye(3))
    delay: float = 0.0
    integral: Array = field(init=False)
    known: dict[tuple[float, ...], Array] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        total = np.zeros((len(self.series.edge), 6))
        np.cumsum(self.series.mean * np.diff(self.series.edge)[:, None], axis=0, out=total[1:])
        object.__setattr__(self, "integral", total)

    def altered(self, **changes: Any) -> Inertial:
        """The same IMU, read otherwise."""
        other = object.__new__(Inertial)
        for name, value in {**vars(self), **changes}.items():
            object.__setattr__(other, name, value)
        return other

    def turns(self, begin: Array, end: Array) -> Array:
        """(n, 3) integrals of the angular rate over intervals [rad]; not a number outside."""
        return self._between(begin, end, slice(0, 3)) @ self.gyroscope.T

    def forces(self, begin: Array, end: Array) -> Array:
        """(n, 3) mean specific forces [m/s^2]."""
        return self._between(begin, end, slice(3, 6)) @ self.accelerometer.T / (end - begin)[:, None]

    def _between(self, begin: Array, end: Array, part: slice) -> Array:
        if not len(begin):
            return np.zeros((0, 3))
        key = (*(float(t) for t in (begin[0], begin[-1], end[0], end[-1])), self.delay, part.start, len(begin))
        if key not in self.known:
            self.known[key] = self._interpolated(begin, end, part)
        return self.known[key]

    def _interpolated(self, begin: Array, end: Array, part: slice) -> Array:
        edge = self.series.edge
        first, last = begin + self.delay, end + self.delay
        found = np.stack([np.interp(last, edge, c) - np.interp(first, edge, c) for c in self.integral.T[part]], axis=-1)
        found[(first < edge[0]) | (last > edge[-1])] = np.nan
        return found
