"""A recording as CSV files: one for the truth, one for the IMU, one for each aiding instrument.

Columns end in their unit; angles are in degrees. Nothing is rounded: a file read back holds the same numbers, up to
the conversion from radians.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from simnav.spec import UNITS
from simnav.types import KINDS, Array

if TYPE_CHECKING:
    from simnav.recording import Recording

__all__ = ["write"]

#: Columns of the truth and of the IMU, with their units.
_TRUTH = {
    **dict.fromkeys(("latitude", "longitude"), "deg"),
    "height": "m",
    **dict.fromkeys(("velocity_north", "velocity_east", "velocity_down"), "m_s"),
    **dict.fromkeys(("roll", "pitch", "yaw"), "deg"),
}
_IMU = {
    f"{name}_{axis}": unit for name, unit in (("angular_rate", "deg_s"), ("specific_force", "m_s2")) for axis in "xyz"
}


def write(recording: Recording, folder: Path) -> list[Path]:
    """Write the files into a folder, which is made where it is missing.

    Returns
    -------
    list of Path
        ``truth.csv``, ``imu.csv`` and one ``<instrument>.csv`` each.
    """
    folder.mkdir(parents=True, exist_ok=True)
    truth = recording.data.truth
    written = [
        _table(folder / "truth.csv", truth.time, _TRUTH, np.hstack([truth.position, truth.velocity, truth.attitude]))
    ]
    imu = recording.data.imu
    if imu is not None:
        written.append(_table(folder / "imu.csv", imu.time, _IMU, np.hstack([imu.angular_rate, imu.specific_force])))
    for stream in recording.data.aids.values():
        units = {c.name: c.unit for c in KINDS[stream.kind].components}
        written.append(_table(folder / f"{stream.name}.csv", stream.time, units, stream.value, stream.faults))
    return written


def _table(
    path: Path, time: Array, units: Mapping[str, str], values: Array, faults: NDArray[np.uint32] | None = None
) -> Path:
    """Write the columns, of the given names and units."""
    # Degrees as NumPy has them: 180 / pi, where a division by pi / 180 may differ in the last digit.
    scale = np.array([np.degrees(1.0) if u in ("deg", "deg_s") else 1.0 / UNITS[u] for u in units.values()])
    header = ["time_s", *(f"{name}_{unit}" for name, unit in units.items())]
    columns = [time[:, None], values * scale]
    formats = ["%.17g"] * (1 + len(units))
    if faults is not None:
        header.append("faults")  # bit mask of the faults that touched the measurement
        columns.append(np.asarray(faults, dtype=np.float64)[:, None])
        formats.append("%d")
    partial = path.with_name(f".{path.name}.part")
    np.savetxt(partial, np.hstack(columns), fmt=formats, delimiter=",", header=",".join(header), comments="")
    os.replace(partial, path)
    return path
