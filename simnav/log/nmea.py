"""NMEA 0183 logs: lines of sentences, each usually behind the UTC stamp of the logger.

Each type of sentence becomes a table with named columns in SI units and radians (`SENTENCES` lists them). The date
comes from the logger's stamp and only the time of day from the sentence, so that a receiver whose week number rolled
over (its date is 1024 weeks off) does no harm.
"""

from __future__ import annotations

import math
import os
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.log.files import FileSpec
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table, utc_seconds
from simnav.spec import closest
from simnav.types import Array

__all__ = ["SENTENCES", "NmeaFile", "read_nmea"]

_DEG = math.pi / 180.0
_KNOT = 1852.0 / 3600.0
#: The numbers of the standard. Python would also read ``inf``, ``1e9``, ``1_0`` and digits of other scripts.
_DECIMAL = re.compile(r"[+-]?(\d{1,15}(\.\d*)?|\.\d+)", re.ASCII)

Fields = list[str]
Row = dict[str, float]


#: Positions of GGA that no satellite gave: none, estimated (dead reckoning), entered by hand, of a simulator.
_NO_FIX = ("", "0", "6", "7", "8")
#: The same as a mode of RMC, GLL, VTG and THS; an empty one, or none, is of a receiver before version 2.3.
_NO_MODE = ("N", "E", "M", "S", "V")


class _InvalidError(Exception):
    """A well-formed sentence that says that it holds no measurement; its time is good."""

    def __init__(self, time_of_day: float = math.nan):
        super().__init__()
        self.time_of_day = time_of_day


def _number(text: str) -> float:
    """A field as a number, NaN where it is empty; ValueError where it is no decimal number."""
    text = text.strip()
    if not text:
        return math.nan
    if not _DECIMAL.fullmatch(text):
        raise ValueError(f"number {text!r}")
    return float(text)


def _angle(text: str, hemisphere: str, positive: str, negative: str, largest: float) -> float:
    """``ddmm.mmmm`` and the hemisphere, in radians."""
    if not text:
        return math.nan
    if hemisphere not in (positive, negative):
        raise ValueError(f"hemisphere {hemisphere!r}")
    value = _number(text)
    degrees = math.floor(value / 100.0)
    minutes = value - 100.0 * degrees
    if not 0.0 <= minutes < 60.0 or not 0.0 <= degrees + minutes / 60.0 <= largest:
        raise ValueError(f"angle {text!r}")
    angle = (degrees + minutes / 60.0) * _DEG
    return -angle if hemisphere == negative else angle


def _place(f: Fields) -> Row:
    """Latitude, its hemisphere, longitude, its hemisphere."""
    return {"latitude": _angle(f[0], f[1], "N", "S", 90.0), "longitude": _angle(f[2], f[3], "E", "W", 180.0)}


def _direction(text: str) -> float:
    """Degrees, in radians."""
    angle = _number(text)
    if abs(angle) > 360.0:
        raise ValueError(f"direction {text!r}")
    return angle * _DEG


def _mode(f: Fields, at: int) -> str:
    return f[at].strip() if len(f) > at else ""


def _time_of_day(text: str) -> float:
    text = text.strip()
    if not text:
        return math.nan
    if len(text) < 6 or not text[:6].isdecimal() or not _DECIMAL.fullmatch(text):
        raise ValueError(f"time of day {text!r}")
    hours, minutes, seconds = int(text[:2]), int(text[2:4]), float(text[4:])
    if hours > 23 or minutes > 59 or not seconds < 61.0:  # a leap second is the 60th
        raise ValueError(f"time of day {text!r}")
    return hours * 3600.0 + minutes * 60.0 + seconds


def _track(course: str, knots: str) -> Row:
    angle, speed = _direction(course), _number(knots) * _KNOT
    if speed == 0.0 and math.isnan(angle):
        angle = 0.0  # a ship at rest has no course
    return {
        "course": angle,
        "speed": speed,
        "velocity_north": speed * math.cos(angle),
        "velocity_east": speed * math.sin(angle),
    }


def _gga(f: Fields) -> Row:
    time_of_day = _time_of_day(f[0])
    if f[5] in _NO_FIX:
        raise _InvalidError(time_of_day)
    separation = _number(f[10])
    altitude = _number(f[8])
    return {
        "time_of_day": time_of_day,
        **_place(f[1:5]),
        "quality": _number(f[5]),
        "satellites": _number(f[6]),
        "hdop": _number(f[7]),
        "altitude": altitude,
        "separation": separation,
        "height": altitude + (0.0 if math.isnan(separation) else separation),
    }


def _gll(f: Fields) -> Row:
    time_of_day = _time_of_day(f[4]) if len(f) > 4 else math.nan
    if _mode(f, 5) == "V" or _mode(f, 6) in _NO_MODE:
        raise _InvalidError(time_of_day)
    return {"time_of_day": time_of_day, **_place(f[:4])}


def _rmc(f: Fields) -> Row:
    time_of_day = _time_of_day(f[0])
    if f[1] == "V" or _mode(f, 11) in _NO_MODE:
        raise _InvalidError(time_of_day)
    return {"time_of_day": time_of_day, **_place(f[2:6]), **_track(f[7], f[6])}


def _zda(f: Fields) -> Row:
    return {"time_of_day": _time_of_day(f[0])}


def _vtg(f: Fields) -> Row:
    if _mode(f, 8) in _NO_MODE:
        raise _InvalidError
    return _track(f[0], f[4])


def _hdt(f: Fields) -> Row:
    return {"heading": _direction(f[0])}


def _ths(f: Fields) -> Row:
    if _mode(f, 1) in _NO_MODE:
        raise _InvalidError
    return _hdt(f)


def _vhw(f: Fields) -> Row:
    return {"heading": _direction(f[0]), "speed": _number(f[4]) * _KNOT}


def _vbw(f: Fields) -> Row:
    """Speeds through the water and over the ground; each pair has a status, A (valid) or V."""
    water, ground = (math.nan if _mode(f, at) == "V" else _KNOT for at in (2, 5))
    return {
        "speed": _number(f[0]) * water,
        "speed_starboard": _number(f[1]) * water,
        "ground_forward": _number(f[3]) * ground,
        "ground_starboard": _number(f[4]) * ground,
    }


def _dpt(f: Fields) -> Row:
    return {"depth": _number(f[0]), "offset": _number(f[1]) if len(f) > 1 else math.nan}


def _psxn23(f: Fields) -> Row:
    return {
        "roll": _number(f[0]) * _DEG,
        "pitch": _number(f[1]) * _DEG,
        "heading": _direction(f[2]),
        "heave": _number(f[3]) if len(f) > 3 else math.nan,
    }


def _uvh(f: Fields) -> Row:
    east, north, heading = _number(f[0]) * _KNOT, _number(f[1]) * _KNOT, _direction(f[2])
    return {
        "east": east,
        "north": north,
        "heading": heading,
        "speed": north * math.cos(heading) + east * math.sin(heading),
        "speed_starboard": east * math.cos(heading) - north * math.sin(heading),
    }


#: Decoder of each sentence: its fields after the name, to named values in SI units and radians.
SENTENCES: Mapping[str, Callable[[Fields], Row]] = {
    "GGA": _gga,
    "GLL": _gll,
    "RMC": _rmc,
    "ZDA": _zda,
    "VTG": _vtg,
    "HDT": _hdt,
    "THS": _ths,
    "VHW": _vhw,
    "VBW": _vbw,
    "DPT": _dpt,
    "PSXN,23": _psxn23,
    "PUHAW,UVH": _uvh,
}


@dataclass(frozen=True, eq=False)
class NmeaFile:
    """The sentences of one file: a table for each (talker, sentence).

    Each table has the columns of its sentence, and ``logger`` and ``sentence``: UTC seconds since 1970 (or since
    midnight where the file has no stamps). ``invalid`` are the numbers of the lines of each (talker, sentence) that say
    that they are invalid.
    """

    path: str
    tables: Mapping[tuple[str, str], Table]
    invalid: Mapping[tuple[str, str], Sequence[int]]

    def table(self, sentence: str, talker: str | None = None) -> Table:
        """The table of a sentence.

        Raises
        ------
        LogError
            If the file has no such sentence, if all of them are invalid, or if several talkers say it and none was
            chosen.
        """
        found = [key for key in self.tables if key[1] == sentence and talker in (None, key[0])]
        if not found:
            have = sorted({s if t == "P" else t + s for t, s in self.tables})
            want = sentence if talker is None else talker + sentence
            lines = [n for key, lines in self.invalid.items() if key[1] == sentence and talker in (None, key[0])
                     for n in lines]  # fmt: skip
            if lines:
                raise LogError(
                    f"{self.path}: none of {len(lines)} sentences {want!r} holds a measurement: each says that it is "
                    f"invalid (quality, status or mode), the first is line {min(lines)}"
                )
            known = "" if sentence in SENTENCES else f" (sentences that are understood: {', '.join(SENTENCES)})"
            raise LogError(f"{self.path}: there is no sentence {want!r}{closest(want, have)}{known}")
        if len(found) > 1:
            talkers = ", ".join(sorted(t for t, _ in found))
            raise LogError(f"{self.path}: several talkers say {sentence!r}: {talkers}; choose one by 'talker'")
        return self.tables[found[0]]


@register_reader("nmea", title="NMEA", sentences=True, inertial=False)
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    table = read_nmea(path).table(sentence or "", talker)
    time = table.column(file.clock)[1]
    if np.isnan(time[-1]):
        raise LogError(f"{table.source}, line {table.line[-1]}: no {file.clock} time; use the other 'clock'")
    return Rows(table, time, file.clock, _without_bursts(time, np.flatnonzero(np.isfinite(time)), table))


def _without_bursts(time: Array, rows: NDArray[np.int64], table: Table) -> NDArray[np.int64]:
    """Leave out the few sentences that a logger stamped together with the one before."""
    late = np.flatnonzero(~(np.diff(time[rows]) > 0.0)) + 1
    if late.size and late.size <= 0.1 * len(rows) and np.all(np.diff(time[rows]) >= 0.0):
        first = table.line[rows[late[0]]]
        message = f"{late.size} sentences at the time of the one before are left out, the first is line {first}"
        warnings.warn(f"{table.source}: {message}", LogWarning, 2)
        return np.delete(rows, late)
    return rows


def read_nmea(path: Path) -> NmeaFile:
    """Read an NMEA log; kept for the life of the process, as long as the file does not change.

    Lines with a bad checksum and lines that cannot be understood are left out, with one `LogWarning` for each kind that
    counts them; a sentence without a checksum is accepted. A sentence that says that it is invalid (by its quality,
    status or mode) is left out without a warning, but its time counts.

    Raises
    ------
    LogError
        If the file is absent or has no sentence that is understood.
    """
    try:
        status = os.stat(path)
    except OSError:
        raise LogError(f"{path}: there is no such file") from None
    return _read_nmea(path, status.st_mtime_ns, status.st_size)


def _checksum_ok(body: str, given: str) -> bool:
    total = 0
    for c in body:
        total ^= ord(c)
    try:
        return total == int(given[:2], 16)
    except ValueError:
        return False


def _stamp(text: str) -> float:
    try:
        return utc_seconds(text)
    except ValueError:
        return math.nan


def _near(tod: float, about: float) -> float:
    """The moment with a time of day that is nearest to another moment (the day may differ by one)."""
    return about + (tod - about + 43200.0) % 86400.0 - 43200.0


@lru_cache(maxsize=64)
def _read_nmea(path: Path, _mtime: int, _size: int) -> NmeaFile:
    rows: dict[tuple[str, str], list[tuple[int, float, float, Row]]] = {}
    without: dict[tuple[str, str], list[int]] = {}
    bad_sum: list[int] = []
    bad_line: list[int] = []
    epoch = math.nan  # the last time of day that a sentence gave, as a moment
    with open(path, encoding="latin-1") as lines:
        for number, line in enumerate(lines, 1):
            at = line.find("$")
            if at < 0:
                if line.strip() and "!" not in line:  # "!" begins the sentences of AIS
                    bad_line.append(number)
                continue
            body, star, given = line[at + 1 :].strip().partition("*")
            if star and not _checksum_ok(body, given):
                bad_sum.append(number)
                continue
            name, *fields = body.split(",")
            if name.startswith("P"):
                talker, sentence = "P", name
                if fields and f"{name},{fields[0]}" in SENTENCES:
                    sentence, fields = f"{name},{fields[0]}", fields[1:]
            else:
                talker, sentence = name[:-3], name[-3:]
            decode = SENTENCES.get(sentence)
            if decode is None:
                continue
            row: Row | None = None
            try:
                row = decode(fields)
                tod = row.pop("time_of_day", math.nan)
            except _InvalidError as invalid:
                tod = invalid.time_of_day
                without.setdefault((talker, sentence), []).append(number)
            except (ValueError, IndexError):
                bad_line.append(number)
                continue
            stamp = _stamp(line[:at])
            if not math.isnan(tod):
                about = epoch if math.isnan(stamp) else stamp
                epoch = tod if math.isnan(about) else _near(tod, about)
            if row is None:
                continue
            rows.setdefault((talker, sentence), []).append((number, stamp, epoch, row))
    for bad, what in ((bad_sum, "have a bad checksum"), (bad_line, "are not understood")):
        if bad:
            warnings.warn(
                f"{path}: {len(bad)} lines {what} and are left out, the first is line {bad[0]}", LogWarning, 4
            )
    if not rows and not without:
        raise LogError(f"{path}: there is no NMEA sentence that is understood ({', '.join(SENTENCES)})")
    tables = {}
    for (talker, sentence), entries in rows.items():
        columns = {
            "logger": np.array([e[1] for e in entries]),
            "sentence": np.array([e[2] for e in entries]),
        }
        for key in entries[0][3]:
            columns[key] = np.array([e[3][key] for e in entries])
        source = f"{path} ({sentence if talker == 'P' else talker + sentence})"
        tables[talker, sentence] = Table(source, columns, np.array([e[0] for e in entries]), numbered=False)
    return NmeaFile(str(path), tables, without)
