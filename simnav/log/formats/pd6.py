"""Teledyne RDI PD6: text ensembles of a DVL; lines begin with ``:SA``, ``:TS``, ``:BI``, ``:BS``, ``:BE``, ``:BD``.

Columns: ``heading``, ``pitch``, ``roll`` [rad], ``depth`` [m], ``temperature`` [deg C], ``salinity`` [parts per
thousand], ``speed_of_sound`` [m/s], ``ground_forward``, ``ground_starboard``, ``ground_down`` [m/s] of BS,
``velocity_north``, ``velocity_east``, ``velocity_down`` [m/s] of BE, ``x``, ``y``, ``z``, ``error`` [m/s] of BI,
``range_to_bottom`` [m] and ``since_good`` [s] of BD. A velocity whose status is not ``A`` is missing. Velocities are
those of the vessel relative to the bottom; in PD6 the vertical one is positive away from it. Times are those of the
clock of the instrument, as UTC. (Teledyne RD Instruments, Workhorse commands and output data format, output format
PD6.)
"""

from __future__ import annotations

import math
import re
import warnings
from datetime import UTC, datetime
from pathlib import Path

from simnav.log.binary import refuse_binary
from simnav.log.files import FileSpec
from simnav.log.growing import GrowingTable
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table
from simnav.watchers import tell

_DEG = math.pi / 180.0
_NUMBER = re.compile(r"[+-]?\d{1,9}(\.\d*)?", re.ASCII)
_TOLD = 10_000
#: A velocity that is none [mm/s].
_NONE = -32768.0


@register_reader("pd6", title="a PD6 file", inertial=False)
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """See the module."""
    table = _read(path)
    return Rows(table, table.column("time")[1], "time")


@kept(16)
def _read(path: Path) -> Table:
    refuse_binary(path, "pd6")
    size = path.stat().st_size
    rows, bad = GrowingTable(), list[int]()
    row: dict[str, float] = {}
    attitude: dict[str, float] = {}
    begun = read = 0
    with open(path, encoding="latin-1") as lines:
        for number, line in enumerate(lines, 1):
            read += len(line)
            if number % _TOLD == 0:
                tell(path, read, size)
            at = line.find(":")
            name, *fields = [f.strip() for f in line[at + 1 :].split(",")]
            if at < 0 or name not in ("SA", "TS", "BI", "BS", "BE", "BD"):
                continue
            try:
                found = _values(name, fields)
            except (ValueError, IndexError):
                bad.append(number)
                continue
            if name == "SA":  # stands before the time of its ensemble
                attitude = found
            elif name == "TS":
                if "time" in row:
                    rows.add(row, begun)
                row, begun, attitude = {**attitude, **found}, number, {}
            else:
                row |= found
    if "time" in row:
        rows.add(row, begun)
    if bad:
        warnings.warn(
            f"{path}: {len(bad)} lines are not understood and are left out, the first is line {bad[0]}", LogWarning, 5
        )
    if not len(rows):
        raise LogError(f"{path}: there is no ensemble of PD6 in it (its lines begin with :SA, :TS, :BI, :BS, :BE, :BD)")
    return rows.table(str(path))


def _number(text: str) -> float:
    if not _NUMBER.fullmatch(text):
        raise ValueError(text)
    return float(text)


def _values(name: str, f: list[str]) -> dict[str, float]:
    """The values of a line; ValueError or IndexError where it is none."""
    if name == "SA":
        return dict(zip(("pitch", "roll", "heading"), (_number(x) * _DEG for x in f[:3]), strict=True))
    if name == "TS":
        if not re.fullmatch(r"\d{14}", f[0], re.ASCII):
            raise ValueError(f[0])
        year, month, day, hour, minute, second, hundredths = (int(f[0][i : i + 2]) for i in range(0, 14, 2))
        moment = datetime(2000 + year, month, day, hour, minute, second, tzinfo=UTC)
        names = ("salinity", "temperature", "depth", "speed_of_sound")
        return {"time": moment.timestamp() + 0.01 * hundredths} | dict(
            zip(names, (_number(x) for x in f[1:5]), strict=True)
        )
    if name == "BD":
        return {"range_to_bottom": _number(f[3]), "since_good": _number(f[4])}
    size = 4 if name == "BI" else 3
    good = f[size] == "A"
    values = [_number(x) for x in f[:size]]
    v = [1e-3 * x if good and x > _NONE else math.nan for x in values]
    if name == "BI":
        return dict(zip(("x", "y", "z", "error"), v, strict=True))
    if name == "BS":  # transverse, longitudinal, normal
        return {"ground_forward": v[1], "ground_starboard": v[0], "ground_down": -v[2]}
    return {"velocity_north": v[1], "velocity_east": v[0], "velocity_down": -v[2]}
