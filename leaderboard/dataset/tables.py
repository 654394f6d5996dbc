"""A recording as tables of a data set, and back.

Samples of the IMU are rounded to a step below a 32nd of the noise that the datasheet declares for a sample. That adds
less than a ten-thousandth to the variance of the noise, and halves the files. They and the truth are in single
precision, except for positions.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.recording import AidStream, Recording, from_arrays, to_arrays
from simnav.types import KINDS, Array

from .schemas import (
    FORCE,
    IMU_ERROR,
    RATE,
    TRUTH_ATTITUDE,
    TRUTH_CURRENT,
    TRUTH_POSITION,
    TRUTH_VELOCITY,
    schemas,
)

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["from_tables", "to_tables"]

#: The step of rounding is at most the noise of a sample, over this.
_STEPS = 32.0

_START = ("position", "velocity", "attitude")
_STATES = (("position", TRUTH_POSITION), ("velocity", TRUTH_VELOCITY), ("attitude", TRUTH_ATTITUDE))
_MORE_STATES = (("angular_rate", RATE), ("water_velocity", TRUTH_CURRENT))


def to_tables(recording: Recording, number: int, told: bool) -> dict[str, pa.Table]:
    """The rows of a recording in each table.

    Parameters
    ----------
    recording : Recording
        The recording, without truth if it shall not be told.
    number : int
        Number of the voyage in its split.
    told : bool
        Write truth and labels.

    Returns
    -------
    dict of str to pyarrow.Table
        By the names of `schemas`; without an IMU its table is empty.
    """
    import pyarrow as pa

    found = {"voyages": _voyage(recording, told), "aids": _aids(recording, told), "imu": _imu(recording, told)}
    if told:
        found |= {"truth": _truth(recording), "missing": _missing(recording)}
    made = {}
    for name, schema in schemas(told).items():
        columns = found[name]
        n = len(columns["seed" if name == "voyages" else "time_s"])
        columns["voyage"] = np.full(n, number, np.int32)
        given = ((columns.get(f.name), f.type) for f in schema)  # labels that a recording does not have are null
        arrays = [
            pa.nulls(n, kind) if c is None else c if isinstance(c, pa.Array) else pa.array(c, kind) for c, kind in given
        ]
        made[name] = pa.Table.from_arrays(arrays, schema=schema)
    return made


def _voyage(recording: Recording, told: bool) -> dict[str, Any]:
    facts, _ = to_arrays(recording)
    start = recording.start
    row: dict[str, Any] = {
        "seed": recording.seed,
        "duration_s": recording.duration,
        "step_s": recording.instruments.step,
        "datasheets": json.dumps({key: facts[key] for key in ("imu", "aids")}),
        "start_time_s": start.time,
        "start_covariance": start.covariance.ravel().tolist(),
        **{f"start_{name}": getattr(start, name).tolist() for name in _START},
    }
    if told:
        actual = {key: facts[key] for key in ("actual", "actual_covariance") if key in facts}
        told_facts = {"faults": facts["faults"], "draws": facts.get("draws", {}), "actual": actual}
        row |= {key: json.dumps(value) for key, value in told_facts.items()}
        row |= {f"initial_{name}": getattr(recording.initial_truth, name)[0].tolist() for name in _START}
    return {key: [value] for key, value in row.items()}


def _rounded(values: Array, noise: float) -> NDArray[np.float32]:
    """Values in single precision, at multiples of a power of two below a 32nd of the noise of a sample."""
    if noise <= 0.0:
        return values.astype(np.float32)
    step = 2.0 ** np.floor(np.log2(noise / _STEPS))
    rounded: NDArray[np.float32] = (np.rint(values / step) * step).astype(np.float32)
    return rounded


def _imu(recording: Recording, told: bool) -> dict[str, Any]:
    imu, sheet, labels = recording.data.imu, recording.instruments.imu, recording.data.imu_labels
    if imu is None or sheet is None:
        return {"time_s": np.empty(0)}
    root = np.sqrt(sheet.rate)
    rate = _rounded(imu.angular_rate, sheet.gyroscope.random_walk * root)
    force = _rounded(imu.specific_force, sheet.accelerometer.random_walk * root)
    columns = {"time_s": imu.time, "interval_s": imu.interval, **_apart(RATE, rate), **_apart(FORCE, force)}
    if told and labels is not None:
        columns |= {"faults": labels.faults, **_apart(IMU_ERROR, labels.fault_error.astype(np.float32))}
    return columns


def _apart(names: tuple[str, ...], values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The columns of an array, each on its own."""
    return dict(zip(names, np.ascontiguousarray(values.T), strict=True))


def _aids(recording: Recording, told: bool) -> dict[str, Any]:
    import pyarrow as pa

    streams = []  # each in the order of its stamps, as an estimator receives it
    for s in recording.data.aids.values():
        streams.append(s.rows(np.argsort(s.stamps, kind="stable")) if s.has_clock else s)
    columns = {
        "instrument": _instruments(streams, [len(s) for s in streams]),
        "channel": _channels(streams, [len(s) for s in streams]),
        "time_s": _joined(s.stamps for s in streams),
        "arrival_s": _of_clocks(streams, "arrivals"),
        "value": _lists([s.value for s in streams], pa.float64()),
        "side": _lists([s.side if s.side.size else np.empty((len(s), 0)) for s in streams], pa.float64()),
    }
    if told:
        columns["faults"] = _joined(s.faults for s in streams).astype(np.uint32)
        columns["fault_error"] = _lists([s.fault_error for s in streams], pa.float32())
        columns["sigma"] = _lists([s.sigma for s in streams], pa.float32())
        columns["time_of_validity_s"] = _of_clocks(streams, "time")
    return columns


def _missing(recording: Recording) -> dict[str, Any]:
    streams = list(recording.data.aids.values())
    counts = [len(s.dropped) for s in streams]
    return {
        "instrument": _instruments(streams, counts),
        "channel": _channels(streams, counts, missing=True),
        "time_s": _joined(s.dropped for s in streams),
    }


def _joined(parts: Iterable[NDArray[Any]]) -> NDArray[Any]:
    return np.concatenate([np.empty(0), *parts])


def _instruments(streams: list[AidStream], counts: list[int]) -> pa.Array:
    """For each reading the name of its instrument."""
    import pyarrow as pa

    indices = np.repeat(np.arange(len(streams), dtype=np.int32), counts)
    return pa.DictionaryArray.from_arrays(indices, pa.array([s.name for s in streams], pa.string()))


def _channels(streams: list[AidStream], counts: list[int], missing: bool = False) -> pa.Array:
    """For each reading the name of its channel; null for an instrument without channels."""
    import pyarrow as pa

    names = list(dict.fromkeys(c for s in streams for c in s.channels))
    parts = []
    for s, n in zip(streams, counts, strict=True):
        own = np.array([names.index(c) for c in s.channels], np.int32)
        parts.append(own[s.dropped_channel if missing else s.channel] if s.channels else np.full(n, -1, np.int32))
    indices = _joined(parts).astype(np.int32)
    return pa.DictionaryArray.from_arrays(pa.array(indices, mask=indices < 0), pa.array(names, pa.string()))


def _of_clocks(streams: list[AidStream], name: str) -> pa.Array:
    """Times of the streams whose clock is not perfect; null for the others."""
    import pyarrow as pa

    times = _joined(getattr(s, name) if s.has_clock else np.full(len(s), np.nan) for s in streams)
    return pa.array(times, mask=np.isnan(times))


def _lists(parts: list[Array], kind: pa.DataType) -> pa.Array:
    """A list in each row, from (k, d) arrays that may differ in d."""
    import pyarrow as pa

    lengths = [np.full(len(p), p.shape[1]) for p in parts]
    offsets = np.concatenate([[0], np.cumsum(_joined(lengths))]).astype(np.int32)
    flat = _joined(p.ravel() for p in parts).astype(kind.to_pandas_dtype())
    return pa.ListArray.from_arrays(offsets, pa.array(flat))


def _truth(recording: Recording) -> dict[str, Any]:
    truth, columns = recording.data.truth, {"time_s": recording.data.truth.time}
    for name, names in _STATES:
        columns |= _apart(names, getattr(truth, name))
    for name, names in _MORE_STATES:
        if hasattr(truth, name):
            columns |= _apart(names, getattr(truth, name))
    return columns


def from_tables(tables: Mapping[str, pa.Table], scenario: str) -> Recording:
    """The recording whose rows `to_tables` gave.

    Parameters
    ----------
    tables : mapping of str to pyarrow.Table
        Its rows in each table.
    scenario : str
        Versioned id of the family.

    Raises
    ------
    KeyError, TypeError, ValueError
        If the tables are not as `to_tables` made them.
    """
    (row,) = tables["voyages"].to_pylist()
    told = "truth" in tables
    sheets = json.loads(row["datasheets"])
    facts = {
        "scenario": scenario, "seed": row["seed"], "note": "", "step": row["step_s"], "begin": 0.0,
        "end": row["duration_s"], "start_time": row["start_time_s"], **sheets,
        "streams": {sheet["name"]: sheet["kind"] for sheet in sheets["aids"]},
        "faults": json.loads(row["faults"]) if told else [],
    }  # fmt: skip
    if told:
        facts |= {"draws": json.loads(row["draws"]), **json.loads(row["actual"])}
    arrays = {f"start.{name}": np.array(row[f"start_{name}"]) for name in _START}
    arrays["start.covariance"] = np.array(row["start_covariance"]).reshape(9, 9)
    arrays["initial_truth.time"] = np.zeros(1)
    for name in _START:
        arrays[f"initial_truth.{name}"] = np.array([row[f"initial_{name}"] if told else [np.nan] * 3])
    if sheets["imu"] is not None:
        arrays |= _imu_arrays(tables["imu"])
    for sheet in sheets["aids"]:
        arrays |= _aid_arrays(sheet, tables)
    return from_arrays(facts, arrays | _truth_arrays(row, tables.get("truth")))


def _together(table: pa.Table, names: tuple[str, ...]) -> Array:
    return np.stack([table[name].to_numpy() for name in names], axis=1).astype(np.float64)


def _imu_arrays(table: pa.Table) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {
        "imu.time": table["time_s"].to_numpy(),
        "imu.interval": table["interval_s"].to_numpy(),
        "imu.angular_rate": _together(table, RATE),
        "imu.specific_force": _together(table, FORCE),
    }
    if "faults" in table.schema.names and table["faults"].null_count == 0:
        arrays["imu_labels.faults"] = table["faults"].to_numpy()
        arrays["imu_labels.fault_error"] = _together(table, IMU_ERROR)
    return arrays


def _truth_arrays(row: Mapping[str, Any], table: pa.Table | None) -> dict[str, NDArray[Any]]:
    if table is None:
        n = round(row["duration_s"] / row["step_s"])
        nothing = {f"truth.{name}": np.full((n, 3), np.nan) for name, _ in _STATES}
        return {"truth.time": np.arange(1, n + 1) * row["step_s"], **nothing}
    arrays = {"truth.time": table["time_s"].to_numpy()}
    there = [(n, c) for n, c in _MORE_STATES if table[c[0]].null_count == 0]
    return arrays | {f"truth.{name}": _together(table, names) for name, names in (*_STATES, *there)}


def _aid_arrays(sheet: Mapping[str, Any], tables: Mapping[str, pa.Table]) -> dict[str, NDArray[Any]]:
    """The arrays of the stream of an instrument."""
    import pyarrow.compute as pc

    name, kind, channels = sheet["name"], KINDS[sheet["kind"]], list(sheet.get("channels", ()))
    rows = tables["aids"].filter(pc.equal(tables["aids"]["instrument"], name))
    n, width = len(rows), len(kind.values)

    def values(column: str, width: int) -> Array:
        flat = rows[column].combine_chunks().flatten().to_numpy(zero_copy_only=False)
        doubles: Array = flat.astype(np.float64).reshape(n, width)
        return doubles

    def of_channels(table: pa.Table) -> NDArray[np.int16]:
        return np.array([channels.index(c) for c in table["channel"].to_pylist()], np.int16)

    time, told = rows["time_s"].to_numpy(), "missing" in tables
    arrays: dict[str, NDArray[Any]] = {"time": time, "value": values("value", width)}
    sides = len(kind.side) if channels else width if sheet.get("stated") else 0
    if channels or sides:
        arrays["side"] = values("side", sides)
    if channels:
        arrays["channel"] = of_channels(rows)
    if n and rows["arrival_s"].null_count == 0:
        arrays["arrival"] = rows["arrival_s"].to_numpy()
    if told:
        gone = tables["missing"].filter(pc.equal(tables["missing"]["instrument"], name))
        arrays |= {"faults": rows["faults"].to_numpy(), "dropped": gone["time_s"].to_numpy()}
        arrays |= {label: values(label, width) for label in ("fault_error", "sigma")}
        if channels:
            arrays["dropped_channel"] = of_channels(gone)
        if "arrival" in arrays:
            order = np.argsort(valid := rows["time_of_validity_s"].to_numpy(), kind="stable")
            whole = {key: a[order] for key, a in arrays.items() if key not in ("dropped", "dropped_channel")}
            arrays |= {**whole, "time": valid[order], "stamp": time[order]}
    else:
        arrays |= {"faults": np.zeros(n, np.uint32), "fault_error": np.zeros((n, width)), "dropped": np.empty(0)}
        arrays["sigma"] = np.tile(np.asarray(sheet["sigma"], dtype=np.float64), (n, 1))
        if channels:
            arrays["dropped_channel"] = np.empty(0, np.int16)
    return {f"aid.{name}.{key}": array for key, array in arrays.items()}
