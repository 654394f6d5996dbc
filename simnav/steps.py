"""The measurements of some successive steps in arrays, as an estimator may take them by one call.

The same measurements, step by step, are `simnav.types.Measurements`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

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


@dataclass(eq=False, slots=True)
class Steps:
    """The measurements of t successive steps: k readings and n IMU samples.

    Attributes
    ----------
    start : float
        Beginning of the first step [s].
    ends : tuple of t float
        End of each step [s]; the next one begins there.
    imu : ImuSamples or None
        IMU samples; None for a vessel without an IMU.
    samples, readings : tuple of t + 1 int
        Index of the first sample, and of the first reading, of each step; and the numbers of them.
    rows : (k, 2 + w) array
        Of each reading the place of its instrument among the streams, and its time stamp [s], in order within a step.
        Then the components of its value, the index of its channel if it has channels, and its side information; then
        zeros. w is at least 3.
    streams : sequence of Stream
        The instruments.
    """

    start: float
    ends: tuple[float, ...]
    imu: ImuSamples | None
    samples: tuple[int, ...]
    readings: tuple[int, ...]
    rows: Array
    streams: Sequence[Stream]

    def __len__(self) -> int:
        return len(self.ends)

    @property
    def time(self) -> Array:
        """(k,) array: the time stamp of each reading [s]."""
        return self.rows[:, 1]

    @property
    def value(self) -> Array:
        """(k, w) array: the components of each reading's value, and what stands behind them in `rows`."""
        return self.rows[:, 2:]

    @property
    def step(self) -> Integers:
        """(k,) array: the number of the step of each reading."""
        return np.repeat(np.arange(len(self)), np.diff(self.readings))

    def rows_of(self, known: Mapping[str, int]) -> Integers:
        """(k,) array: for each reading the number of its instrument, from the numbers of some by name; else -1."""
        of_stream = np.array([known.get(stream.name, -1) for stream in self.streams], np.int64)
        return of_stream[self.rows[:, 0].astype(np.intp)]

    def __iter__(self) -> Iterator[Measurements]:
        """The measurements step by step; their arrays are views."""
        start, first, first_sample, rows = self.start, 0, 0, self.rows
        places: list[list[float]] = rows[:, :2].tolist()
        for end, last, last_sample in zip(self.ends, self.readings[1:], self.samples[1:]):
            imu = self.imu if len(self) == 1 or self.imu is None else self.imu[first_sample:last_sample]
            aids = []
            for i in range(first, last):
                number, time = places[i]
                name, kind, d, channels, sides = self.streams[int(number)]
                if channels:
                    side = rows[i, d + 3 : d + 3 + sides]
                    aids.append(Measurement(time, name, kind, rows[i, 2 : d + 2], channels[int(rows[i, d + 2])], side))
                elif sides:  # what the reading states of its noise
                    aids.append(Measurement(time, name, kind, rows[i, 2 : d + 2], side=rows[i, d + 2 : d + 2 + sides]))
                else:
                    aids.append(Measurement(time, name, kind, rows[i, 2 : d + 2]))
            yield Measurements(start, end, imu, aids)
            start, first, first_sample = end, last, last_sample
