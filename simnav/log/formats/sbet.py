"""Smoothed best estimates of trajectory (SBET) of POSPac: binary records of 17 doubles.

Columns: ``latitude``, ``longitude`` [rad], ``height`` [m], ``vx``, ``vy``, ``vz`` (wander frame) [m/s], ``roll``,
``pitch``, ``heading``, ``wander`` [rad], specific force ``fx`` to ``fz`` [m/s^2] and angular rate ``wx`` to ``wz``
[rad/s] in forward, right, down, and of the wander frame the velocities ``velocity_north`` and ``velocity_east``. Times
are seconds of the GPS week.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.formats.numbers import records
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, Table

_NAMES = (
    "time", "latitude", "longitude", "height", "vx", "vy", "vz", "roll", "pitch", "platform_heading", "wander",
    "fx", "fy", "fz", "wx", "wy", "wz",
)  # fmt: skip


@register_reader("sbet", title="an SBET file")
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    table = records(path, "sbet", _NAMES)
    columns = {n: np.asarray(c, dtype=np.float64) for n, c in table.columns.items()}
    far = np.flatnonzero((np.abs(columns["latitude"]) > 1.5708) | (np.abs(columns["longitude"]) > 6.2832))
    if far.size:
        raise LogError(
            f"{path}, record {far[0] + 1} (offset {136 * far[0]}): latitude {columns['latitude'][far[0]]:g} and "
            f"longitude {columns['longitude'][far[0]]:g} are no radians; is it an SBET file?"
        )
    wander = columns["wander"]
    s, c = np.sin(wander), np.cos(wander)
    columns["heading"] = np.mod(columns["platform_heading"] - wander, 2.0 * np.pi)
    columns["velocity_north"] = c * columns["vx"] - s * columns["vy"]
    columns["velocity_east"] = -s * columns["vx"] - c * columns["vy"]
    return Rows(Table(table.source, dict(columns), table.line), columns["time"], "time")
