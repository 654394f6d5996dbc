"""A fault in one run: a layer that is applied to measurements, simulated or from a real log.

It acts at the measurement times within its intervals [start, end). Outside of them it neither changes a measurement nor
draws a random number. Within them it draws a fixed number of variates for each measurement, also for measurements that
another fault has removed, so that faults do not change one another.
"""

from __future__ import annotations

from abc import ABC
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from simnav.plugins import exception_of, place_of
from simnav.recording import AidStream, ImuLabels
from simnav.sensors.faults.by_channel import each_channel
from simnav.sensors.faults.fault import FaultError, FaultSpec
from simnav.streams import stream as random_stream
from simnav.timing import TIME_TOLERANCE
from simnav.types import KINDS, Array, ImuSamples

__all__ = [
    "ADDS",
    "DISTURBS_IMU",
    "DROPS",
    "HOLDS",
    "STEPS_NOISE",
    "ZEROES",
    "Activity",
    "FaultLayer",
]

#: The action of a layer on a measurement, for layers that depend on the times only (`FaultLayer.ahead`): it adds an
#: error; adds noise up to a new sigma; removes the measurement; repeats an earlier one; sets it to zero; disturbs the
#: IMU.
ADDS, STEPS_NOISE, DROPS, HOLDS, ZEROES, DISTURBS_IMU = range(6)


class Activity:
    """The times at which a fault acts.

    Parameters
    ----------
    spec : FaultSpec
        The fault, with its intervals or the parameters of random intervals.
    rng : numpy.random.Generator
        Generator for random intervals.
    """

    def __init__(self, spec: FaultSpec, rng: np.random.Generator):
        self.spec, self._rng = spec, rng
        self._random = spec.mean_active is not None
        intervals = spec.intervals or (() if self._random else ((spec.start, spec.end),))
        self.starts = np.array([a for a, _ in intervals])
        self.ends = np.array([b for _, b in intervals])

    def _extend(self, until: float) -> None:
        spec = self.spec
        assert spec.mean_active is not None
        assert spec.mean_gap is not None
        end = float(self.ends[-1]) if len(self.ends) else spec.start
        starts, ends = [], []
        while end < min(until + 1.0, spec.end):
            start = end + self._rng.exponential(spec.mean_gap)
            end = min(start + self._rng.exponential(spec.mean_active), spec.end)
            if start >= spec.end:
                start = end = spec.end
            starts.append(start)
            ends.append(end)
        self.starts, self.ends = np.append(self.starts, starts), np.append(self.ends, ends)

    def locate(self, time: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
        """Find the times within the intervals.

        Parameters
        ----------
        time : (n,) array
            Measurement times, ascending [s].

        Returns
        -------
        rows, interval : (m,) int array
            Indices of the times within an interval, and the number of the interval of each. None if there is no such
            time.
        """
        if len(time) == 0:
            return None
        if self._random:
            self._extend(float(time[-1]))
        if (
            len(self.starts) == 0
            or time[-1] < self.starts[0] - TIME_TOLERANCE
            or time[0] >= self.ends[-1] - TIME_TOLERANCE
        ):
            return None
        number = np.searchsorted(self.starts - TIME_TOLERANCE, time, side="right") - 1
        rows = np.flatnonzero((number >= 0) & (time < (self.ends - TIME_TOLERANCE)[number]))
        return (rows, number[rows]) if len(rows) else None


class FaultLayer(ABC):  # noqa: B024 (so that those of its subclasses that have some are abstract)
    """A fault in one run. It is applied to the streams of its instruments block by block.

    Parameters
    ----------
    spec : FaultSpec
        Specification of the fault in the scenario.
    index : int
        First bit of the fault in the labels of measurements.
    seed : int
        Seed of the run.
    key : str
        Name of the random streams of the fault.

    Attributes
    ----------
    spec : FaultSpec
        Specification of the fault in the scenario.
    activity : Activity
        The times at which the fault acts.
    """

    #: One of `ADDS`, ..., for runs that go step by step (`simnav.simulation.steps`); None: `apply` alone knows what it
    #: does.
    operation: ClassVar[int | None] = None
    #: True: it is laid over a stream after all faults of which this is False.
    last: ClassVar[bool] = False

    def __init__(self, spec: FaultSpec, index: int, seed: int, key: str):
        self.spec, self._index, self._seed, self._key = spec, index, seed, key
        self._generators: dict[tuple[str, ...], np.random.Generator] = {}
        self.activity = Activity(spec, self.rng("intervals"))

    def rng(self, *names: str) -> np.random.Generator:
        """A random stream of this fault. The same names, such as "gnss", "noise", give the same generator."""
        if names not in self._generators:
            self._generators[names] = random_stream(self._seed, "fault", self._key, *names)
        return self._generators[names]

    def touches(self, stream: AidStream) -> bool:
        """Whether the fault affects the instrument of this stream, or the channel whose stream it is."""
        name, _, channel = stream.name.partition(":")
        wanted = self.spec.channels
        return self.touches_kind(name, stream.kind) and (not channel or not wanted or channel in wanted)

    def touches_kind(self, name: str, kind: str) -> bool:
        """Whether the fault affects an instrument of this name and kind."""
        return name in self.spec.instruments or kind in self.spec.instruments

    def bits(self, interval: NDArray[np.intp]) -> NDArray[np.uint32]:
        """The label bits of measurements, from the numbers of their intervals."""
        number = interval if self.spec.intervals else np.zeros_like(interval)
        return np.left_shift(np.uint32(1), (self._index + number).astype(np.uint32))

    @property
    def index(self) -> int:
        """First bit of the fault in the labels of measurements."""
        return self._index

    def ahead(self, name: str, kind: str, time: Array) -> tuple[NDArray[np.int64], Array]:
        """Compute in advance the intervals and the random values of `apply`, for the next n samples of an instrument.

        Parameters
        ----------
        name, kind : str
            Name and kind of one of the affected instruments.
        time : (n,) array
            Sample times, delivered or not [s].

        Returns
        -------
        interval : (n,) int array
            Number of the interval of each sample; -1 outside of all intervals.
        error : (n, d) array
            Error or noise that is drawn for each sample; zero if nothing is drawn.
        """
        interval, error = np.full(len(time), -1, np.int64), np.zeros((len(time), len(KINDS[kind].components)))
        found = self.activity.locate(time)
        if found is not None:
            interval[found[0]] = found[1]
        return interval, error

    def ahead_imu(self, time: Array) -> tuple[NDArray[np.bool_], Array]:
        """The same for the IMU: an (n,) mask of disturbed samples, and (n, 6) errors of angular rate and force."""
        raise NotImplementedError(f"{type(self).__name__} does not disturb an IMU")

    def laid_over(self, stream: AidStream) -> AidStream:
        """`apply`, for the fault's instruments only, with errors that name the fault, its file and the instrument.

        The readings of each of the fault's channels are a stream of their own for `apply`, with the name
        ``INSTRUMENT:CHANNEL``.

        Raises
        ------
        FaultError
            If `apply` raises, or returns something else than the stream of the instrument.
        """
        if not self.touches(stream):
            return stream
        if stream.channels:
            return each_channel(stream, self.spec.channels, self._applied)
        return self._applied(stream)

    def _applied(self, stream: AidStream) -> AidStream:
        """The checked result of `apply`."""
        try:
            result = self.apply(stream)
            if result is not stream:
                _check(result, stream)
        except (FaultError, MemoryError):
            raise
        except Exception as error:
            cls = type(self)
            file = Path(place_of(cls)[0]).name
            raise FaultError(
                f"fault {self.spec.kind!r} on {stream.name!r} ({cls.__qualname__} in {file}): "
                f"{exception_of(cls, error)}"
            ) from error
        return result

    def apply(self, stream: AidStream) -> AidStream:
        """Apply the fault to the next block of a stream.

        Parameters
        ----------
        stream : AidStream
            Measurements of one of the affected instruments, or of one of its channels, after earlier faults.

        Returns
        -------
        AidStream
            The measurements with the fault. If the fault changes nothing, it is the argument itself. The argument is
            never modified.
        """
        return stream

    def apply_imu(self, samples: ImuSamples, labels: ImuLabels | None) -> tuple[ImuSamples, ImuLabels | None]:
        """Apply the fault to the next block of IMU samples.

        Parameters
        ----------
        samples : ImuSamples
            Samples after earlier faults.
        labels : ImuLabels or None
            Labels of these samples; None if no fault of the scenario affects the IMU.

        Returns
        -------
        samples, labels
            Samples and labels with the fault. If the fault does not affect the IMU, they are the arguments themselves.
        """
        return samples, labels


def _check(result: object, before: AidStream) -> None:
    """ValueError where a layer made something of a stream that is none of the instrument."""
    if not isinstance(result, AidStream):
        raise ValueError(f"apply() returned {type(result).__name__}, where an AidStream is wanted")
    n, components = len(result.time), KINDS[before.kind].values
    wide = (n, len(components))
    for name, wanted in (("value", wide), ("fault_error", wide), ("sigma", wide), ("faults", wide[:1])):
        shape = np.shape(getattr(result, name))
        if shape != wanted:
            raise ValueError(
                f"apply() returned a stream whose {name} is of shape {shape}, where {wanted} is wanted: a row for each "
                f"of {n} times, a column for each component ({', '.join(components)})"
            )
    wrong = ~np.isfinite(result.value).all(axis=1)
    if wrong.any() and np.isfinite(before.value).all():
        raise ValueError(f"at {result.time[np.argmax(wrong)]:g} s the value is not finite")
