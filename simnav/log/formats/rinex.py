"""RINEX observation files, versions 3 and 4: raw observations of a receiver, a table for each satellite.

``sentence = "G05"`` names the satellite; its columns are the codes of the header, such as ``C1C`` [m], ``L1C``
[cycles], ``D1C`` [Hz] and ``S1C`` [dB-Hz]. An observation that is absent is missing. Times are UTC: those of the file
less the leap seconds of their date, unless the file is in UTC. (International GNSS Service, RINEX version 3.05,
sections 5 and 6.)
"""

from __future__ import annotations

import re
import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import TextIO

import numpy as np

from simnav.log.binary import refuse_binary
from simnav.log.files import FileSpec
from simnav.log.formats.gps_time import leap_seconds
from simnav.log.growing import GrowingTable
from simnav.log.kept import kept
from simnav.log.nmea import NmeaFile
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning
from simnav.watchers import tell

__all__ = ["read_rinex"]

_FIELD = 16
_VALUE = re.compile(r"\s*[+-]?\d{0,10}\.\d{1,3}\s*", re.ASCII)
_SATELLITE = re.compile(r"[A-Z]\d\d", re.ASCII)
_CODE = re.compile(r"[A-Z]\d[A-Z]", re.ASCII)
#: By how much GPS time is ahead of the time scales of files [s].
_GPS_AHEAD = {"BDT": 14.0, "BDS": 14.0}
_TOLD = 20_000


@register_reader("rinex", title="a RINEX observation file", sentences=True, inertial=False)
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    table = read_rinex(path).table(sentence or "", talker)
    return Rows(table, table.column("time")[1], "time")


@kept(16)
def read_rinex(path: Path) -> NmeaFile:
    """Read the observations of all satellites, by the key ``("", "G05")``.

    Raises
    ------
    LogError
        If the file is absent, is no observation file of version 3 or 4, or has no observation.
    """
    size = path.stat().st_size
    refuse_binary(path, "rinex")
    tables: dict[str, GrowingTable] = {}
    bad: list[int] = []
    with open(path, encoding="latin-1") as lines:
        codes, scale, length = _header(path, lines)
        moment, special, read = np.nan, False, 0
        for number, line in enumerate(lines, length + 1):
            read += len(line)
            if number % _TOLD == 0:
                tell(path, read, size)
            try:
                if line.startswith(">"):
                    moment, special = _epoch(line)
                    continue
                if special or not line.strip():
                    continue
                name = line[:3].replace(" ", "0")
                if not _SATELLITE.fullmatch(name) or name[0] not in codes or np.isnan(moment):
                    raise ValueError
                row = _observations(line.rstrip("\r\n"), codes[name[0]])
            except ValueError:
                bad.append(number)
                if line.startswith(">"):
                    moment = np.nan  # of the observations that follow
                continue
            tables.setdefault(name, GrowingTable()).add({"time": moment, **row}, number)
    if not tables:
        raise LogError(f"{path}: there is no observation after the header")
    if bad:
        warnings.warn(
            f"{path}: {len(bad)} lines are not understood and are left out, the first is line {bad[0]}", LogWarning, 5
        )
    found = {}
    for name, growing in sorted(tables.items()):
        table = growing.table(f"{path} ({name})")
        if scale != "UTC":
            time = table.columns["time"].astype(np.float64) + _GPS_AHEAD.get(scale, 0.0)
            table.columns["time"] = time - leap_seconds(time)
        found["", name] = table
    return NmeaFile(str(path), found, {}, tuple(name for _, name in found))


def _header(path: Path, lines: TextIO) -> tuple[dict[str, list[str]], str, int]:
    """The codes of each system, the time scale and the number of lines of the header."""
    codes: dict[str, list[str]] = {}
    scale, system, version = "GPS", "", ""
    for number, line in enumerate(lines, 1):
        label = line[60:].strip()
        if number == 1:
            version = line[:9].strip()
            if label != "RINEX VERSION / TYPE" or line[20:21] != "O":
                raise LogError(f"{path}, line 1: it is no RINEX observation file (RINEX VERSION / TYPE, O)")
            if not version.startswith(("3", "4")):
                raise LogError(f"{path}, line 1: version {version!r} of RINEX; 3 and 4 are read, convert it before")
        elif label == "SYS / # / OBS TYPES":
            system = line[:1].strip() or system
            codes.setdefault(system, []).extend(line[7:60].split())
        elif label == "TIME OF FIRST OBS":
            scale = line[48:51].strip() or ("UTC" if system == "R" and len(codes) == 1 else "GPS")
        elif label == "END OF HEADER":
            if not codes:
                raise LogError(f"{path}, line {number}: the header names no observation (SYS / # / OBS TYPES)")
            for key, names in codes.items():
                wrong = [n for n in names if not _CODE.fullmatch(n)]
                if wrong or len(set(names)) != len(names):
                    raise LogError(
                        f"{path}: the observations of system {key!r} should be different codes like C1C: "
                        f"{' '.join(wrong or names)[:100]}"
                    )
            return codes, {"GLO": "UTC"}.get(scale, scale), number
    raise LogError(f"{path}: it has no END OF HEADER")


def _epoch(line: str) -> tuple[float, bool]:
    """The time of an epoch, and whether its lines are no observations (a flag above 1)."""
    year, month, day, hour, minute = (int(line[a:b]) for a, b in ((2, 6), (7, 9), (10, 12), (13, 15), (16, 18)))
    second = line[18:29]
    flag = int(line[31:32])
    if not re.fullmatch(r"\s*\d{1,2}\.\d{1,7}\s*", second, re.ASCII):
        raise ValueError(second)
    return datetime(year, month, day, hour, minute, tzinfo=UTC).timestamp() + float(second), flag > 1


def _observations(line: str, codes: list[str]) -> dict[str, float]:
    row = {}
    for i, code in enumerate(codes):
        text = line[3 + _FIELD * i : 3 + _FIELD * i + 14]
        if not text.strip():
            row[code] = np.nan
        elif _VALUE.fullmatch(text):
            row[code] = float(text) or np.nan  # 0.000 stands for none, too
        else:
            raise ValueError(text)
    return row
