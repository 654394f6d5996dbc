"""Reading of RINEX navigation files: broadcast ephemerides of GPS, Galileo and BeiDou.

Versions 2 (GPS), 3 and 4 are read, also compressed with gzip. Of Galileo the I/NAV messages are taken, of GPS the
legacy (LNAV) ones, of BeiDou D1 and D2. Records of other systems and messages are passed over.

Source: *RINEX, The Receiver Independent Exchange Format*, IGS/RTCM, versions 2.11 (2007), 3.05 (2020) and 4.00 (2021).
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from datetime import datetime
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from simnav.compiled import Array
from simnav.satellites.ephemeris import Ephemerides, is_geostationary
from simnav.satellites.orbit import ELEMENTS
from simnav.satellites.time_scales import BEIDOU_BEHIND_GPS, SECONDS_OF_WEEK, GpsTime, gps_time
from simnav.spec import SpecError

__all__ = ["NavigationFileError", "read_navigation"]

#: Gravitational constant [m^3/s^2] and rotation of the Earth [rad/s] of each system, from its interface document.
_CONSTANTS = {
    "G": (3.986005e14, 7.2921151467e-5), "E": (3.986004418e14, 7.2921151467e-5), "C": (3.986004418e14, 7.292115e-5),
}  # fmt: skip
_MESSAGES = {"G": ("LNAV",), "E": ("INAV",), "C": ("D1", "D2")}
#: Place of each element in a message: three numbers of the clock, then four in each of seven lines.
_PLACES = {
    "a0": 0, "a1": 1, "a2": 2, "crs": 4, "motion": 5, "anomaly0": 6, "cuc": 7, "eccentricity": 8, "cus": 9,
    "root_a": 10, "toe_of_week": 11, "cic": 12, "node0": 13, "cis": 14, "i0": 15, "crc": 16, "perigee": 17,
    "node_rate": 18, "i_rate": 19,
}  # fmt: skip
_ISSUE, _SOURCES, _HEALTH, _GROUP_DELAY = 3, 20, 24, 25
_LINES, _WIDTH = 8, 19
#: Limits of elements: no satellite of these systems is outside them, and none of them breaks the computation.
_LIMITS = {
    "a0": (-1.0, 1.0), "a1": (-1e-6, 1e-6), "a2": (-1e-9, 1e-9), "root_a": (4000.0, 7000.0), "eccentricity": (0.0, 0.5),
    "toe_of_week": (0.0, SECONDS_OF_WEEK), "motion": (-1e-6, 1e-6), "node_rate": (-1e-5, 1e-5), "i_rate": (-1e-5, 1e-5),
    "crs": (-1e5, 1e5), "crc": (-1e5, 1e5), "cuc": (-0.1, 0.1), "cus": (-0.1, 0.1), "cic": (-0.1, 0.1),
    "cis": (-0.1, 0.1), "anomaly0": (-7.0, 7.0), "node0": (-7.0, 7.0), "perigee": (-7.0, 7.0), "i0": (-4.0, 4.0),
}  # fmt: skip
#: The reference times of orbit and clock are never this far apart [s].
_APART = 86400.0
#: Size of a file, decompressed: a day of all satellites of the world has 15 MiB.
_MOST_BYTES = 200 * 2**20
#: Bits of a Galileo message's sources: I/NAV of E1 and E5b.
_INAV = 0b101


class NavigationFileError(SpecError):
    """A RINEX navigation file that cannot be read: one sentence with the file and the line."""


class _Message(NamedTuple):
    satellite: str
    numbers: list[float]
    week: int
    group_delay: float
    issue: int
    healthy: bool


class _Line(NamedTuple):
    """A line of a file."""

    path: Path
    number: int
    text: str

    def wrong(self, what: str) -> NavigationFileError:
        return NavigationFileError(f"{self.path.name}, line {self.number}: {what}")

    def value(self, begin: int, width: int, name: str) -> float | None:
        """The number in a column; None if it is blank."""
        text = self.text[begin : begin + width].strip()
        if not text:
            return None
        try:
            value = float(text.replace("D", "E").replace("d", "e"))
        except ValueError:
            value = float("nan")
        if not isfinite(value) or "_" in text:
            raise self.wrong(f"{name} = {text!r} should be a number")
        return value


def read_navigation(path: str | Path) -> Ephemerides:
    """Read a RINEX navigation file.

    Parameters
    ----------
    path : str or Path
        The file; ``~`` is the home directory, and a name that ends in ``.gz`` is decompressed.

    Raises
    ------
    NavigationFileError
        If it is not a navigation file, has no ephemeris, or one that is incomplete or impossible.
    """
    path = Path(path).expanduser()
    lines = _lines(path)
    version, alpha, beta = _header(path, lines)
    messages: list[_Message] = []
    for record in _records(lines, version):
        head = record[0]
        if head.text.startswith(">"):
            words = head.text[1:].split()
            if words[:1] == ["ION"] and len(words) > 2 and words[1][0] == "G" and words[2] == "LNAV" and alpha is None:
                alpha, beta = _ionosphere(record)
            if words[:1] != ["EPH"] or len(words) < 3 or words[2] not in _MESSAGES.get(words[1][0], ()):
                continue
            record = record[1:]
            if not record:
                raise head.wrong(f"the ephemeris of {words[1]} should follow in {_LINES} lines, but there is none")
        message = _message(record, version)
        if message is not None:
            messages.append(message)
    if not messages:
        raise NavigationFileError(f"{path.name}: there is no ephemeris of GPS, Galileo or BeiDou in it")
    return _table(messages, None if alpha is None or beta is None else np.array([*alpha, *beta]), path.name)


def _lines(path: Path) -> list[_Line]:
    try:
        if path.exists() and not path.is_file():
            raise NavigationFileError(f"{path}: the navigation file cannot be read: it is no regular file")
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except (OSError, EOFError, zlib.error, ValueError) as error:
        if isinstance(error, NavigationFileError):
            raise
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise NavigationFileError(f"{path}: the navigation file cannot be read: {reason}") from None
    if len(content) > _MOST_BYTES:
        raise NavigationFileError(f"{path}: the navigation file has more than {_MOST_BYTES // 2**20} MiB")
    return [_Line(path, k, text.rstrip("\r")) for k, text in enumerate(content.decode("latin-1").split("\n"), 1)]


def _header(path: Path, lines: list[_Line]) -> tuple[int, list[float] | None, list[float] | None]:
    """Major version, and the coefficients of the ionosphere of GPS; the header is taken from ``lines``."""
    first = lines[0]
    if first.text[60:80].strip() != "RINEX VERSION / TYPE":
        raise first.wrong("a RINEX file begins with a line 'RINEX VERSION / TYPE'")
    version = int(first.value(0, 9, "the version") or 0.0)
    if version not in (2, 3, 4):
        raise first.wrong(f"version {first.text[:9].strip()!r} should be 2, 3 or 4")
    if first.text[20:21] != "N":
        raise first.wrong(
            f"the type {first.text[20:40].strip()!r} should begin with N, for navigation data; it is another RINEX file"
        )
    coefficients: dict[str, list[float]] = {}
    for k, line in enumerate(lines):
        label = line.text[60:].strip()
        name = {"ION ALPHA": "GPSA", "ION BETA": "GPSB"}.get(
            label, line.text[:4] if label == "IONOSPHERIC CORR" else ""
        )
        if name in ("GPSA", "GPSB"):
            begin = 5 if label == "IONOSPHERIC CORR" else 2
            coefficients[name] = [line.value(begin + 12 * c, 12, f"a coefficient of {name}") or 0.0 for c in range(4)]
        if label == "END OF HEADER":
            del lines[: k + 1]
            return version, coefficients.get("GPSA"), coefficients.get("GPSB")
    raise NavigationFileError(f"{path.name}: the header should end with a line 'END OF HEADER', which is missing")


def _records(lines: list[_Line], version: int) -> Iterator[list[_Line]]:
    """The records: a line that begins at the margin, and the indented ones that follow."""
    record: list[_Line] = []
    for line in lines:
        if not line.text.strip():
            continue
        # In version 2 a record begins with the number of the satellite in two columns, the first of which may be blank.
        begins = line.text[:2].strip() != "" if version == 2 else line.text[0] != " "
        if version == 4 and record and record[0].text.startswith(">") and not line.text.startswith(">"):
            begins = False
        if begins and record:
            yield record
            record = []
        if not begins and not record:
            raise line.wrong("a record should begin here, with the name of a satellite")
        record.append(line)
    if record:
        yield record


def _ionosphere(record: list[_Line]) -> tuple[list[float], list[float]]:
    """Coefficients of GPS in a record of version 4: three, four and one numbers in three lines, after the epoch."""
    if len(record) < 4:
        raise record[0].wrong(f"the coefficients of the ionosphere should follow in 3 lines, not in {len(record) - 1}")
    places = [(1, 23), (1, 42), (1, 61), (2, 4), (2, 23), (2, 42), (2, 61), (3, 4)]
    values = [record[k].value(at, _WIDTH, "a coefficient of the ionosphere") or 0.0 for k, at in places]
    return values[:4], values[4:]


def _message(record: list[_Line], version: int) -> _Message | None:
    """The message of a record; None if it is one of another system or kind."""
    head = record[0]
    name = f"G{head.text[:2].strip():0>2}" if version == 2 else head.text[:3].replace(" ", "0")
    system = name[:1]
    if not (name[1:].isascii() and name[1:].isdigit() and len(name) == 3 and system.isalpha()):
        raise head.wrong(f"{head.text[:4].strip()!r} should be a satellite, like 'G05'")
    if system not in _CONSTANTS:
        return None
    if len(record) != _LINES:
        raise head.wrong(f"the ephemeris of {name} has {len(record)} lines; it should have {_LINES}")
    indent = 3 if version == 2 else 4
    begin = indent + _WIDTH
    values = [head.value(begin + _WIDTH * k, _WIDTH, f"number {k + 1} of the clock of {name}") for k in range(3)]
    where = [head] * 3
    for row, line in enumerate(record[1:], 1):
        for k in range(4):
            values.append(line.value(indent + _WIDTH * k, _WIDTH, f"number {k + 1} of line {row + 1} of {name}"))
            where.append(line)
    if system == "E" and values[_SOURCES] is not None and not int(values[_SOURCES] or 0.0) & _INAV:
        return None
    elements: dict[str, float] = {}
    for element, at in _PLACES.items():
        value, (low, high) = values[at], _LIMITS[element]
        if value is None:
            raise where[at].wrong(f"the ephemeris of {name} lacks its {element}")
        if not low <= value <= high:
            raise where[at].wrong(f"the {element} of {name}, {value:g}, should be between {low:g} and {high:g}")
        elements[element] = value
    if values[_HEALTH] is None:
        raise where[_HEALTH].wrong(f"the ephemeris of {name} lacks its health")
    clock = _epoch(head, name, version)
    behind = BEIDOU_BEHIND_GPS if system == "C" else 0.0
    # The week of the message is that of the clock's reference time, or a neighbour: RINEX files differ in its count.
    turns = round((clock.seconds - elements["toe_of_week"]) / SECONDS_OF_WEEK)
    toe = elements["toe_of_week"] + SECONDS_OF_WEEK * turns
    if abs(toe - clock.seconds) > _APART:
        raise where[_PLACES["toe_of_week"]].wrong(
            f"the reference times of orbit and clock of {name} are {abs(toe - clock.seconds):g} s apart; they should "
            f"be at most {_APART:g}"
        )
    mu, rate = _CONSTANTS[system]
    elements |= {
        "toe": toe + behind, "toc": clock.seconds + behind, "mu": mu, "earth_rate": rate,
        "geostationary": float(is_geostationary(name)),
    }  # fmt: skip
    numbers = [elements[element] for element in ELEMENTS]
    issue, delay = values[_ISSUE] or 0.0, values[_GROUP_DELAY] or 0.0
    if not abs(issue) < 1e6 or not abs(delay) < 1e-6:
        raise where[_GROUP_DELAY].wrong(f"the issue {issue:g} or the group delay {delay:g} s of {name} is impossible")
    return _Message(name, numbers, clock.week, delay, int(issue), values[_HEALTH] == 0.0)


def _epoch(head: _Line, name: str, version: int) -> GpsTime:
    """Reference time of the clock, in the time of the satellite's system."""
    text = head.text[2:22] if version == 2 else head.text[4:23]
    try:
        year, *rest = text.split()
        month, day, hour, minute = (int(word) for word in rest[:4])
        second = float(rest[4])
        full = int(year) + (1900 if int(year) >= 80 else 2000) if version == 2 else int(year)
        whole = int(second)
        return gps_time(datetime(full, month, day, hour, minute, whole, round((second - whole) * 1e6)))
    except (ValueError, IndexError, OverflowError):
        wanted = "yy mm dd hh mm ss.s" if version == 2 else "yyyy mm dd hh mm ss"
        raise head.wrong(f"the epoch of {name}, {text.strip()!r}, should be a time from 1980 on: {wanted}") from None


def _table(messages: list[_Message], klobuchar: Array | None, source: str) -> Ephemerides:
    """The messages as one table, each of them once, with times since the beginning of one week."""
    week = messages[0].week
    once: dict[tuple[str, float], _Message] = {}
    for message in messages:
        shift = (message.week - week) * SECONDS_OF_WEEK
        message.numbers[0] += shift
        message.numbers[1] += shift
        once.setdefault((message.satellite, message.numbers[0]), message)
    kept = list(once.values())
    return Ephemerides(
        tuple(m.satellite for m in kept),
        np.array([m.numbers for m in kept]),
        week,
        np.array([m.group_delay for m in kept]),
        np.array([m.issue for m in kept], dtype=np.int64),
        np.array([m.healthy for m in kept]),
        klobuchar,
        source,
    )
