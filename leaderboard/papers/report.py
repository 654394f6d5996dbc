"""A repeated comparison as tables and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.files import write_whole

from .comparison import as_gain
from .contents import contents
from .measures import measure
from .paper import KINDS_OF_ROWS, Gain, Paper, Range

if TYPE_CHECKING:
    from rich.table import Table

    from .figures import Drawn
    from .reproduction import Finding, Reproduction

__all__ = [
    "Sheet",
    "Whereabouts",
    "contents_table",
    "paper_tables",
    "settings_sheet",
    "sheets",
    "single_run_sentence",
    "summary",
    "verdicts",
    "whereabouts",
    "write_csv",
]

_COLUMNS = ("method", "estimator", "measure", "paper", "ours [95 %]", "runs", "verdict", "a single run")
_NUMERIC = ("paper", "ours [95 %]", "runs")


def summary(found: Reproduction) -> str:
    """One line: how many rows agree, differ and are undecided, for each kind of rows."""
    counts = [f"{plural}: {text}" for kind, plural in KINDS_OF_ROWS.items() if (text := verdicts(found, kind))]
    inside, known = found.single_runs
    if known:
        counts.append(f"of {known} figures that do not agree, {_within(inside)}")
    others = {"absent": "without a registered estimator", "failed": "failed", "unsuitable": "not applicable"}
    counts += [f"{n} rows {words}" for verdict, words in others.items() if (n := found.count(verdict))]
    return f"{found.paper.short}, up to {len(found.seeds)} runs of each scenario; {'; '.join(counts)}"


def single_run_sentence(found: Reproduction) -> str:
    """How many figures that do not agree can be a single run of ours; empty if none has such a range."""
    inside, known = found.single_runs
    if not known:
        return ""
    return f"Of {known} figures that do not agree with our mean, {_within(inside)}."


def _within(count: int) -> str:
    return f"{count} {'lies' if count == 1 else 'lie'} in the range of our single runs"


def verdicts(found: Reproduction, kind: str) -> str:
    """The verdicts on one kind of rows, such as ``3 agree, 1 differs``; empty if there are none.

    Parameters
    ----------
    found : Reproduction
        The comparison.
    kind : str
        A key of `simnav.leaderboard.papers.paper.KINDS_OF_ROWS`.
    """
    forms = {"agrees": ("agrees", "agree"), "differs": ("differs", "differ"), "undecided": ("undecided", "undecided")}
    counts = {verdict: found.count(verdict, kind) for verdict in forms}
    return ", ".join(f"{n} {forms[verdict][n != 1]}" for verdict, n in counts.items() if n)


@dataclass(frozen=True)
class Column:
    """A column of a sheet; numeric columns are right-aligned."""

    title: str
    numeric: bool


@dataclass(frozen=True)
class SheetRow:
    """A row of a sheet: its cells as plain text, and its verdict."""

    cells: list[str]
    verdict: str


@dataclass(frozen=True)
class Sheet:
    """One of the paper's tables with our figures.

    Attributes
    ----------
    title : str
        Our title.
    number : str
        Number of the paper's table or figure; may be empty.
    columns : list of Column
        Titles of the columns.
    rows : list of SheetRow
        The rows.
    notes : list of str
        Reasons why rows differ, with the letters that the rows refer to, and the meaning of the marks.
    """

    title: str
    number: str
    columns: list[Column]
    rows: list[SheetRow]
    notes: list[str]


def settings_sheet(paper: Paper) -> Sheet:
    """The settings of a comparison: what the paper prints, and ours."""
    columns = [Column(title, False) for title in ("setting", "the paper", "here", "source")]
    rows = [SheetRow([s.what, s.printed or tables.MISSING, s.value, s.source], "ours") for s in paper.settings]
    notes = ["'printed': as the paper prints it; 'ours': the paper does not print it, and the value is our choice"]
    return Sheet("Settings: printed, read from a figure, or ours", "", columns, rows, notes)


def sheets(found: Reproduction) -> Iterator[Sheet]:
    """One sheet for each table of the paper.

    Rows are left out if neither the paper nor we have a figure. The reason why a row differs is a note of its sheet.
    """
    for of in found.paper.tables:
        rows = [f for f in found.findings if f.table == of.title and (f.verdict != "absent" or f.row.paper is not None)]
        whys = list(dict.fromkeys(f.why for f in rows if f.why and f.verdict != "absent"))
        several = len({f.row.scenario for f in rows}) > 1
        cells, before = [], ""
        for f in rows:
            name = _method(f)
            same = name == before
            who = ["", ""] if same else [name, " / ".join(f.estimators)]
            texts = [*who, _title(f, several), _paper(f), _ours(f), _runs(f), _verdict(f, whys), _single(f)]
            cells.append(SheetRow(texts, f.verdict))
            before = name
        notes = [f"({chr(ord('a') + i)}) {why}" for i, why in enumerate(whys)]
        if any(not isinstance(f.row, Gain) and f.row.rule == "beside" for f in rows):
            notes.insert(0, "° of other data than ours, and so without a verdict")
        if any(f.row.derived and f.row.paper is not None for f in rows):
            notes.insert(0, "~ follows from other figures of the paper or from its text")
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
    """A table or figure of the paper, its subject, and where ours is, or why there is none."""

    number: str
    what: str
    where: str


def contents_table(found: Reproduction, drawn: Sequence[Drawn]) -> Table:
    """The tables and figures of the paper, and where ours are, or why there are none."""
    rows = [[row.number, row.what, row.where] for row in whereabouts(found, drawn)]
    dim = [i for i, item in enumerate(contents(found.paper)) if not item.shown]
    return tables.table("Tables and figures of the paper", ["paper", "subject", "ours"], rows, dim=dim)


def whereabouts(found: Reproduction, drawn: Sequence[Drawn]) -> list[Whereabouts]:
    """All tables and figures of the paper, in its order."""
    outcome = {f"{d.figure.name}.png": d for d in drawn}
    rows = []
    for item in contents(found.paper):
        places = []
        for place in item.shown:
            of = outcome.get(place)
            if place.endswith(".png") and of is None:
                place = f"{place} of 'simnav paper reproduce {found.paper.key}'"
            elif of is not None and of.path is None:
                place = f"{place} (no results of {', '.join(of.missing)})"
            places.append(place)
        rows.append(Whereabouts(item.number, item.what, "; ".join(places) or f"not shown: {item.why}"))
    return rows


def _method(f: Finding) -> str:
    return f"{f.row.method} against {f.row.than}" if isinstance(f.row, Gain) else f.row.method


def _title(f: Finding, with_scenario: bool) -> str:
    m = measure(f.row.score)
    text = f"gain in {m.title[0].lower()}{m.title[1:]}" if isinstance(f.row, Gain) else f"{m.title} [{m.unit}]"
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
    if f.ours.value > 2.0:  # too large for a gain in percent
        return f"worse by a factor of {tables.interval(f.ours.value, f.ours.low, f.ours.high)}"
    gain = as_gain(f.ours)
    # Rounded here, and added to zero, so that there is no -0.0.
    value, low, high = (round(x, 3) + 0.0 for x in (gain.value, gain.low, gain.high))
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


def _single(f: Finding) -> str:
    """The range of our single runs, and where the paper's figure lies."""
    if f.single is None or not f.single_verdict:
        return ""
    place = {"inside": "inside", "below": "paper is below", "above": "paper is above"}[f.single_verdict]
    if not isinstance(f.row, Gain):
        return f"{place}: {tables.number(f.single.low)} to {tables.number(f.single.high)}"
    least, most = (_gain(ratio) for ratio in (f.single.high, f.single.low))
    return f"{place}: {least} to {most}"


def _gain(ratio: float) -> str:
    """A gain in percent, or a factor where the error is more than twice as large."""
    return f"{tables.number(ratio)} times the error" if ratio > 2.0 else tables.percent(round(1.0 - ratio, 3) + 0.0)


def write_csv(found: Reproduction, path: Path) -> Path:
    """Write all rows as CSV, one on a line; the file is written completely or not at all."""
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
