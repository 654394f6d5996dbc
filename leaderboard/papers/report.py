"""A reproduction as tables for people and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.papers.contents import contents
from simnav.leaderboard.papers.measures import measure
from simnav.leaderboard.papers.paper import Gain, Range
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.files import write_whole

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.papers.figures import Drawn
    from simnav.leaderboard.papers.reproduction import Finding, Reproduction

__all__ = [
    "Sheet",
    "Whereabouts",
    "contents_table",
    "paper_tables",
    "sheets",
    "summary",
    "whereabouts",
    "write_csv",
]

_COLUMNS = ("method", "ours by", "measure", "paper", "ours [95 %]", "runs", "verdict")
_NUMERIC = ("paper", "ours [95 %]", "runs")


def summary(found: Reproduction) -> str:
    """One line: how many rows agree."""
    words = ("agrees", "differs", "undecided", "absent", "failed", "unsuitable")
    texts = {"agrees": "agree", "differs": "differ", "absent": "not there yet"}
    counts = [f"{n} {texts.get(w, w)}" for w in words if (n := found.count(w))]
    return f"paper {found.paper.key}, {len(found.seeds)} runs a scenario: {', '.join(counts)}"


@dataclass(frozen=True)
class Column:
    """A column of a sheet; a numeric one is right-aligned."""

    title: str
    numeric: bool


@dataclass(frozen=True)
class SheetRow:
    """A row of a sheet: its cells as plain text, and the verdict of its finding."""

    cells: list[str]
    verdict: str


@dataclass(frozen=True)
class Sheet:
    """One of the paper's tables with our figures.

    Attributes
    ----------
    title, number : str
        Ours, and the paper's.
    columns : list of Column
    rows : list of SheetRow
    notes : list of str
        Why rows differ, with the letter that the rows refer to; what the marks mean.
    """

    title: str
    number: str
    columns: list[Column]
    rows: list[SheetRow]
    notes: list[str]


def sheets(found: Reproduction) -> Iterator[Sheet]:
    """One for each of the paper's tables; methods without either figure are left out.

    Why a row differs is a note below its table.
    """
    for of in found.paper.tables:
        rows = [f for f in found.findings if f.table == of.title and (f.verdict != "absent" or f.row.paper is not None)]
        whys = list(dict.fromkeys(f.why for f in rows if f.why and f.verdict != "absent"))
        several = len({f.row.scenario for f in rows}) > 1
        cells, before = [], ""
        for f in rows:
            name = _method(f)
            same = name == before
            who = ["", ""] if same else [name, _by(f)]
            texts = [*who, _title(f, several), _paper(f), _ours(f), _runs(f), _verdict(f, whys)]
            cells.append(SheetRow(texts, f.verdict))
            before = name
        notes = [f"({chr(ord('a') + i)}) {why}" for i, why in enumerate(whys)]
        if any(not isinstance(f.row, Gain) and f.row.rule == "beside" for f in rows):
            notes.insert(0, "° of other data than ours: beside it, without a verdict")
        if any(f.row.derived and f.row.paper is not None for f in rows):
            notes.insert(0, "~ follows from other figures of the paper, or from its prose")
        yield Sheet(of.title, of.number, [Column(c, c in _NUMERIC) for c in _COLUMNS], cells, notes)


def paper_tables(found: Reproduction) -> Iterator[Table]:
    """The sheets as tables for the console."""
    for sheet in sheets(found):
        strong = [i for i, r in enumerate(sheet.rows) if r.verdict == "differs"]
        dim = [i for i, r in enumerate(sheet.rows) if r.verdict in ("absent", "ours")]
        title = f"{sheet.number}: {sheet.title}" if sheet.number else sheet.title
        yield tables.table(title, _COLUMNS, [r.cells for r in sheet.rows], numeric=_NUMERIC, strong=strong, dim=dim,
                           caption="\n".join(sheet.notes) or None)  # fmt: skip


@dataclass(frozen=True)
class Whereabouts:
    """A table or figure of the paper, what it is, and where ours is, or why there is none."""

    number: str
    what: str
    where: str


def contents_table(found: Reproduction, drawn: Sequence[Drawn]) -> Table:
    """What the paper has, and where ours is, or why not."""
    rows = [[row.number, row.what, row.where] for row in whereabouts(found, drawn)]
    dim = [i for i, item in enumerate(contents(found.paper)) if not item.shown]
    return tables.table("What the paper has, and where ours is", ["paper", "what", "ours, or why not"], rows, dim=dim)


def whereabouts(found: Reproduction, drawn: Sequence[Drawn]) -> list[Whereabouts]:
    """All that the paper has, in its order."""
    missing = {f"{d.figure.name}.png": d.missing for d in drawn if d.path is None}
    rows = []
    for item in contents(found.paper):
        places = []
        for place in item.shown:
            why = f" (not there yet: {', '.join(missing[place])})" if missing.get(place) else ""
            places.append(f"{place}{why}")
        rows.append(Whereabouts(item.number, item.what, "; ".join(places) or f"not shown: {item.why}"))
    return rows


def _method(f: Finding) -> str:
    return f"{f.row.method} against {f.row.than}" if isinstance(f.row, Gain) else f.row.method


def _by(f: Finding) -> str:
    return " / ".join(f.estimators)


def _title(f: Finding, with_scenario: bool) -> str:
    m = measure(f.row.score)
    text = f"{m.title}, better by" if isinstance(f.row, Gain) else f"{m.title} [{m.unit}]"
    return f"{text} ({f.row.scenario})" if with_scenario else text


def _paper(f: Finding) -> str:
    if f.row.paper is None:
        return tables.MISSING
    mark = "~ " if f.row.derived else ""
    if isinstance(f.row, Gain):
        return mark + tables.percent(f.row.paper)
    sign = {"at-most": "≤ ", "at-least": "≥ ", "equal": "", "beside": "° "}[f.row.rule]
    return mark + sign + _figure(f.row.paper)


def _figure(value: Range) -> str:
    return " to ".join(map(tables.number, value)) if isinstance(value, tuple) else tables.number(value)


def _ours(f: Finding) -> str:
    if f.ours is None:
        return tables.MISSING
    if not isinstance(f.row, Gain):
        return tables.interval(f.ours.value, f.ours.low, f.ours.high)
    if f.ours.value > 2.0:  # no gain of a few per cent any more
        return f"worse by a factor of {tables.interval(f.ours.value, f.ours.low, f.ours.high)}"
    # Rounded here, and added to zero, so that there is no -0.0.
    value, low, high = (round(1.0 - x, 3) + 0.0 for x in (f.ours.value, f.ours.high, f.ours.low))
    if low != low or high != high:
        return tables.percent(value)
    return f"{tables.percent(value)} [{100.0 * low:.1f}, {100.0 * high:.1f}]"


def _runs(f: Finding) -> str:
    if f.ours is None:
        return tables.MISSING
    return f"{f.ours.runs}, {f.failed} failed" if f.failed else str(f.ours.runs)


def _verdict(f: Finding, whys: list[str]) -> str:
    if f.verdict == "absent":
        return f.why
    word = "" if f.verdict == "ours" else f.verdict
    return f"{word} ({chr(ord('a') + whys.index(f.why))})" if f.why else word


def write_csv(found: Reproduction, path: Path) -> Path:
    """All rows, one a line; written at once or not at all."""
    rows = found.to_dict()["rows"]
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        flat = {k: v if v == v else None for k, v in row.items()}
        flat["estimators"] = " / ".join(row["estimators"])
        if isinstance(row["paper"], list):
            flat["paper"] = " to ".join(map(str, row["paper"]))
        writer.writerow(flat)
    return write_whole(path, text.getvalue())
