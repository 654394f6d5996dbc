"""Files of KF-GINS: IMU increments, GNSS positions, and navigation results, as text.

IMU: time (seconds of the GPS week), angle increments ``dtheta_x`` to ``dtheta_z`` [rad], velocity increments ``dvel_x``
to ``dvel_z`` [m/s] in forward, right, down (``samples = "increments"``). GNSS: ``latitude``, ``longitude`` [deg],
``height`` [m] and their standard deviations ``sdn``, ``sde``, ``sdu`` [m]. Navigation results: GPS week, time,
``latitude``, ``longitude``, ``height``, ``vn``, ``ve``, ``vd``, ``roll``, ``pitch``, ``yaw`` [deg].
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Literal

import numpy as np

from simnav.log.binary import refuse_binary
from simnav.log.delimited import read_csv
from simnav.log.files import FileSpec
from simnav.log.formats.numbers import named_columns
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError

__all__ = ["content_of"]

_POSITION = ("latitude", "longitude", "height")
_IMU = ("time", "dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z")
_GNSS = ("time", *_POSITION, "sdn", "sde", "sdu")
_NAVIGATION = ("week", "time", *_POSITION, "vn", "ve", "vd", "roll", "pitch", "yaw")


#: So many lines at the beginning tell what is in a file.
_LOOKED_AT = 50
#: Specific force of a vessel, on the mean [m/s^2], and its angular rate at most [rad/s].
_PULL, _RATE = (8.8, 10.8), 6.0


def content_of(path: Path) -> Literal["imu", "gnss", "navigation"] | None:
    """What a text file of numbers probably holds, as KF-GINS has it; None for other files."""
    try:
        with open(path, encoding="ascii") as text:
            lines = [line.split() for line in itertools.islice(text, _LOOKED_AT) if line.strip()]
        table = np.array([[float(cell) for cell in line] for line in lines])
    except ValueError:  # no numbers, or rows of several lengths
        return None
    if len(table) < 2 or table.ndim != 2 or table.shape[1] not in (7, 11) or not np.isfinite(table).all():
        return None
    wide = table.shape[1] == 11
    spacing = np.diff(table[:, 1 if wide else 0])
    if not (spacing > 0.0).all():
        return None
    place = table[:, 2:5] if wide else table[:, 1:4]
    on_earth = bool((np.abs(place) <= (90.0, 360.0, 2e4)).all() and np.abs(place[:, :2]).max() > 1.0)
    if wide:
        sensible = (np.abs(table[:, 5:]) <= (200.0, 200.0, 200.0, 180.0, 90.0, 360.0)).all()
        weeks = (table[:, 0] == np.floor(table[:, 0])).all()
        return "navigation" if on_earth and bool(sensible and weeks) else None
    rates = table[1:, 1:] / spacing[:, None]
    pull = float(np.linalg.norm(rates[:, 3:].mean(axis=0)))
    if _PULL[0] < pull < _PULL[1] and np.abs(rates[:, :3]).max() < _RATE:
        return "imu"
    return "gnss" if on_earth and bool((table[:, 4:] > 0.0).all()) else None


@register_reader("kf_gins", title="a KF-GINS file")
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """``options.content`` is ``imu`` or ``gnss`` for files of 7 columns (default: ``imu``)."""
    refuse_binary(path, "kf_gins")
    width, content = len(read_csv(path, "#").names), str(file.options.get("content", "imu"))
    if content not in ("imu", "gnss"):
        raise LogError(f"{path}: options.content = {content!r} should be 'imu' or 'gnss'")
    if width not in (7, 11):
        raise LogError(f"{path}: {width} columns; a KF-GINS file has 7 (IMU or GNSS) or 11 (navigation results)")
    names = _NAVIGATION if width == 11 else _GNSS if content == "gnss" else _IMU
    table = named_columns(path, "kf_gins", names)
    return Rows(table, table.column("time")[1], "time")
