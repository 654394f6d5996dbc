"""The observations of an episode: steps of a run as padded arrays, from a block or simulated step by step."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import Integers, helper, kernel
from simnav.geometry.earth import ECCENTRICITY_SQUARED, SEMI_MAJOR_AXIS
from simnav.kernel_types import Hypermatrix, IntegerMatrix, IntegerVector, Matrix, Stack
from simnav.sensors.stepwise import Delivered, ImuSteps
from simnav.timing import TIME_TOLERANCE
from simnav.types import KINDS, Array

if TYPE_CHECKING:
    from simnav.recording import AidStream, Block
    from simnav.simulation.steps import SteppedRuns

__all__ = [
    "ClosedLoopSteps",
    "ObservedSteps",
    "crowded",
    "entries",
    "horizontal",
    "keep",
    "no_imu",
    "pack",
    "padded",
    "rows_of",
]


@dataclass(eq=False)
class ObservedSteps:
    """S steps of a run as padded arrays; each row is one observation.

    Attributes
    ----------
    intervals : (S, 2) array
        Beginning and end of each step [s].
    columns : dict of str to dict of str to (S, K, ...) array
        The entries of the observations, by instrument and name.
    truth : (S, 3, 3) array
        True position, velocity and attitude at the end of each step (rows of each matrix).
    rows : list of list of float
        For each step: true latitude, longitude and height, metres per radian of latitude and of longitude, and heading.
    aids : dict of str to AidStream
        The streams of all measurements of the steps.
    cuts : dict of str to (S + 1,) int array
        Index limits of each step's measurements in the streams.
    """

    intervals: Array
    columns: dict[str, dict[str, NDArray[Any]]]
    truth: Array
    rows: list[list[float]]
    aids: dict[str, AidStream]
    cuts: dict[str, NDArray[np.intp]]

    def fixes(self, i: int) -> Iterator[tuple[Array, NDArray[np.bool_]]]:
        """The position fixes of a step, and a mask of those that a fault affected."""
        for name, stream in self.aids.items():
            if _draws(stream.kind):
                cut = slice(*self.cuts[name][i : i + 2])
                yield stream.value[cut, :2], stream.faults[cut] != 0


def _draws(kind: str) -> bool:
    """Whether a chart shows what a kind of instrument measures: a fix by latitude and longitude."""
    return KINDS[kind].role == "fix" and KINDS[kind].geodetic


@helper
def _row(latitude: float, longitude: float, height: float, heading: float, out: Array) -> None:
    """One row of `rows_of`."""
    s, up = np.sin(latitude), height
    if up != up:  # a log may have no reference of it
        up = 0.0
    x = 1.0 - ECCENTRICITY_SQUARED * (s * s)
    prime_vertical = SEMI_MAJOR_AXIS / np.sqrt(x)
    meridian = prime_vertical * (1.0 - ECCENTRICITY_SQUARED) / x
    out[0], out[1], out[2] = latitude, longitude, height
    out[3], out[4] = meridian + up, (prime_vertical + up) * np.cos(latitude)
    out[5] = heading


class PaddedImu(NamedTuple):
    """At most K IMU samples in each of S rows.

    Attributes
    ----------
    time : (S, K) array
        Ends of the samples [s].
    valid : (S, K) int8 array
        Whether there is a sample (0 or 1).
    length : (S, K) array
        Lengths of the samples [s].
    angular_rate, specific_force : (S, K, 3) array
        Means over the intervals [rad/s], [m/s^2].
    """

    time: Matrix
    valid: Annotated[NDArray[np.int8], "int8[:, ::1]"]
    length: Matrix
    angular_rate: Stack
    specific_force: Stack


@kernel
def keep(
    which: tuple[IntegerVector, IntegerVector],
    truth: Matrix,
    imu: ImuSteps,
    delivered: Delivered,
    slots: tuple[IntegerMatrix, IntegerMatrix],
    samples: PaddedImu,
    aids: tuple[Stack, Annotated[NDArray[np.int8], "int8[:, :, ::1]"], Hypermatrix],
    states: Stack,
    rows: Matrix,
) -> int:
    """Put the last step of each of q runs into a row of padded arrays.

    Return -1, or the number of the first run with too many measurements of an instrument, times the length of a row of
    ``slots``, plus the number of the instrument.

    Parameters
    ----------
    which : two (q,) int arrays
        Number of each run, and of its row.
    truth : (b, 9) array
        Position, velocity and attitude at the end of the step, of b runs.
    imu : ImuSteps
        IMU samples of the step.
    delivered : Delivered
        Measurements of the step.
    slots : two (b, i) int arrays
        For each of i instruments: its number in the padded arrays, and its largest number of measurements in a step.
        No measurements are put there if i is zero.
    samples : PaddedImu
        Overwritten with the IMU samples; no samples are put there if it has no room for any.
    aids : (S, A, K), (S, A, K), (S, A, K, 3) arrays
        Times [s], validity (0 or 1) and values of at most K measurements of A instruments in S rows; overwritten.
    states : (S, 3, 3) array
        Overwritten with the truth.
    rows : (q, 6) array
        Overwritten with the row of `rows_of` of each run.
    """
    time, length, valid = samples.time, samples.length, samples.valid
    times, there, values = aids
    place, most = slots
    for q in range(which[0].size):
        b, row = which[0][q], which[1][q]
        for i in range(3):
            for j in range(3):
                states[row, i, j] = truth[b, 3 * i + j]
        _row(truth[b, 0], truth[b, 1], truth[b, 2], truth[b, 8], rows[q])
        if time.shape[1] > 0:
            for k in range(imu.number[b]):
                time[row, k], length[row, k], valid[row, k] = imu.time[b, k], imu.interval[b, k], 1
                for j in range(3):
                    samples.angular_rate[row, k, j] = imu.angular_rate[b, k, j]
                    samples.specific_force[row, k, j] = imu.specific_force[b, k, j]
        for m in range(delivered.number[b] if place.shape[1] > 0 else 0):
            n: int = delivered.who[b, m]
            a = place[b, n]
            k = 0
            while k < most[b, n] and there[row, a, k]:
                k += 1
            if k == most[b, n]:
                found: int = b * place.shape[1] + n
                return found
            times[row, a, k], there[row, a, k] = delivered.when[b, m], 1
            for j in range(3):
                values[row, a, k, j] = delivered.value[b, m, j]
    return -1


def padded(steps: int, names: Sequence[str], most: Mapping[str, int]) -> tuple[PaddedImu, Any]:
    """The arrays ``samples`` and ``aids`` of `keep` for so many rows, empty."""
    s, imu, room = steps, int(most.get("imu", 0)), max((most[name] for name in names), default=0)
    samples = PaddedImu(
        time=np.zeros((s, imu)),
        valid=np.zeros((s, imu), np.int8),
        length=np.zeros((s, imu)),
        angular_rate=np.zeros((s, imu, 3)),
        specific_force=np.zeros((s, imu, 3)),
    )
    aids = np.zeros((s, len(names), room)), np.zeros((s, len(names), room), np.int8), np.zeros((s, len(names), room, 3))
    return samples, aids


def no_imu(n: int) -> ImuSteps:
    """The samples of n runs without an IMU."""
    empty = np.zeros((n, 0))
    return ImuSteps(np.zeros(n, np.int64), empty, empty, empty[..., None], empty[..., None])


def entries(
    samples: PaddedImu, aids: Any, widths: Sequence[tuple[str, int, int]]
) -> dict[str, dict[str, NDArray[Any]]]:
    """The arrays of `padded` by instrument and name; ``widths``: name, most measurements and components of each."""
    columns: dict[str, dict[str, NDArray[Any]]] = {}
    if samples.time.shape[1]:
        columns["imu"] = samples._asdict()
    time, valid, values = aids
    for a, (name, k, d) in enumerate(widths):
        columns[name] = {"time": time[:, a, :k], "valid": valid[:, a, :k], "value": values[:, a, :k, :d]}
    return columns


class ClosedLoopSteps(ObservedSteps):
    """Steps that are simulated one by one, for a vessel in closed loop.

    Parameters
    ----------
    runs : SteppedRuns
        The run, and others.
    b : int
        Number of the run.
    most, widths : mapping of str to int
        For each instrument, the largest number of its readings in one step and their number of components.
    sides : mapping of str to int
        For each instrument with channels, the number of components of the side information.
    """

    #: Most steps.
    LENGTH = 64

    def __init__(
        self,
        runs: SteppedRuns,
        b: int,
        most: Mapping[str, int],
        widths: Mapping[str, int],
        sides: Mapping[str, int],
    ):
        s, names = self.LENGTH, [name for name in most if name != "imu"]
        self._samples, self._arrays = padded(s, names, most)
        self._aids = [(name, most[name], widths[name]) for name in names]
        self._sides = {name: np.zeros((s, most[name], width)) for name, width in sides.items()}
        self._one, self._none = np.zeros((1, 6)), no_imu(b + 1)
        super().__init__(np.zeros((s, 2)), {}, np.zeros((s, 3, 3)), [], {}, {})
        self._share_columns()
        own = runs.names[b]
        self._runs, self._b, self._on = runs, b, np.arange(runs.n) == b
        self._which = np.array([b]), np.zeros(1, np.int64)
        self._slots = np.zeros((2, b + 1, 0 if sides else len(own)), np.int64)
        if not sides:
            self._slots[:, b] = [names.index(name) for name in own], [most[name] for name in own]

    def _share_columns(self) -> None:
        """The columns are the arrays that `advance` fills, and views of them."""
        self.columns.update(entries(self._samples, self._arrays, self._aids))
        for name, side in self._sides.items():
            if side.shape[2]:
                self.columns[name]["side"] = side

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._share_columns()  # in a copy they are arrays of their own

    def advance(self) -> None:
        """Simulate the next step.

        Raises
        ------
        ValueError
            If an instrument delivers more samples than the rate of its datasheet allows.
        """
        runs, b, i = self._runs, self._b, len(self.rows)
        runs.advance(self._on)
        self.intervals[i] = runs.interval_of(b)
        imu = runs.imu_steps if "imu" in self.columns else self._none
        self._which[1][0] = i
        slots, row, aids = (self._slots[0], self._slots[1]), self._one, self._arrays
        many = keep.unchecked(self._which, runs.truth, imu, runs.delivered, slots, self._samples, aids, self.truth, row)
        self.rows += row.tolist()
        if self._sides:  # a run with channels has only the block form
            self._place_slots(i)
        elif many >= 0:
            raise crowded(runs, slots, many)

    def _place_slots(self, i: int) -> None:
        """Put the measurements of the last step, those of channels in their slots, into a row of the arrays."""
        streams = self._runs.streams(self._b)
        for name, entry in self.columns.items():
            if name in streams:
                stream = streams[name]
                if stream.has_clock:  # all arrive in this step
                    order = np.argsort(stream.stamps, kind="stable")
                    stream = replace(stream.rows(order), time=stream.stamps[order])
                slots = _slots(stream, np.array([0, len(stream)]), entry["time"].shape[1], [self.intervals[i, 1]])[1]
                entry["time"][i, slots], entry["valid"][i, slots] = stream.time, 1
                entry["value"][i, slots] = stream.value
                if "side" in entry:
                    entry["side"][i, slots] = stream.side

    def fixes(self, i: int) -> Iterator[tuple[Array, NDArray[np.bool_]]]:
        """See `ObservedSteps.fixes`. It works for the last simulated step only."""
        runs, b = self._runs, self._b
        for j, who in enumerate(runs.who[b, : runs.count[b]].tolist()):
            if _draws(runs.kinds[b][who]):
                yield runs.value[b, j : j + 1, :2].copy(), runs.faults[b, j : j + 1] != 0


def crowded(runs: SteppedRuns, slots: tuple[Integers, Integers], found: int) -> ValueError:
    """The error that `keep` found: an instrument delivered more than its datasheet allows."""
    b, i = divmod(found, slots[0].shape[1])
    return ValueError(
        f"{runs.names[b][i]} delivered more than {slots[1][b, i]} samples in one step at "
        f"{runs.interval_of(b)[1]:.3f} s, which is what its datasheet's rate allows"
    )


def _slots(
    stream: AidStream, cut: NDArray[np.intp], most: int, ends: Array | Sequence[float]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The step and the slot within it of each reading of a stream.

    With c channels the slot of channel j at the k-th time of a step is k c + j.

    Parameters
    ----------
    stream : AidStream
        Readings of an instrument.
    cut : (n + 1,) int array
        Index limits of the readings of each of n steps.
    most : int
        Number of slots of a step.
    ends : (n,) array
        Ends of the steps [s].

    Raises
    ------
    ValueError
        If there are more readings than slots.
    """
    row = np.repeat(np.arange(len(cut) - 1), np.diff(cut))
    if not stream.channels:
        slot = np.arange(cut[-1]) - cut[row]
    else:
        time = stream.time[: cut[-1]]
        tick = np.cumsum(np.diff(time, prepend=np.nan) != 0.0)
        slot = (tick - tick[cut[row]]) * len(stream.channels) + stream.channel[: cut[-1]]
    if len(slot) and slot.max() >= most:
        worst = int(slot.argmax())
        raise _too_many(stream.name, int(slot[worst]) + 1, most, float(ends[row[worst]]))
    return row, slot


def _too_many(name: str, count: int, most: int, time: float) -> ValueError:
    return ValueError(
        f"{name} delivered {count} samples in one step at {time:.3f} s, its datasheet's rate allows {most}"
    )


def pack(block: Block, begin: float, most: Mapping[str, int]) -> ObservedSteps:
    """Sort the data of a block into its steps, the first of which begins at ``begin``."""
    truth, n = block.truth, len(block.truth)
    edges = truth.time + TIME_TOLERANCE
    columns: dict[str, dict[str, NDArray[Any]]] = {}
    cuts: dict[str, NDArray[np.intp]] = {}
    parts: dict[str, tuple[NDArray[np.intp], dict[str, Array]]] = {}
    aids = dict(block.aids)
    if block.imu is not None:
        imu = block.imu
        parts["imu"] = (
            np.searchsorted(imu.time, edges, side="right"),
            {
                "time": imu.time,
                "length": imu.interval,
                "angular_rate": imu.angular_rate,
                "specific_force": imu.specific_force,
            },
        )
    for name, s in block.aids.items():
        order, step = s.delivered(edges)
        if s.has_clock:
            aids[name] = s = replace(s.rows(order), time=s.stamps[order])
        parts[name] = np.searchsorted(step, np.arange(n), side="right"), {"time": s.time, "value": s.value}
        if s.channels and s.side.shape[1]:
            parts[name][1]["side"] = s.side
    for name, (last, arrays) in parts.items():
        cuts[name] = cut = np.concatenate(([0], last))
        counts, k = np.diff(cut), most[name]
        stream = aids.get(name)
        if (counts == k).all():  # the usual case needs no copy
            columns[name] = {key: a[: n * k].reshape(n, k, *a.shape[1:]) for key, a in arrays.items()}
            columns[name]["valid"] = np.ones((n, k), np.int8)
            continue
        if stream is not None:
            where = _slots(stream, cut, k, truth.time)
        elif counts.max() > k:
            raise _too_many(name, int(counts.max()), k, truth.time[counts.argmax()])
        else:
            row = np.repeat(np.arange(n), counts)
            where = row, np.arange(cut[-1]) - cut[row]
        arrays["valid"] = np.ones(len(arrays["time"]), np.int8)
        columns[name] = {}
        for key, a in arrays.items():
            columns[name][key] = out = np.zeros((n, k, *a.shape[1:]), a.dtype)
            out[where] = a[: cut[-1]]
    intervals = np.stack([np.concatenate(([begin], truth.time[:-1])), truth.time], axis=1)
    states = np.stack([truth.position, truth.velocity, truth.attitude], axis=1)
    return ObservedSteps(intervals, columns, states, rows_of(truth.position, truth.attitude), aids, cuts)


@kernel
def _rows(
    position: Annotated[NDArray[np.float64], "float64[:, :]"],
    attitude: Annotated[NDArray[np.float64], "float64[:, :]"],
    out: Matrix,
) -> None:
    for i in range(out.shape[0]):
        _row(position[i, 0], position[i, 1], position[i, 2], attitude[i, 2], out[i])


def rows_of(position: Array, attitude: Array) -> list[list[float]]:
    """For each state: latitude, longitude, height, metres per radian of latitude and of longitude, and heading."""
    out = np.empty((len(position), 6))
    _rows(position, attitude, out)
    rows: list[list[float]] = out.tolist()
    return rows


def horizontal(estimate: list[float], row: list[float]) -> tuple[float, float]:
    """North and east error [m] (as `simnav.geometry.earth.relative_position`, in plain floats: once a step)."""
    east = math.remainder(estimate[1] - row[1], math.tau)
    return (estimate[0] - row[0]) * row[3], east * row[4]
