"""Trajectories in the format of the TUM RGB-D benchmark: time, position and quaternion (x, y, z, w).

Columns are ``x``, ``y``, ``z`` [m], ``qx`` to ``qw``, and of the quaternion also ``roll``, ``pitch``, ``yaw`` [rad],
where it turns forward-starboard-down axes to north-east-down. With ``options = { frame = "enu" }`` it turns
forward-left-up axes to east-north-up, as ROS has it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from simnav.geometry.rotation import dcm_from_quaternion, rpy_from_dcm
from simnav.log.files import FileSpec
from simnav.log.formats.numbers import named_columns
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, Table
from simnav.types import Array

__all__ = ["rpy_of_quaternions"]

_NAMES = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
_FLIP = np.diag([1.0, -1.0, -1.0])
_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@register_reader("tum", title="a TUM trajectory", inertial=False)
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    table = named_columns(path, "tum", _NAMES)
    quaternion = np.stack([table.columns[n] for n in ("qw", "qx", "qy", "qz")], axis=-1).astype(np.float64)
    angles = rpy_of_quaternions(quaternion, table, str(file.options.get("frame", "ned")))
    columns = {**table.columns, **{n: angles[:, i] for i, n in enumerate(("roll", "pitch", "yaw"))}}
    return Rows(Table(table.source, columns, table.line), table.column("time")[1], "time")


def rpy_of_quaternions(quaternion: Array, table: Table, frame: str) -> Array:
    """(n, 3) roll, pitch, yaw [rad] of (n, 4) quaternions, scalar first.

    Raises
    ------
    LogError
        If the frame is unknown, or a quaternion is not of length 1.
    """
    if frame not in ("ned", "enu"):
        raise LogError(f"{table.source}: options.frame = {frame!r} should be 'ned' or 'enu'")
    length = np.linalg.norm(quaternion, axis=1)
    bad = np.flatnonzero(~(np.abs(length - 1.0) < 0.1))
    if bad.size:
        raise LogError(
            f"{table.source}, line {table.line[bad[0]]}: the quaternion has the length {length[bad[0]]:.4g}, not 1; "
            "its order is x, y, z, w"
        )
    dcm = dcm_from_quaternion(quaternion / length[:, None])
    return rpy_from_dcm(_ENU @ dcm @ _FLIP if frame == "enu" else dcm)
