"""NMEA 2000 as the text of canboat: one message a line, its content as hexadecimal bytes.

A line is ``2014-08-15T19:00:00.042Z,2,127250,160,255,8,00,4e,01,...``: stamp, priority, PGN, source, destination,
number of bytes, bytes (canboat, "analyzer" formats PLAIN and FAST). Messages of more than eight bytes are on one line,
or in frames that are put together. ``sentence`` of a channel is the PGN and ``talker`` the source. Values are in SI
units and radians; ``clock = "sentence"`` takes the time of the satellite receiver (129029, 126992, 129033).
Fields and resolutions are those of the PGN definitions of canboat (https://canboat.github.io/canboat/canboat.html).
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from simnav.log.binary import refuse_binary
from simnav.log.files import FileSpec
from simnav.log.growing import GrowingTable
from simnav.log.kept import kept
from simnav.log.nmea import NmeaFile, take_variation
from simnav.log.nmea_sentences import Row
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, utc_seconds
from simnav.watchers import tell

__all__ = ["PGNS", "read_n2k"]

_DEG = math.pi / 180.0
_LINE = re.compile(r"^\s*\d{4}-\d\d-\d\d[T-]\d\d:\d\d:\d\d", re.ASCII)
_TOLD = 10_000
#: Frames of a message that never becomes whole are forgotten when so many are open.
_OPEN = 200


def _number(data: bytes, at: int, size: int, signed: bool, scale: float) -> float:
    """A number, little-endian; NaN for the two highest values (not available, error) or where the message is short."""
    if at + size > len(data):
        return math.nan
    raw = int.from_bytes(data[at : at + size], "little", signed=signed)
    highest = (1 << 8 * size - signed) - 1
    return math.nan if raw >= highest - 1 else raw * scale


def _u(data: bytes, at: int, size: int, scale: float = 1.0) -> float:
    return _number(data, at, size, False, scale)


def _i(data: bytes, at: int, size: int, scale: float = 1.0) -> float:
    return _number(data, at, size, True, scale)


def _heading(d: bytes) -> Row:
    heading, deviation, variation = _u(d, 1, 2, 1e-4), _i(d, 3, 2, 1e-4), _i(d, 5, 2, 1e-4)
    if d[7] & 3 == 0:
        return {"heading": heading}
    magnetic = heading + (0.0 if math.isnan(deviation) else deviation)
    return {"heading_magnetic": magnetic, "variation": variation, "heading": math.nan}


def _course(d: bytes) -> Row:
    course, speed = _u(d, 2, 2, 1e-4), _u(d, 4, 2, 0.01)
    row: Row = {"course": course, "speed": speed}
    if d[1] & 3 == 0:  # true, not magnetic
        row |= {"velocity_north": speed * math.cos(course), "velocity_east": speed * math.sin(course)}
    return row


def _position(d: bytes) -> Row:
    quality = d[31] >> 4 & 15
    if quality == 0:
        return {"moment": _moment(d, 1)}
    altitude = _i(d, 23, 8, 1e-6)
    return {
        "moment": _moment(d, 1),
        "latitude": _i(d, 7, 8, 1e-16) * _DEG, "longitude": _i(d, 15, 8, 1e-16) * _DEG,
        "height": altitude, "quality": float(quality), "satellites": _u(d, 33, 1),
        "hdop": _i(d, 34, 2, 0.01), "pdop": _i(d, 36, 2, 0.01), "separation": _i(d, 38, 4, 0.01),
    }  # fmt: skip


def _moment(d: bytes, at: int) -> float:
    """Seconds since 1970 of a day and a time of day."""
    return 86400.0 * _u(d, at, 2) + _u(d, at + 2, 4, 1e-4)


#: Decoder of each message. ``moment`` is the time inside it; the others are columns.
PGNS: Mapping[str, Callable[[bytes], Row]] = {
    "126992": lambda d: {"moment": _moment(d, 2)},
    "127250": _heading,
    "127251": lambda d: {"rate_of_turn": _i(d, 1, 4, 3.125e-8)},
    "127252": lambda d: {"heave": _i(d, 1, 2, 0.01)},
    "127257": lambda d: {"yaw": _i(d, 1, 2, 1e-4), "pitch": _i(d, 3, 2, 1e-4), "roll": _i(d, 5, 2, 1e-4)},
    "127258": lambda d: {"variation": _i(d, 4, 2, 1e-4)},
    "128259": lambda d: {"speed": _u(d, 1, 2, 0.01), "speed_over_ground": _u(d, 3, 2, 0.01)},
    "128267": lambda d: {"depth": _u(d, 1, 4, 0.01), "offset": _i(d, 5, 2, 0.001)},
    "129025": lambda d: {"latitude": _i(d, 0, 4, 1e-7) * _DEG, "longitude": _i(d, 4, 4, 1e-7) * _DEG},
    "129026": _course,
    "129029": _position,
    "129033": lambda d: {"moment": _moment(d, 0)},
}
#: Bytes of the shortest whole message of those with more than eight.
_LONG = {"129029": 43}


@register_reader("n2k", title="NMEA 2000", sentences=True, inertial=False)
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    table = read_n2k(path).table(sentence or "", talker)
    time = table.column(file.clock)[1]
    counts = np.flatnonzero(np.isfinite(time))
    if not counts.size:
        raise LogError(f"{table.source}: no message gives a {file.clock} time; use the other 'clock'")
    return Rows(table, time, file.clock, counts)


@kept(64)
def read_n2k(path: Path) -> NmeaFile:
    """Read a log of NMEA 2000 messages: a table for each (source, PGN).

    Raises
    ------
    LogError
        If the file is absent or has no message that is understood.
    """
    size = path.stat().st_size
    refuse_binary(path, "n2k")
    tables: dict[tuple[str, str], GrowingTable] = {}
    open_messages: dict[tuple[str, str, int], tuple[int, bytearray]] = {}
    bad: list[int] = []
    variation = since = offset = math.nan
    read = 0
    with open(path, encoding="latin-1") as lines:
        for number, line in enumerate(lines, 1):
            read += len(line)
            if number % _TOLD == 0:
                tell(path, read, size)
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            try:
                if not _LINE.match(line):
                    raise ValueError
                stamp, _, pgn, source, _, length, *content = line.strip().split(",")
                decode = PGNS.get(pgn)
                if decode is None:
                    continue
                source = str(int(source))
                data = bytes(int(x, 16) for x in content)
                if len(data) != int(length):
                    raise ValueError
                stamped = _stamp(stamp)
                if pgn in _LONG and len(data) <= 8:
                    whole = _assembled(open_messages, (source, pgn), data)
                    if whole is None:
                        continue
                    data = whole
                if len(data) < _LONG.get(pgn, 8):
                    raise ValueError
                row = decode(data)
            except (ValueError, IndexError):
                bad.append(number)
                continue
            moment = row.pop("moment", math.nan)
            if isinstance(moment, float) and math.isfinite(moment):
                since, offset = stamped, moment - stamped
            if not row:
                continue
            if pgn != "127258":
                variation = take_variation(row, variation)
            elif isinstance(own := row["variation"], float) and not math.isnan(own):
                variation = own
            # A message without a time has that of the last one that has one, and what has passed since.
            told = stamped + offset if since <= stamped else math.nan
            table = tables.get((source, pgn))
            if table is None:
                table = tables[source, pgn] = GrowingTable()
            table.add({"logger": stamped, "sentence": told, **row}, number)
    if bad:
        warnings.warn(
            f"{path}: {len(bad)} lines are not understood and are left out, the first is line {bad[0]}", LogWarning, 5
        )
    if not tables:
        raise LogError(f"{path}: there is no message of NMEA 2000 that is understood (PGN {', '.join(PGNS)})")
    named = {(source, pgn): table.table(f"{path} (PGN {pgn} of {source})") for (source, pgn), table in tables.items()}
    return NmeaFile(str(path), named, {}, tuple(PGNS))


def _stamp(text: str) -> float:
    """Seconds since 1970; canboat also wrote a dash between date and time of day."""
    return utc_seconds(text[:10] + "T" + text[11:])


def _assembled(
    messages: dict[tuple[str, str, int], tuple[int, bytearray]], key: tuple[str, str], frame: bytes
) -> bytes | None:
    """The message that this frame completes, or None.

    The first byte of a frame is a counter of the message (three bits) and of the frame; the second byte of frame 0 is
    the number of bytes.
    """
    number, index = frame[0] >> 5, frame[0] & 31
    if index == 0:
        if len(messages) > _OPEN:
            messages.clear()
        messages[(*key, number)] = frame[1], bytearray(frame[2:])
    elif (*key, number) in messages:
        wanted, data = messages[(*key, number)]
        if len(data) != 6 + 7 * (index - 1):  # a frame is missing
            del messages[(*key, number)]
            return None
        data += frame[1:]
    else:
        return None
    wanted, data = messages[(*key, number)]
    if len(data) < wanted:
        return None
    del messages[(*key, number)]
    return bytes(data[:wanted])
