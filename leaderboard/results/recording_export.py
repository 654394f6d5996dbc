"""A recording for other programs: one file (npz), or a folder of CSV files.

A folder has one file for the truth, one for the IMU, and one for each aiding instrument, and beside them what an
estimator is told at the start: ``README.md`` for people and ``start.json`` for programs. Columns end in their unit;
angles are in degrees. Of an instrument with channels each reading is a row, with its channel and side information.
Nothing is rounded: a file read back holds the same numbers, up to the conversion from radians.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simnav.spec import UNITS
from simnav.types import KINDS, Array

from .files import write_whole
from .formats import writes
from .hidden import has_truth
from .recording_mcap import write_mcap
from .recording_nmea import write_nmea
from .recording_readme import readme, start_text
from .recording_rinex import write_rinex
from .recording_tracks import write_gpx, write_kml
from .recording_tum import write_tum

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write_csv", "write_gpx", "write_kml", "write_mcap", "write_nmea", "write_npz", "write_rinex", "write_tum"]

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
    path.mkdir(parents=True, exist_ok=True)
    truth, imu = recording.data.truth, recording.data.imu
    told = has_truth(recording)
    written = []
    if told:
        states = np.hstack([truth.position, truth.velocity, truth.attitude])
        written.append(_table(path / "truth.csv", truth.time, _TRUTH, states))
    if imu is not None:
        samples = np.hstack([imu.angular_rate, imu.specific_force])
        written.append(_table(path / "imu.csv", imu.time, _IMU, samples))
    for whole in recording.data.aids.values():
        stream = whole.as_delivered()
        file = path / f"{stream.name}.csv"
        kind = KINDS[stream.kind]
        units = {c.name: c.unit for c in (*kind.components, *(kind.side if stream.channels else ()))}
        values = np.hstack([stream.value, stream.side]) if stream.channels else stream.value
        channels = np.array(stream.channels)[stream.channel] if stream.channels else None
        more = {}
        if whole.has_clock:
            more["arrival_s"] = stream.arrivals
            if told:
                more["time_of_validity_s"] = whole.time[np.argsort(whole.stamps, kind="stable")]
        written.append(_table(file, stream.time, units, values, stream.faults if told else None, channels, more))
    written.append(write_whole(path / "README.md", readme(recording)))
    written.append(write_whole(path / "start.json", start_text(recording)))
    return written


def _table(
    path: Path,
    time: Array,
    units: Mapping[str, str],
    values: Array,
    faults: NDArray[np.uint32] | None = None,
    channels: NDArray[np.str_] | None = None,
    more: Mapping[str, Array] = MappingProxyType({}),
) -> Path:
    """Write the columns, of the given names and units."""
    # Degrees as NumPy has them: 180 / pi, where a division by pi / 180 may differ in the last digit.
    scale = np.array([np.degrees(1.0) if u in ("deg", "deg_s") else 1.0 / UNITS.get(u, 1.0) for u in units.values()])
    header = ["time_s", *(f"{name}_{unit}" if unit else name for name, unit in units.items())]
    columns = [time[:, None], values * scale]
    formats = ["%.17g"] * (1 + len(units))
    if faults is not None:
        header.append("faults")  # bit mask of the faults that touched the measurement
        columns.append(np.asarray(faults, dtype=np.float64)[:, None])
        formats.append("%d")
    for name, column in more.items():
        header.append(name)
        columns.append(column[:, None])
        formats.append("%.17g")
    rows = np.hstack(columns)
    if channels is not None:
        header.insert(1, "channel")
        formats.insert(1, "%s")
        rows = np.insert(rows.astype(object), 1, channels, axis=1)
    text = io.StringIO()
    np.savetxt(text, rows, fmt=formats, delimiter=",", header=",".join(header), comments="")
    return write_whole(path, text.getvalue())
