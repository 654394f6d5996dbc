"""A recording for other programs: one file (npz), or a folder of CSV or Parquet files.

A folder has one file for the truth, one for the IMU, and one for each aiding instrument, and beside them what an
estimator is told at the start: ``README.md`` for people and ``start.json`` for programs. Columns end in their unit;
angles are in degrees. Of an instrument with channels each reading is a row, with its channel and side information.
Nothing is rounded: a file read back holds the same numbers, up to the conversion from radians.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.spec import UNITS
from simnav.types import KINDS, Array

from .files import complete_file, write_whole
from .formats import writes
from .hidden import has_truth
from .recording_mcap import write_mcap
from .recording_nmea import write_nmea
from .recording_pd0 import write_pd0
from .recording_readme import readme, start_text
from .recording_rinex import write_rinex
from .recording_tracks import write_gpx, write_kml
from .recording_tum import write_tum

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = [
    "write_csv", "write_gpx", "write_kml", "write_mcap", "write_nmea", "write_npz", "write_parquet", "write_pd0",
    "write_rinex", "write_tum",
]  # fmt: skip

#: Columns of the truth and of the IMU, with their units.
_TRUTH = {
    **dict.fromkeys(("latitude", "longitude"), "deg"),
    "height": "m",
    **dict.fromkeys(("velocity_north", "velocity_east", "velocity_down"), "m_s"),
    **dict.fromkeys(("roll", "pitch", "yaw"), "deg"),
}
_IMU_UNITS = (("angular_rate", "deg_s"), ("specific_force", "m_s2"))
_IMU = {f"{name}_{axis}": unit for name, unit in _IMU_UNITS for axis in "xyz"}


@writes("recording", "npz")
def write_npz(recording: Recording, path: Path) -> list[Path]:
    """The whole recording, which `simnav.recording.Recording.load` reads."""
    path.parent.mkdir(parents=True, exist_ok=True)
    recording.save(path)
    return [path]


@writes("recording", "csv")
def write_csv(recording: Recording, path: Path) -> list[Path]:
    """A folder with ``truth.csv``, ``imu.csv``, one ``<instrument>.csv`` each, ``README.md`` and ``start.json``.

    A recording without truth has no ``truth.csv``, and its instruments no column of faults.
    """
    written = [_write_csv(path / f"{name}.csv", columns) for name, columns in tables_of(recording, path)]
    return [*written, *_beside(recording, path, "csv")]


@writes("recording", "parquet")
def write_parquet(recording: Recording, path: Path) -> list[Path]:
    """A folder as of ``csv``, with Parquet files whose fields hold their unit as metadata (``unit``)."""
    written = [_write_parquet(path / f"{name}.parquet", columns) for name, columns in tables_of(recording, path)]
    return [*written, *_beside(recording, path, "parquet")]


def _beside(recording: Recording, path: Path, ending: str) -> list[Path]:
    """What an estimator is told at the start, for people and for programs."""
    text = readme(recording, ending)
    return [write_whole(path / "README.md", text), write_whole(path / "start.json", start_text(recording))]


class Column(NamedTuple):
    """A column of a file: its values, their unit, and how they are printed."""

    values: NDArray[Any]
    unit: str = ""
    form: str = "%.17g"


Columns: TypeAlias = dict[str, Column]


def tables_of(recording: Recording, path: Path) -> Iterator[tuple[str, Columns]]:
    """Name and columns of each file of a recording, in a folder that is made."""
    path.mkdir(parents=True, exist_ok=True)
    truth, imu = recording.data.truth, recording.data.imu
    told = has_truth(recording)
    if told:
        states = np.hstack([truth.position, truth.velocity, truth.attitude])
        yield "truth", _columns(truth.time, _TRUTH, states)
    if imu is not None:
        samples = np.hstack([imu.angular_rate, imu.specific_force])
        yield "imu", _columns(imu.time, _IMU, samples)
    for whole in recording.data.aids.values():
        stream = whole.as_delivered()
        kind = KINDS[stream.kind]
        units = {c.name: c.unit for c in (*kind.components, *(kind.side if stream.channels else ()))}
        values = np.hstack([stream.value, stream.side]) if stream.channels else stream.value
        found = _columns(stream.time, units, values)
        if stream.channels:
            time = found.pop("time_s")
            found = {"time_s": time, "channel": Column(np.array(stream.channels)[stream.channel], "", "%s"), **found}
        if told:  # bit mask of the faults that touched the measurement
            found["faults"] = Column(stream.faults, "", "%d")
        if stream.states_sigma:
            for c, sigma in zip(kind.components, stream.side.T, strict=True):
                found[f"sigma_{c.error}_{c.error_unit}"] = Column(sigma * _scale(c.error_unit), c.error_unit)
        if whole.has_clock:
            found["arrival_s"] = Column(stream.arrivals, "s")
            if told:
                valid = whole.time[np.argsort(whole.stamps, kind="stable")]
                found["time_of_validity_s"] = Column(valid, "s")
        yield stream.name, found


def _columns(time: Array, units: Mapping[str, str], values: Array) -> Columns:
    """The time, and columns of the given names and units."""
    found = {"time_s": Column(time, "s")}
    for (name, unit), column in zip(units.items(), values.T, strict=True):
        found[f"{name}_{unit}" if unit else name] = Column(column * _scale(unit), unit)
    return found


def _scale(unit: str) -> float:
    """From SI units and radians. Degrees as NumPy has them: 180 / pi, where a division may differ in the last digit."""
    return float(np.degrees(1.0)) if unit in ("deg", "deg_s") else 1.0 / UNITS.get(unit, 1.0)


def _write_csv(path: Path, columns: Columns) -> Path:
    rows: NDArray[Any] = np.empty((len(columns["time_s"].values), len(columns)), dtype=object)
    for i, column in enumerate(columns.values()):
        rows[:, i] = column.values
    text = io.StringIO()
    forms = [c.form for c in columns.values()]
    np.savetxt(text, rows, fmt=forms, delimiter=",", header=",".join(columns), comments="")
    return write_whole(path, text.getvalue())


def _write_parquet(path: Path, columns: Columns) -> Path:
    import pyarrow as pa
    from pyarrow import parquet

    arrays = [pa.array(c.values) for c in columns.values()]
    fields = [
        pa.field(name, array.type, metadata={"unit": c.unit} if c.unit else None)
        for (name, c), array in zip(columns.items(), arrays, strict=True)
    ]
    with complete_file(path) as partial:
        parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), partial)
    return path
