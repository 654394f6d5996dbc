"""Teledyne RDI PD0: binary ensembles of an ADCP or DVL, with bottom track.

Columns: ``range_1`` to ``range_4`` [m], ``v1`` to ``v4`` [m/s] as they stand in the file, ``heading``, ``pitch``,
``roll`` [rad], ``depth`` [m], ``speed_of_sound`` [m/s], ``temperature`` [deg C]. The velocities in the file are those
of the bottom relative to the instrument. Of ship coordinates follow ``ground_forward``, ``ground_starboard`` and
``ground_down``, of Earth coordinates ``velocity_north``, ``velocity_east`` and ``velocity_down``, which are those of
the vessel. Times are those of the clock of the instrument, as UTC. (Teledyne RD Instruments, Workhorse commands and
output data format, chapter 8.)
"""

from __future__ import annotations

import struct
import warnings
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table

_HEADER = b"\x7f\x7f"
_FIXED, _VARIABLE, _BOTTOM = 0x0000, 0x0080, 0x0600
_NONE = -32768  # of a velocity
_SHIP, _EARTH = 2, 3
_DEGREES = np.pi / 180.0


@register_reader("pd0", title="a PD0 file", inertial=False)
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """Ensembles without bottom track, or whose velocity is missing, have NaN there."""
    table = _read(path)
    return Rows(table, table.column("time")[1], "time")


@kept(16)
def _read(path: Path) -> Table:
    content = path.read_bytes()
    found: list[dict[str, float]] = []
    numbers: list[int] = []
    at = broken = count = 0
    first_broken = 0
    while (at := content.find(_HEADER, at)) >= 0:
        if at + 6 > len(content):
            break
        size = struct.unpack_from("<H", content, at + 2)[0]
        end = at + size
        if (
            size < 8
            or end + 2 > len(content)
            or sum(content[at:end]) & 0xFFFF != struct.unpack_from("<H", content, end)[0]
        ):
            first_broken = first_broken or at + 1
            broken += 1
            at += 2
            continue
        count += 1
        try:
            found.append(_ensemble(content[at:end]))
            numbers.append(count)
        except (struct.error, ValueError, IndexError):
            first_broken = first_broken or at + 1
            broken += 1
        at = end + 2
    if not found:
        raise LogError(f"{path}: there is no whole ensemble of PD0 in it (they begin with the bytes 7F 7F)")
    if broken:
        warnings.warn(
            f"{path}: {broken} ensembles of PD0 are damaged or cut off and are left out, the first is at offset "
            f"{first_broken - 1}",
            LogWarning,
            5,
        )
    names = list(dict.fromkeys(name for row in found for name in row))
    columns = {name: np.array([row.get(name, np.nan) for row in found]) for name in names}
    return Table(str(path), dict(columns), np.array(numbers, dtype=np.int64), numbered=False)


def _ensemble(data: bytes) -> dict[str, float]:
    """The values of one ensemble; struct.error or ValueError where it is not one."""
    offsets = struct.unpack_from(f"<{data[5]}H", data, 6)
    parts = {struct.unpack_from("<H", data, o)[0]: data[o:] for o in offsets}
    leader = parts.get(_VARIABLE, b"")
    year, month, day, hour, minute, second, hundredths = struct.unpack_from("<7B", leader, 4)
    moment = datetime(2000 + year if year < 80 else 1900 + year, month, day, hour, minute, second, tzinfo=UTC)
    sound, depth, heading = struct.unpack_from("<3H", leader, 14)
    pitch, roll, _, temperature = struct.unpack_from("<2hHh", leader, 20)
    row = {
        "time": moment.timestamp() + 0.01 * hundredths,
        "heading": 0.01 * heading * _DEGREES,
        "pitch": 0.01 * pitch * _DEGREES,
        "roll": 0.01 * roll * _DEGREES,
        "depth": 0.1 * depth,
        "speed_of_sound": float(sound),
        "temperature": 0.01 * temperature,
    }
    bottom = parts.get(_BOTTOM)
    if bottom is None:
        return row
    ranges, velocities = struct.unpack_from("<4H", bottom, 16), struct.unpack_from("<4h", bottom, 24)
    high = struct.unpack_from("<4B", bottom, 77) if len(bottom) >= 81 else (0, 0, 0, 0)
    for i in range(4):
        distance = 0.01 * (ranges[i] + 65536 * high[i])
        row[f"range_{i + 1}"] = distance if distance > 0.0 else np.nan
        row[f"v{i + 1}"] = np.nan if velocities[i] == _NONE else 1e-3 * velocities[i]
    frame = parts[_FIXED][25] >> 3 & 3 if _FIXED in parts and len(parts[_FIXED]) > 25 else -1
    if frame == _SHIP:
        row |= {"ground_forward": -row["v2"], "ground_starboard": -row["v1"], "ground_down": row["v3"]}
    elif frame == _EARTH:
        row |= {"velocity_north": -row["v2"], "velocity_east": -row["v1"], "velocity_down": row["v3"]}
    return row
