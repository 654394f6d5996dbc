"""Files of the EuRoC MAV data set: IMU and ground truth as CSV with times in nanoseconds.

IMU: ``wx``, ``wy``, ``wz`` [rad/s], ``ax``, ``ay``, ``az`` [m/s^2]. Ground truth: ``x``, ``y``, ``z`` [m], ``qw`` to
``qz``, ``vx``, ``vy``, ``vz`` [m/s] and, where they are there, six biases.
"""

from __future__ import annotations

from pathlib import Path

from simnav.log.binary import refuse_binary
from simnav.log.delimited import read_csv
from simnav.log.files import FileSpec
from simnav.log.formats.numbers import named_columns
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError

_IMU = ("time", "wx", "wy", "wz", "ax", "ay", "az")
_TRUTH = ("time", "x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz")
_BIASES = ("bwx", "bwy", "bwz", "bax", "bay", "baz")


@register_reader("euroc", title="a EuRoC file")
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    refuse_binary(path, "euroc")
    width = len(read_csv(path, "#").names)
    forms = {len(n): n for n in (_IMU, _TRUTH, (*_TRUTH, *_BIASES), ("time", *_TRUTH[1:8]))}
    if width not in forms:
        raise LogError(
            f"{path}: {width} columns; a EuRoC file has 7 (IMU), 8 (poses), 11 or 17 (ground truth), and the time first"
        )
    table = named_columns(path, "euroc", forms[width])
    return Rows(table, 1e-9 * table.column("time")[1], "time")
