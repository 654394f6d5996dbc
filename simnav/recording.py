"""A recording: all measurements of a run, with the truth and the labels of the faults.

Simulated runs and real logs have the same form. A `Block` is a part of a run, from one time to another. A `Recording`
is a whole run with its initial state and its datasheets. Each measurement has labels: the faults that affected it, the
error that the faults added, and the standard deviation of its true noise.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.declared_process import DeclaredProcess, Factor
from simnav.labels import FaultLabel
from simnav.timing import TIME_TOLERANCE, TimingSheet
from simnav.types import (
    Array,
    Datasheet,
    ImuDatasheet,
    ImuSamples,
    InitialState,
    Instruments,
    Measurement,
    Measurements,
    NavigationStates,
    ReferenceStates,
    StateBlock,
    TapStates,
    TriadDatasheet,
)

__all__ = ["AidStream", "Block", "ImuLabels", "Recording", "RecordingError", "from_arrays", "packets", "to_arrays"]

#: Version of the files that `Recording.save` writes. It is increased when their format changes.
FORMAT = 1


class RecordingError(ValueError):
    """A file is not a recording that this version of simnav can read."""


def _no_channel() -> NDArray[np.int16]:
    return np.empty(0, np.int16)


def _no_sides() -> Array:
    return np.empty((0, 0))


def _no_times() -> Array:
    return np.empty(0)


@dataclass(frozen=True, eq=False)
class AidStream:
    """All k measurements of one aiding instrument in an interval of time, with their labels.

    Attributes
    ----------
    name, kind : str
        Name of the instrument in its scenario, and its kind.
    time : (k,) array
        True times of validity [s], ascending. An estimator receives the stamps (``stamp``).
    value : (k, d) array
        Measured values, including faults; components as in ``KINDS[kind].values``.
    faults : (k,) uint32 array
        Bit j is set if fault j of the recording affected the measurement.
    fault_error : (k, d) array
        Error that the faults added, in the units of ``KINDS[kind].errors``.
    sigma : (k, d) array
        Standard deviation of the true white noise of the measurement, in the same units.
    dropped : (m,) array
        Times [s] of measurements that are missing because of an outage or a lost bottom lock.
    channels : tuple of str
        Identifiers of the channels of the instrument (``Datasheet.channels``). Without channels this and the rest are
        empty.
    channel : (k,) int16 array
        For each reading, the index of its channel in ``channels``. Readings of one time follow each other, in the order
        of the channels.
    side : (k, s) array
        Side information of each reading; components as in ``KINDS[kind].side``. Without channels it may be the (k, d)
        standard deviations that the readings state (`Datasheet.stated`).
    dropped_channel : (m,) int16 array
        The channel of each missing measurement.
    stamp, arrival : (k,) array
        Time stamp with which each reading is delivered, and when it arrives [s]. Empty: both are ``time``.
    """

    name: str
    kind: str
    time: Array
    value: Array
    faults: NDArray[np.uint32]
    fault_error: Array
    sigma: Array
    dropped: Array
    channels: tuple[str, ...] = ()
    channel: NDArray[np.int16] = field(default_factory=_no_channel)
    side: Array = field(default_factory=_no_sides)
    dropped_channel: NDArray[np.int16] = field(default_factory=_no_channel)
    stamp: Array = field(default_factory=_no_times)
    arrival: Array = field(default_factory=_no_times)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def has_clock(self) -> bool:
        """Whether stamps or arrivals may differ from the times of validity."""
        return len(self.stamp) > 0 or len(self.arrival) > 0

    @property
    def states_sigma(self) -> bool:
        """Whether readings of an instrument without channels state their standard deviations."""
        return not self.channels and self.side.ndim == 2 and self.side.shape[1] > 0

    @property
    def optional(self) -> tuple[str, ...]:
        """The arrays that only some streams have, and this one has."""
        clock = tuple(n for n in _CLOCK_ARRAYS if len(getattr(self, n)))
        return (*clock, "side") if self.states_sigma else clock

    @property
    def stamps(self) -> Array:
        """(k,) array: the time stamps with which the readings are delivered [s]."""
        return self.stamp if len(self.stamp) else self.time

    @property
    def arrivals(self) -> Array:
        """(k,) array: when the readings arrive [s]."""
        return self.arrival if len(self.arrival) else self.time

    def rows(self, keep: NDArray[Any] | slice) -> AidStream:
        """Some of the readings: a mask, or the indices of rows."""
        names = (*_AID_ARRAYS[:-1], *(("channel", "side") if self.channels else ()))
        names += self.optional
        return replace(self, **{n: getattr(self, n)[keep] for n in names})

    def as_delivered(self) -> AidStream:
        """The readings in order of their stamps, which take the place of the times of validity; arrivals stay."""
        if not self.has_clock:
            return self
        stream = self.rows(np.argsort(self.stamps, kind="stable"))
        return replace(stream, time=stream.stamps, stamp=np.empty(0), arrival=stream.arrivals)

    def delivered(self, edges: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """In which order the readings are delivered, and in which step: the one in which each arrives.

        Parameters
        ----------
        edges : (n,) array
            Ends of n steps [s].

        Returns
        -------
        order, step : (k,) int array
            Rows, by step and then by stamp; and the step of each of these rows. It is n for what arrives later.
        """
        step = np.searchsorted(edges, self.arrivals)
        if not self.has_clock:
            return np.arange(len(self)), step
        order = np.lexsort((self.stamps, step))
        return order, step[order]

    @staticmethod
    def concatenate(parts: Sequence[AidStream]) -> AidStream:
        """Join the measurements of consecutive intervals."""
        names = _CHANNEL_ARRAYS if parts[0].channels else _AID_ARRAYS
        if any(p.states_sigma for p in parts):
            names = (*names, "side")
        joined = {n: np.concatenate([getattr(p, n) for p in parts]) for n in names}
        for name in _CLOCK_ARRAYS:
            if any(len(getattr(p, name)) for p in parts):
                joined[name] = np.concatenate([getattr(p, f"{name}s") for p in parts])
        return AidStream(parts[0].name, parts[0].kind, **joined, channels=parts[0].channels)

    def places(self, time: Array, channel: NDArray[np.int16]) -> NDArray[np.intp]:
        """The rows of readings of this stream, from their (m,) times and, with channels, the (m,) indices of those."""
        if not self.channels:
            return np.searchsorted(self.time, time)
        times, c = np.unique(self.time), len(self.channels)
        own = np.searchsorted(times, self.time) * c + self.channel
        return np.searchsorted(own, np.searchsorted(times, time) * c + channel)

    def measurements(self) -> Iterator[Measurement]:
        """The readings as an estimator receives them, in order."""
        if self.states_sigma:
            for t, v, side in zip(self.stamps, self.value, self.side, strict=True):
                yield Measurement(float(t), self.name, self.kind, v, side=side)
            return
        if not self.channels:
            for t, v in zip(self.stamps, self.value, strict=True):
                yield Measurement(float(t), self.name, self.kind, v)
            return
        for t, v, c, side in zip(self.stamps, self.value, self.channel, self.side, strict=True):
            yield Measurement(float(t), self.name, self.kind, v, self.channels[c], side)


@dataclass(frozen=True, eq=False)
class ImuLabels:
    """Labels of n IMU samples.

    Attributes
    ----------
    faults : (n,) uint32 array
        Bit j is set if fault j of the recording affected the sample.
    fault_error : (n, 6) array
        Error that the faults added: angular rate [rad/s], then specific force [m/s^2].
    """

    faults: NDArray[np.uint32]
    fault_error: Array


@dataclass(frozen=True, eq=False)
class Block:
    """The interval (start, end] of a run: measurements, labels and truth.

    Attributes
    ----------
    start, end : float
        Limits of the interval [s].
    imu : ImuSamples or None
        Samples within the interval; None for a vessel without an IMU.
    imu_labels : ImuLabels or None
        Labels of the samples; None if no fault of the scenario affects the IMU.
    aids : dict of str to AidStream
        Measurements of each aiding instrument, by its name.
    truth : NavigationStates
        True states at the ends of the steps within the interval. For a simulated run they are `TapStates`, which also
        hold the current.
    """

    start: float
    end: float
    imu: ImuSamples | None
    imu_labels: ImuLabels | None
    aids: dict[str, AidStream]
    truth: NavigationStates

    @staticmethod
    def concatenate(parts: Sequence[Block]) -> Block:
        """Join consecutive blocks."""
        first, imu, labels = parts[0], None, None
        if first.imu is not None:
            names = ("time", "interval", "angular_rate", "specific_force")
            imu = ImuSamples(*(np.concatenate([getattr(p.imu, n) for p in parts]) for n in names))
        if first.imu_labels is not None:
            labels = ImuLabels(
                *(np.concatenate([getattr(p.imu_labels, n) for p in parts]) for n in ("faults", "fault_error"))
            )
        kinds = {_kind_of(p.truth) for p in parts}
        kind = kinds.pop() if len(kinds) == 1 else NavigationStates
        truth = kind(*(np.concatenate([getattr(p.truth, n) for p in parts]) for n in _STATES_OF[kind]))
        aids = {n: AidStream.concatenate([p.aids[n] for p in parts]) for n in first.aids}
        return Block(first.start, parts[-1].end, imu, labels, aids, truth)


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """A whole run.

    Attributes
    ----------
    scenario : str
        Id of the scenario with its version, e.g. ``open-sea-v1``.
    seed : int
        Seed of the run.
    instruments : Instruments
        The datasheets; ``instruments.step`` is the step of the run [s].
    initial_truth : NavigationStates
        One state: the truth at time 0.
    start : InitialState
        Initial state with errors, which an estimator receives.
    faults : tuple of FaultLabel
        The faults of the run; fault j has bit j in ``AidStream.faults``.
    data : Block
        The measurements from time 0 to the end; ``data.truth`` holds the true states at the ends of all steps.
    note : str
        Remarks on the run, e.g. which recording of a folder of logs it is.
    draws : mapping of str to object
        Values that were drawn for this run, by key path, in the units of the scenario's file.
    actual : Instruments or None
        Datasheets with the true figures, if those in ``instruments`` are wrong.
    actual_covariance : (9, 9) array or None
        True covariance of the errors of ``start``, if the covariance in ``start`` is wrong.
    origins : mapping of str to mapping
        What exports need beyond the datasheet, by instrument (`AidSpec.origin`). No estimator receives it.
    """

    scenario: str
    seed: int
    instruments: Instruments
    initial_truth: NavigationStates
    start: InitialState
    faults: tuple[FaultLabel, ...]
    data: Block
    note: str = ""
    draws: Mapping[str, Any] = field(default_factory=dict)
    actual: Instruments | None = None
    actual_covariance: Array | None = None
    origins: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def __repr__(self) -> str:
        names = [*(["imu"] if self.instruments.imu is not None else []), *self.instruments]
        return f"<Recording: {self.scenario}, seed {self.seed}, {self.duration:g} s, {', '.join(names)}>"

    @property
    def duration(self) -> float:
        """Length of the run [s]."""
        return self.data.end

    def steps(self) -> Iterator[Measurements]:
        """The packets of measurements that an estimator receives, one for each step, in order."""
        yield from packets(self.data, self.data.truth.time)

    def save(self, path: str | Path) -> None:
        """Write the recording to one npz file, completely or not at all.

        The file is written under a temporary name beside ``path`` and renamed at the end. So an interrupted write or a
        full disk leaves no incomplete file, and an existing file stays as it is.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        path = Path(path)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            with open(temporary, "wb") as file:
                facts, arrays = to_arrays(self)
                np.savez(file, allow_pickle=False, meta=np.array(json.dumps(facts)), **arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Read a recording that `save` wrote.

        Raises
        ------
        RecordingError
            If the file is not a recording, is damaged, or was written in another format.
        FileNotFoundError
            If there is no such file.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                if "meta" not in file:
                    raise RecordingError(f"{path}: not a recording of simnav")
                meta = json.loads(str(file["meta"]))
                if meta.get("format") != FORMAT:
                    raise RecordingError(
                        f"{path}: written in format {meta.get('format')!r} of recordings, but this version of simnav "
                        f"reads format {FORMAT}; record it again"
                    )
                return from_arrays(meta, {name: file[name] for name in file.files})
        except RecordingError:
            raise
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise RecordingError(f"{path}: not a recording of simnav, or damaged ({error})") from None


def packets(data: Block, ends: Array) -> Iterator[Measurements]:
    """Cut a block into the packets of successive steps.

    Parameters
    ----------
    data : Block
        Measurements, IMU samples included.
    ends : (n,) array
        End of each step [s], ascending; the first step begins at ``data.start``.

    Yields
    ------
    Measurements
        The packet of each step: the IMU samples within it, and the aiding measurements that arrive within it.
    """
    edges = np.asarray(ends) + TIME_TOLERANCE
    streams = list(data.aids.values())
    every = [m for s in streams for m in s.measurements()]
    step = np.concatenate([np.searchsorted(edges, s.arrivals) for s in streams] or [np.empty(0, np.intp)])
    # Stable: ties keep the scenario's order of instruments.
    order = np.lexsort((np.array([m.time for m in every]), step)).tolist()
    aids, cut = [every[k] for k in order], np.searchsorted(step[order], np.arange(len(edges)), side="right")
    cut_imu = None if data.imu is None else np.searchsorted(data.imu.time, edges, side="right")
    start, i, j = data.start, 0, 0
    for k, end in enumerate(ends):
        imu = None
        if data.imu is not None and cut_imu is not None:
            imu = data.imu[j : int(cut_imu[k])]
            j = int(cut_imu[k])
        yield Measurements(start, float(end), imu, aids[i : int(cut[k])])
        start, i = float(end), int(cut[k])


_AID_ARRAYS = ("time", "value", "faults", "fault_error", "sigma", "dropped")
_CHANNEL_ARRAYS = (*_AID_ARRAYS, "channel", "side", "dropped_channel")
#: Arrays that a stream has where its clock is not perfect.
_CLOCK_ARRAYS = ("stamp", "arrival")
_IMU_ARRAYS = ("time", "interval", "angular_rate", "specific_force")
_STATE_ARRAYS = ("time", "position", "velocity", "attitude")
_STATES_OF: dict[type[NavigationStates], tuple[str, ...]] = {
    NavigationStates: _STATE_ARRAYS,
    TapStates: (*_STATE_ARRAYS, "angular_rate", "water_velocity"),
    ReferenceStates: (*_STATE_ARRAYS, "sigma", "quality"),
}


def _kind_of(truth: NavigationStates) -> type[NavigationStates]:
    """The class of states that a file keeps."""
    return type(truth) if type(truth) in _STATES_OF else NavigationStates


#: Fields of a datasheet that most have not.
_OPTIONAL = ("details", "blocks", "channels", "processes", "timing", "sources", "stated")
_TRIADS = ("gyroscope", "accelerometer")


def _sheet(sheet: Datasheet | ImuDatasheet) -> dict[str, Any]:
    """A datasheet as a dictionary for JSON, without the fields of `_OPTIONAL` that are empty."""
    return {k: _plain(v) for k, v in asdict(sheet).items() if k not in _OPTIONAL or v}


def _imu_sheet(sheet: ImuDatasheet) -> dict[str, Any]:
    """The datasheet of an IMU as a dictionary for JSON; a triad names assumed figures only if it has any."""
    table = _sheet(sheet)
    for triad in _TRIADS:
        table[triad] = {k: v for k, v in table[triad].items() if k != "assumed" or v}
    return table


def _sheets(instruments: Instruments) -> dict[str, Any]:
    imu = instruments.imu
    return {"imu": None if imu is None else _imu_sheet(imu), "aids": [_sheet(a) for a in instruments.values()]}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def to_arrays(recording: Recording) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """The parts of a recording for a file: plain facts, which JSON takes, and arrays.

    Returns
    -------
    facts : dict
        Scenario, seed, datasheets, faults and draws. Infinity is a float.
    arrays : dict of str to array
        The arrays under names like ``truth.position`` and ``aid.dvl.value``. `from_arrays` takes both.
    """
    data, instruments = recording.data, recording.instruments
    facts = {
        "format": FORMAT,
        "scenario": recording.scenario,
        "seed": int(recording.seed),
        "note": recording.note,
        "step": instruments.step,
        "begin": data.start,
        "end": data.end,
        **_sheets(instruments),
        "streams": {name: s.kind for name, s in data.aids.items()},
        "faults": [{k: v for k, v in asdict(f).items() if k != "channels" or v} for f in recording.faults],
        "start_time": recording.start.time,
    }
    if recording.draws:
        facts["draws"] = dict(recording.draws)
    if recording.actual is not None:
        facts["actual"] = _sheets(recording.actual)
    if recording.actual_covariance is not None:
        facts["actual_covariance"] = recording.actual_covariance.tolist()
    if recording.origins:
        facts["origins"] = {name: dict(origin) for name, origin in recording.origins.items()}
    arrays: dict[str, NDArray[Any]] = {}

    def add(prefix: str, holder: object, names: Sequence[str]) -> None:
        arrays.update({f"{prefix}.{n}": getattr(holder, n) for n in names})

    add("truth", data.truth, _STATES_OF[_kind_of(data.truth)])
    add("initial_truth", recording.initial_truth, _STATE_ARRAYS)
    add("start", recording.start, ("position", "velocity", "attitude", "covariance"))
    if data.imu is not None:
        add("imu", data.imu, _IMU_ARRAYS)
    if data.imu_labels is not None:
        add("imu_labels", data.imu_labels, ("faults", "fault_error"))
    for name, stream in data.aids.items():
        add(f"aid.{name}", stream, _CHANNEL_ARRAYS if stream.channels else _AID_ARRAYS)
        add(f"aid.{name}", stream, stream.optional)
    return facts, arrays


def _instruments(sheets: Mapping[str, Any], step: float) -> Instruments:
    """The datasheets from their dictionaries: the inverse of `_sheets`."""
    imu = sheets["imu"]
    if imu is not None:
        triads = {n: TriadDatasheet(**{**imu[n], "assumed": tuple(imu[n].get("assumed", ()))}) for n in _TRIADS}
        imu = ImuDatasheet(**{**imu, **triads})
    aids = []
    for aid in sheets["aids"]:
        fields: dict[str, Any] = {
            k: np.array(v, dtype=np.float64) if isinstance(v, list) and k not in _OPTIONAL else v
            for k, v in aid.items()
        }
        fields["blocks"] = tuple(StateBlock(**block) for block in aid.get("blocks", ()))
        fields["channels"] = tuple(aid.get("channels", ()))
        fields["timing"] = TimingSheet(**aid["timing"]) if "timing" in aid else None
        fields["processes"] = tuple(_process(p) for p in aid.get("processes", ()))
        fields["sources"] = tuple(aid.get("sources", ()))
        aids.append(Datasheet(**fields))
    return Instruments(aids, imu, step)


def _process(given: Mapping[str, Any]) -> DeclaredProcess:
    exact = None if given["exact"] is None else StateBlock(**given["exact"])
    factors = tuple(Factor(**factor) for factor in given["factors"])
    return DeclaredProcess(**{**given, "block": StateBlock(**given["block"]), "exact": exact, "factors": factors})


def from_arrays(facts: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Recording:
    """The recording whose parts `to_arrays` gave.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a part is missing or is not as it should be.
    """

    def get(prefix: str, names: Sequence[str]) -> list[Any]:
        return [arrays[f"{prefix}.{n}"] for n in names]

    told = (k for k, names in _STATES_OF.items() if f"truth.{names[-1]}" in arrays and k is not NavigationStates)
    kind = next(told, NavigationStates)
    channels = {aid["name"]: tuple(aid.get("channels", ())) for aid in facts["aids"]}

    def stream(name: str, kind: str) -> AidStream:
        names: tuple[str, ...] = _CHANNEL_ARRAYS if channels.get(name) else _AID_ARRAYS
        names += tuple(n for n in (*_CLOCK_ARRAYS, "side") if f"aid.{name}.{n}" in arrays and n not in names)
        arrays_of = dict(zip(names, get(f"aid.{name}", names), strict=True))
        return AidStream(name, kind, **arrays_of, channels=channels.get(name, ()))

    data = Block(
        facts["begin"],
        facts["end"],
        ImuSamples(*get("imu", _IMU_ARRAYS)) if "imu.time" in arrays else None,
        ImuLabels(*get("imu_labels", ("faults", "fault_error"))) if "imu_labels.faults" in arrays else None,
        {name: stream(name, kind) for name, kind in facts["streams"].items()},
        kind(*get("truth", _STATES_OF[kind])),
    )
    return Recording(
        facts["scenario"],
        facts["seed"],
        _instruments(facts, facts["step"]),
        NavigationStates(*get("initial_truth", _STATE_ARRAYS)),
        InitialState(facts["start_time"], *get("start", ("position", "velocity", "attitude", "covariance"))),
        tuple(
            FaultLabel(
                f["kind"],
                tuple(f["instruments"]),
                f["start"],
                f["end"],
                f.get("parameters", {}),
                tuple(f.get("channels", ())),
            )
            for f in facts["faults"]
        ),
        data,
        facts["note"],
        facts.get("draws", {}),
        _instruments(facts["actual"], facts["step"]) if "actual" in facts else None,
        np.array(facts["actual_covariance"]) if "actual_covariance" in facts else None,
        facts.get("origins", {}),
    )
