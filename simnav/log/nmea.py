"""NMEA 0183 logs: lines of sentences, each usually behind the UTC stamp of the logger.

Each type of sentence becomes a table with named columns in SI units and radians (`SENTENCES` lists them). A magnetic
heading becomes a true one by the variation of its sentence, or of the last RMC or HDG before it. The date
comes from the logger's stamp and only the time of day from the sentence, so that a receiver whose week number rolled
over (its date is 1024 weeks off) does no harm.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simnav.log.binary import refuse_binary
from simnav.log.files import FileSpec
from simnav.log.growing import GrowingTable
from simnav.log.kept import kept
from simnav.log.nmea_sentences import SENTENCES, InvalidError, Row
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table, utc_seconds
from simnav.spec import closest
from simnav.watchers import tell

__all__ = ["SENTENCES", "NmeaFile", "read_nmea", "take_variation"]

#: After so many lines it is told how far the file has been read.
_TOLD = 10_000


@dataclass(frozen=True, eq=False)
class NmeaFile:
    """The sentences of one file: a table for each (talker, sentence).

    Each table has the columns of its sentence, and ``logger`` and ``sentence``: UTC seconds since 1970 (or since
    midnight where the file has no stamps). ``invalid`` are the numbers of the lines of each (talker, sentence) that say
    that they are invalid, and ``known`` the sentences that its reader understands.
    """

    path: str
    tables: Mapping[tuple[str, str], Table]
    invalid: Mapping[tuple[str, str], Sequence[int]]
    known: Sequence[str] = tuple(SENTENCES)

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
            known = "" if sentence in self.known else f" (sentences that are understood: {', '.join(self.known)})"
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
    return Rows(table, time, file.clock, np.flatnonzero(np.isfinite(time)))


def _checksum_ok(body: str, checksum: str) -> bool:
    total = 0
    for c in body:
        total ^= ord(c)
    try:
        return total == int(checksum[:2], 16)
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


def _in_circle(heading: float) -> float:
    """A heading that the variation has taken out of the circle, inside it [rad]."""
    return heading - math.copysign(2.0 * math.pi, heading) if abs(heading) > 2.0 * math.pi else heading


def take_variation(row: Row, last: float) -> float:
    """Complete a magnetic heading by the variation, in place; return the last known variation."""
    own = row.get("variation")
    if isinstance(own, float) and not math.isnan(own):
        last = own
    magnetic = row.get("heading_magnetic")
    if isinstance(magnetic, float):
        row["variation"] = last
        row["heading_magnetic"] = magnetic = _in_circle(magnetic)  # with the deviation of its compass
        true = row.get("heading", math.nan)
        row["heading"] = _in_circle(magnetic + last) if isinstance(true, float) and math.isnan(true) else true
    return last


@kept(64)
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
    size = path.stat().st_size
    refuse_binary(path, "nmea")
    rows: dict[tuple[str, str], GrowingTable] = {}
    without: dict[tuple[str, str], list[int]] = {}
    bad_sum: list[int] = []
    bad_line: list[int] = []
    variation = math.nan  # the last that a sentence gave
    epoch = math.nan  # the last time of day that a sentence gave, as a moment
    read = 0
    with open(path, encoding="latin-1") as lines:
        for number, line in enumerate(lines, 1):
            read += len(line)
            if number % _TOLD == 0:
                tell(path, read, size)
            at = line.find("$")
            if at < 0:
                if line.strip() and "!" not in line:  # "!" begins the sentences of AIS
                    bad_line.append(number)
                continue
            body, star, given = line[at + 1 :].strip().partition("*")
            if star and given.strip() and not _checksum_ok(body, given):
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
                tod = float(row.pop("time_of_day", math.nan))
            except InvalidError as invalid:
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
            variation = take_variation(row, variation)
            table = rows.get((talker, sentence))
            if table is None:
                table = rows[talker, sentence] = GrowingTable()
            table.add({"logger": stamp, "sentence": epoch, **row}, number)
    for bad, what in ((bad_sum, "have a bad checksum"), (bad_line, "are not understood")):
        if bad:
            warnings.warn(
                f"{path}: {len(bad)} lines {what} and are left out, the first is line {bad[0]}", LogWarning, 5
            )
    if not rows and not without:
        raise LogError(f"{path}: there is no NMEA sentence that is understood ({', '.join(SENTENCES)})")
    tables = {
        (talker, sentence): table.table(f"{path} ({sentence if talker == 'P' else talker + sentence})")
        for (talker, sentence), table in rows.items()
    }
    return NmeaFile(str(path), tables, without)
