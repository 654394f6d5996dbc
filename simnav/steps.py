"""The measurements of some successive steps in arrays, as an estimator may take them by one call.

The same measurements, step by step, are `simnav.types.Measurements`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from simnav.types import Array, ImuSamples, Integers, Measurement, Measurements

__all__ = ["Steps", "Stream"]


class Stream(NamedTuple):
    """What is known of the readings of an instrument.

    Attributes
    ----------
    name, kind : str
        As of `Measurement`.
    components : int
        Number of components of a value.
    channels : tuple of str
        Identifiers of its channels; empty for an instrument without channels.
    sides : int
        Number of components of the side information of a reading.
    """

    name: str
    kind: str
    components: int
    channels: tuple[str, ...]
    sides: int


@dataclass(frozen=True, eq=False, slots=True)
class Steps:
    """The measurements of t successive steps: k readings and n IMU samples.

    Attributes
    ----------
    start : float
        Beginning of the first step [s].
    ends : (t,) array
        End of each step [s]; the next one begins there.
    imu : ImuSamples or None
        IMU samples; None for a vessel without an IMU.
    samples, readings : (t + 1,) array of int
        Index of the first sample, and of the first reading, of each step; and the numbers of them.
    instrument : (k,) array of int
        The instrument of each reading, by its place among the streams.
    time : (k,) array
        Its time stamp [s]; in order within a step.
    numbers : (k, w) array
        The components of its value, the index of its channel if it has channels, and its side information; then zeros.
        w is at least 3.
    streams : sequence of Stream
        The instruments.
    """

    start: float
    ends: Array
    imu: ImuSamples | None
    samples: Integers
    readings: Integers
    instrument: Array
    time: Array
    numbers: Array
    streams: Sequence[Stream]

    def __len__(self) -> int:
        return len(self.ends)

    def __getitem__(self, k: int) -> Measurements:
        """The measurements of one step; their arrays are views."""
        imu = None if self.imu is None else self.imu[int(self.samples[k]) : int(self.samples[k + 1])]
        aids = []
        for i in range(int(self.readings[k]), int(self.readings[k + 1])):
            name, kind, d, channels, sides = self.streams[int(self.instrument[i])]
            time, numbers = float(self.time[i]), self.numbers[i]
            if channels:
                side = numbers[d + 1 : d + 1 + sides]
                aids.append(Measurement(time, name, kind, numbers[:d], channels[int(numbers[d])], side))
            elif sides:  # what the reading states of its noise
                aids.append(Measurement(time, name, kind, numbers[:d], side=numbers[d : d + sides]))
            else:
                aids.append(Measurement(time, name, kind, numbers[:d]))
        return Measurements(float(self.ends[k - 1]) if k else self.start, float(self.ends[k]), imu, aids)
