"""Files of KF-GINS: IMU increments, GNSS positions, and navigation results, as text.

IMU: time (seconds of the GPS week), angle increments ``dtheta_x`` to ``dtheta_z`` [rad], velocity increments ``dvel_x``
to ``dvel_z`` [m/s] in forward, right, down (``samples = "increments"``). GNSS: ``latitude``, ``longitude`` [deg],
``height`` [m] and their standard deviations ``sdn``, ``sde``, ``sdu`` [m]. Navigation results: GPS week, time,
``latitude``, ``longitude``, ``height``, ``vn``, ``ve``, ``vd``, ``roll``, ``pitch``, ``yaw`` [deg].
"""

from __future__ import annotations

from pathlib import Path

from simnav.log.binary import refuse_binary
from simnav.log.delimited import read_csv
from simnav.log.files import FileSpec
from simnav.log.formats.numbers import named_columns
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError

_POSITION = ("latitude", "longitude", "height")
_IMU = ("time", "dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z")
_GNSS = ("time", *_POSITION, "sdn", "sde", "sdu")
_NAVIGATION = ("week", "time", *_POSITION, "vn", "ve", "vd", "roll", "pitch", "yaw")


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
