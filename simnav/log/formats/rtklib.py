"""Solution files of RTKLIB (``.pos``): positions with their quality and standard deviations.

Columns are ``latitude``, ``longitude`` [deg] and ``height`` [m], or ``x``, ``y``, ``z`` [m] or ``e``, ``n``, ``u`` [m],
then ``Q`` (1 fixed, 2 float, 5 single), ``ns``, three standard deviations ``sd...``, ``age`` and ``ratio``, as the
header names them (RTKLIB manual 2.4.2, appendix B.1). Times are seconds since 1970: UTC where the header says so. GPS
time is converted with the leap seconds of its date.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from simnav.log.binary import refuse_binary
from simnav.log.delimited import date_and_time
from simnav.log.files import FileSpec
from simnav.log.formats.gps_time import GPS_EPOCH, leap_seconds
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table

_NAMES = {"latitude(deg)": "latitude", "longitude(deg)": "longitude", "height(m)": "height"}
#: The mark of UTF-8 at the beginning of a file, read as Latin-1.
_MARK = b"\xef\xbb\xbf".decode("latin-1")
_RATHER = ("latitude", "longitude", "height", "Q", "ns", "sdn", "sde", "sdu", "sdne", "sdeu", "sdun", "age", "ratio")


@register_reader("rtklib", title="an RTKLIB solution", inertial=False)
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    refuse_binary(path, "rtklib")
    names: list[str] = []
    scale = "GPST"
    cells: list[list[str]] = []
    lines: list[int] = []
    with open(path, encoding="latin-1") as text:
        for number, line in enumerate(text, 1):
            line = line.removeprefix(_MARK) if number == 1 else line
            if line.startswith("%"):
                found = re.search(r"^%\s+(GPST|UTC|JST)\s+(.*)$", line.rstrip())
                if found:
                    scale, names = found[1], [_name(n) for n in found[2].split()]
                continue
            parts = line.replace(",", " ").split()
            if not parts:
                continue
            cells.append(parts)
            lines.append(number)
    other = [k for k, parts in enumerate(cells) if len(parts) != len(cells[0])]
    if other and (other[0] < len(cells) - 1 or len(cells[-1]) > len(cells[0])):
        k = other[0]
        raise LogError(f"{path}, line {lines[k]}: {len(cells[k])} cells where the first line has {len(cells[0])}")
    if other:
        warnings.warn(
            f"{path}: the last row has {len(cells[-1])} cells where the first line has {len(cells[0])}; it is "
            "incomplete, and left out",
            LogWarning,
            5,
        )
        del cells[-1], lines[-1]
    if not cells:
        raise LogError(f"{path}: there are no rows of data")
    width = len(cells[0]) - 2
    names = names or list(_RATHER[:width])
    if len(names) < 3 or len(names) != width or len(set(names)) != len(names):
        raise LogError(
            f"{path}, line {lines[0]}: {width} values after the time where the header names {len(names)} "
            f"({', '.join(names)})"
        )
    texts = {n: np.array([row[2 + i] for row in cells], dtype=object) for i, n in enumerate(names)}
    whole = Table(str(path), dict(texts), np.array(lines, dtype=np.int64))
    columns = {n: whole.column(n)[1] for n in names}
    table = Table(str(path), dict(columns), np.array(lines, dtype=np.int64))
    return Rows(table, _time(table, cells, scale), "time")


def _name(text: str) -> str:
    return _NAMES.get(text, re.sub(r"\(.*?\)$", "", text).replace("-", "_"))


def _time(table: Table, cells: list[list[str]], scale: str) -> np.ndarray:
    first, second = (np.array([row[i] for row in cells], dtype=object) for i in (0, 1))
    stamps = Table(table.source, {"date": first, "time of day": second}, table.line)
    if "/" in cells[0][0]:
        time = date_and_time(stamps, "date", "time of day")
    else:  # week and seconds of the week
        time = GPS_EPOCH + 604800.0 * stamps.column("date")[1] + stamps.column("time of day")[1]
    if scale == "JST":
        return np.asarray(time - 9.0 * 3600.0)
    return np.asarray(time if scale == "UTC" else time - leap_seconds(time))
