"""A recording for other programs: one file (npz), or a folder of CSV files.

A folder has one file for the truth, one for the IMU, and one for each aiding instrument. Columns end in their unit;
angles are in degrees. Nothing is rounded: a file read back holds the same numbers, up to the conversion from radians.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.results.files import write_whole
from simnav.leaderboard.results.formats import writes
from simnav.types import KINDS, Array

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write_csv", "write_npz"]

_UNITS = {
    "latitude": "deg",
    "longitude": "deg",
    "heading": "deg",
    "roll": "deg",
    "pitch": "deg",
    "yaw": "deg",
    "height": "m",
    "depth": "m",
    "angular_rate": "deg_s",
    "specific_force": "m_s2",
}
_VELOCITY = "m_s"
_VELOCITIES = ["velocity_north", "velocity_east", "velocity_down"]
_STATES = ["latitude", "longitude", "height", *_VELOCITIES, "roll", "pitch", "yaw"]


@writes("recording", "npz")
def write_npz(recording: Recording, path: Path) -> list[Path]:
    """The whole recording, which `simnav.recording.Recording.load` reads."""
    path.parent.mkdir(parents=True, exist_ok=True)
    recording.save(path)
    return [path]


@writes("recording", "csv")
def write_csv(recording: Recording, path: Path) -> list[Path]:
    """A folder with ``truth.csv``, ``imu.csv`` and one ``<instrument>.csv`` each."""
    path.mkdir(parents=True, exist_ok=True)
    truth, imu = recording.data.truth, recording.data.imu
    states = np.hstack([truth.position, truth.velocity, truth.attitude])
    written = [_table(path / "truth.csv", truth.time, _STATES, states)]
    if imu is not None:
        names = [f"{q}_{axis}" for q in ("angular_rate", "specific_force") for axis in "xyz"]
        samples = np.hstack([imu.angular_rate, imu.specific_force])
        written.append(_table(path / "imu.csv", imu.time, names, samples))
    for stream in recording.data.aids.values():
        names = list(KINDS[stream.kind].values)
        written.append(_table(path / f"{stream.name}.csv", stream.time, names, stream.value, stream.faults))
    return written


def _unit(name: str) -> str:
    stem = name[:-2] if name[-2:] in ("_x", "_y", "_z") else name
    return _UNITS.get(stem, _VELOCITY)


def _table(path: Path, time: Array, names: list[str], values: Array, faults: NDArray[np.uint32] | None = None) -> Path:
    units = [_unit(n) for n in names]
    scale = np.array([np.degrees(1.0) if u.startswith("deg") else 1.0 for u in units])
    header = ["time_s", *(f"{n}_{u}" for n, u in zip(names, units, strict=True))]
    columns = [time[:, None], values * scale]
    formats = ["%.17g"] * (1 + len(names))
    if faults is not None:
        header.append("faults")  # bit mask of the faults that touched the measurement
        columns.append(np.asarray(faults, dtype=np.float64)[:, None])
        formats.append("%d")
    text = io.StringIO()
    np.savetxt(text, np.hstack(columns), fmt=formats, delimiter=",", header=",".join(header), comments="")
    return write_whole(path, text.getvalue())
