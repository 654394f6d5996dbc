"""u-blox UBX: navigation messages of a receiver, ``sentence = "NAV-PVT"`` and others.

``NAV-PVT``, ``NAV-HPPOSLLH``, ``NAV-VELNED``, ``NAV-ATT`` and ``NAV-RELPOSNED`` are read, in SI units and radians.
Times are UTC where a NAV-PVT has told it (the others have the time of the GPS week, from which it follows); before the
first one there is none. Sentences of NMEA or RTCM between the messages are passed over. (u-blox, Interface description
of the F9 high precision receivers.)
"""

from __future__ import annotations

import math
import struct
import warnings
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.growing import GrowingTable
from simnav.log.kept import kept
from simnav.log.nmea import NmeaFile
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning
from simnav.watchers import tell

__all__ = ["read_ubx"]

_SYNC = b"\xb5\x62"
_DEG = math.pi / 180.0
_WEEK = 604800.0
_TOLD = 10_000
#: No message is longer; a larger length is of a damaged one.
_LONGEST = 8192


def _pvt(d: bytes) -> dict[str, float]:
    tow, year, month, day, hour, minute, second, valid, _, nano = struct.unpack_from("<IH5BBIi", d)
    kind, flags, _, satellites, lon, lat, height, msl = struct.unpack_from("<4B4i", d, 20)
    h_acc, v_acc, north, east, down, speed, course, s_acc, c_acc, pdop = struct.unpack_from("<2I5i2IH", d, 40)
    if valid & 3 != 3:
        raise ValueError("no date")
    moment = datetime(year, month, day, hour, minute, min(second, 59), tzinfo=UTC).timestamp()
    fixed = {"tow": 1e-3 * tow, "time": moment + max(0, second - 59) + 1e-9 * nano, "fix": float(kind)}
    if not flags & 1 or kind not in (2, 3, 4):
        return fixed
    return fixed | {
        "carrier": float(flags >> 6), "satellites": float(satellites),
        "latitude": 1e-7 * lat * _DEG, "longitude": 1e-7 * lon * _DEG, "height": 1e-3 * height, "altitude": 1e-3 * msl,
        "sigma_horizontal": 1e-3 * h_acc, "sigma_height": 1e-3 * v_acc,
        "velocity_north": 1e-3 * north, "velocity_east": 1e-3 * east, "velocity_down": 1e-3 * down,
        "speed": 1e-3 * speed, "course": 1e-5 * course * _DEG,
        "sigma_speed": 1e-3 * s_acc, "sigma_course": 1e-5 * c_acc * _DEG, "pdop": 0.01 * pdop,
    }  # fmt: skip


def _hpposllh(d: bytes) -> dict[str, float]:
    flags = d[3]
    tow, lon, lat, height, msl = struct.unpack_from("<I4i", d, 4)
    lon_hp, lat_hp, height_hp, msl_hp = struct.unpack_from("<4b", d, 24)
    h_acc, v_acc = struct.unpack_from("<2I", d, 28)
    row = {"tow": 1e-3 * tow}
    if flags & 1:
        return row
    return row | {
        "latitude": (1e-7 * lat + 1e-9 * lat_hp) * _DEG, "longitude": (1e-7 * lon + 1e-9 * lon_hp) * _DEG,
        "height": 1e-3 * height + 1e-4 * height_hp, "altitude": 1e-3 * msl + 1e-4 * msl_hp,
        "sigma_horizontal": 1e-4 * h_acc, "sigma_height": 1e-4 * v_acc,
    }  # fmt: skip


def _velned(d: bytes) -> dict[str, float]:
    tow, north, east, down, _, ground, course, s_acc, c_acc = struct.unpack_from("<I3i2Ii2I", d)
    return {
        "tow": 1e-3 * tow, "velocity_north": 0.01 * north, "velocity_east": 0.01 * east, "velocity_down": 0.01 * down,
        "speed": 0.01 * ground, "course": 1e-5 * course * _DEG, "sigma_speed": 0.01 * s_acc,
        "sigma_course": 1e-5 * c_acc * _DEG,
    }  # fmt: skip


def _att(d: bytes) -> dict[str, float]:
    tow = struct.unpack_from("<I", d)[0]
    names = ("roll", "pitch", "heading", "sigma_roll", "sigma_pitch", "sigma_heading")
    return {"tow": 1e-3 * tow} | {
        n: 1e-5 * x * _DEG for n, x in zip(names, struct.unpack_from("<3i3I", d, 8), strict=True)
    }


def _relposned(d: bytes) -> dict[str, float]:
    """The vector between two antennas; ``heading`` is its direction, where it is valid."""
    tow, north, east, down, length, heading = struct.unpack_from("<I5i", d, 4)
    hp = struct.unpack_from("<4b", d, 32)
    acc = struct.unpack_from("<5I", d, 36)
    flags = struct.unpack_from("<I", d, 60)[0]
    row = {"tow": 1e-3 * tow, "carrier": float(flags >> 3 & 3)}
    if flags & 5 != 5:
        return row
    parts = zip(("north", "east", "down", "length"), (north, east, down, length), hp, strict=True)
    row |= {f"relative_{n}": 0.01 * x + 1e-4 * h for n, x, h in parts}
    if flags & 256:
        row |= {"heading": 1e-5 * heading * _DEG, "sigma_heading": 1e-5 * acc[4] * _DEG}
    return row


#: Class and number of each message that is read, with its name, its least length and its decoder.
_MESSAGES: Mapping[tuple[int, int], tuple[str, int, Callable[[bytes], dict[str, float]]]] = {
    (0x01, 0x07): ("NAV-PVT", 84, _pvt),
    (0x01, 0x14): ("NAV-HPPOSLLH", 36, _hpposllh),
    (0x01, 0x12): ("NAV-VELNED", 36, _velned),
    (0x01, 0x05): ("NAV-ATT", 32, _att),
    (0x01, 0x3C): ("NAV-RELPOSNED", 64, _relposned),
}


@register_reader("ubx", title="a UBX file", sentences=True, inertial=False)
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    table = read_ubx(path).table(sentence or "", talker)
    time = table.column("time")[1]
    counts = np.flatnonzero(np.isfinite(time))
    if not counts.size:
        raise LogError(f"{table.source}: no message before it tells the date (a NAV-PVT with a valid time)")
    return Rows(table, time, "time", counts)


@kept(16)
def read_ubx(path: Path) -> NmeaFile:
    """Read the messages of a file: a table for each, by the key ``("", "NAV-PVT")``. The line is the message's number.

    Raises
    ------
    LogError
        If the file is absent or has no message that is read.
    """
    content = path.read_bytes()
    tables: dict[tuple[str, str], GrowingTable] = {}
    at = count = broken = first_broken = 0
    known = math.nan  # UTC minus the time of the week
    last = math.nan
    while (at := content.find(_SYNC, at)) >= 0:
        if at + 8 > len(content):
            break
        group, number, length = struct.unpack_from("<BBH", content, at + 2)
        end = at + 6 + length
        if length > _LONGEST or end + 2 > len(content) or _checksum(content[at + 2 : end]) != content[end : end + 2]:
            broken += 1
            first_broken = first_broken or at + 1
            at += 2
            continue
        count += 1
        if count % _TOLD == 0:
            tell(path, at, len(content))
        message = _MESSAGES.get((group, number))
        data, at = content[at + 6 : end], end + 2
        if message is None or len(data) < message[1]:
            continue
        try:
            row = message[2](data)
        except ValueError:  # no date yet
            continue
        tow = row["tow"]
        if "time" in row:
            known = row["time"] - tow
        elif not math.isnan(last) and tow < last - 0.5 * _WEEK:
            known += _WEEK  # a new week
        last = tow
        row.setdefault("time", known + tow)
        table = tables.setdefault(("", message[0]), GrowingTable())
        table.add(row, count)
    if not tables:
        names = ", ".join(m[0] for m in _MESSAGES.values())
        raise LogError(f"{path}: there is no whole message of UBX that is read ({names})")
    if broken:
        warnings.warn(
            f"{path}: {broken} messages of UBX are damaged or cut off and are left out, the first is at offset "
            f"{first_broken - 1}",
            LogWarning,
            5,
        )
    named = {key: table.table(f"{path} ({key[1]})") for key, table in tables.items()}
    return NmeaFile(str(path), named, {}, tuple(m[0] for m in _MESSAGES.values()))


def _checksum(data: bytes) -> bytes:
    """The Fletcher checksum of RFC 1145, as UBX has it."""
    values = np.frombuffer(data, dtype=np.uint8).astype(np.uint64)
    first = int(values.sum()) & 255
    second = int((values * np.arange(len(values), 0, -1, dtype=np.uint64)).sum()) & 255
    return bytes((first, second))
