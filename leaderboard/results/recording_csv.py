"""A recording as CSV files: one for the truth, one for the IMU, one for each aiding instrument.

Columns end in their unit; angles are in degrees. Nothing is rounded: a file read back holds the same numbers, up to
the conversion from radians.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simnav.types import KINDS, Array

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write"]

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


def write(recording: Recording, folder: Path) -> list[Path]:
    """Write the files into a folder, which is made where it is missing.

    Returns
    -------
    list of Path
        ``truth.csv``, ``imu.csv`` and one ``<instrument>.csv`` each.
    """
    folder.mkdir(parents=True, exist_ok=True)
    truth = recording.data.truth
    names = [
        "latitude",
        "longitude",
        "height",
        "velocity_north",
        "velocity_east",
        "velocity_down",
        "roll",
        "pitch",
        "yaw",
    ]
    written = [
        _table(folder / "truth.csv", truth.time, names, np.hstack([truth.position, truth.velocity, truth.attitude]))
    ]
    imu = recording.data.imu
    if imu is not None:
        names = [f"{q}_{axis}" for q in ("angular_rate", "specific_force") for axis in "xyz"]
        written.append(_table(folder / "imu.csv", imu.time, names, np.hstack([imu.angular_rate, imu.specific_force])))
    for stream in recording.data.aids.values():
        written.append(
            _table(
                folder / f"{stream.name}.csv", stream.time, list(KINDS[stream.kind].values), stream.value, stream.faults
            )
        )
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
    partial = path.with_name(f".{path.name}.part")
    np.savetxt(partial, np.hstack(columns), fmt=formats, delimiter=",", header=",".join(header), comments="")
    os.replace(partial, path)
    return path
