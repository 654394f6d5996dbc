"""The history of rows: a CSV file with one line for each row of a track in each edition of the board.

An edition is what was published at a time. Its lines stay when results are computed again, so that a figure that was
quoted can be found. The column ``version`` is the declared version of a row; lines from before versions were declared
keep the digest of the row's code that was published with them.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from simnav.leaderboard.ranking.board import Ranking
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.files import csv_text, write_whole
from simnav.leaderboard.results.provenance import distinct
from simnav.leaderboard.results.result import Result

__all__ = ["Line", "append", "editions", "lines_of", "read"]

_COMMIT = 12


@dataclass(frozen=True)
class Line:
    """A row of a track in an edition.

    Attributes
    ----------
    edition : int
        Number of the edition, from 1.
    date : str
        Day of the latest run, as ``2026-11-22``.
    benchmark, commit : str
        Version of the benchmark; commits of the row's runs, separated by blanks, with ``+`` where files differed.
    track, row : str
        Name of the track, label of the estimator.
    version : str
        Version of the estimator; several are separated by blanks.
    ranks : str
        Interval of the rank, like ``2-5``; empty for a row that is not ranked.
    score, low, high : float
        As in `simnav.leaderboard.ranking.board.Row`.
    runs, failed : int
        Number of runs on the track, and how many of them failed.
    """

    edition: int
    date: str
    benchmark: str
    commit: str
    track: str
    row: str
    version: str
    ranks: str
    score: float
    low: float
    high: float
    runs: int
    failed: int


_NAMES = [f.name for f in fields(Line)]
_OF_TYPE: dict[Any, Callable[[str], Any]] = {"int": int, "str": str, "float": lambda cell: float(cell or "nan")}
_READ = [_OF_TYPE[f.type] for f in fields(Line)]  # by column


def lines_of(ranking: Ranking, results: Sequence[Result], edition: int) -> list[Line]:
    """The lines of an edition."""
    by: dict[str, list[Result]] = {}
    for result in results:
        by.setdefault(result.estimator, []).append(result)
    found = []
    for track in ranking.tracks:
        for row in track.rows:
            mine = by.get(row.estimator, [])
            known = distinct(r.provenance for r in mine)
            commits = {f"{p.commit[:_COMMIT]}{'+' if p.dirty else ''}" for p in known if p.commit}
            found.append(
                Line(
                    edition, max((p.date for p in known), default=""), max((p.benchmark for p in known), default=""),
                    " ".join(sorted(commits)), track.track, row.estimator,
                    " ".join(map(str, sorted({r.estimator_version for r in mine}))), row.ranks if row.ranked else "",
                    _rounded(row.score), _rounded(row.low), _rounded(row.high), row.runs, row.failed,
                )
            )  # fmt: skip
    return found


def _rounded(value: float) -> float:
    return float(f"{value:.5g}")


def read(path: Path) -> list[Line]:
    """All lines; none where there is no file.

    Raises
    ------
    RequestError
        If it is no such file: the message names the line.
    """
    if not path.exists():
        return []
    found = []
    with open(path, encoding="utf-8", newline="") as file:
        rows = csv.reader(file)
        if next(rows, []) != _NAMES:
            raise RequestError(f"{path}: the first line should be {','.join(_NAMES)}")
        for number, row in enumerate(rows, start=2):
            try:
                if len(row) != len(_NAMES):
                    raise ValueError(f"{len(row)} values where {len(_NAMES)} are wanted")
                found.append(Line(*(read_cell(cell) for read_cell, cell in zip(_READ, row, strict=True))))
            except ValueError as error:
                raise RequestError(f"{path}, line {number}: {error}") from None
    return found


def append(path: Path, ranking: Ranking, results: Sequence[Result]) -> int:
    """Add an edition, unless the last one says the same; returns the number of the last edition."""
    before = read(path)
    last = max((line.edition for line in before), default=0)
    lines = lines_of(ranking, results, last + 1)
    if _facts(lines) == _facts(line for line in before if line.edition == last):
        return last
    write_whole(path, csv_text([_NAMES, *map(_cells, [*before, *lines])]))
    return last + 1


def editions(lines: Iterable[Line]) -> dict[int, list[Line]]:
    """The lines of each edition, the latest first."""
    found: dict[int, list[Line]] = {}
    for line in lines:
        found.setdefault(line.edition, []).append(line)
    return dict(sorted(found.items(), reverse=True))


def _facts(lines: Iterable[Line]) -> list[tuple[str, ...]]:
    """What lines say apart from the number of their edition."""
    return [tuple(_cells(line)[1:]) for line in lines]


def _cells(line: Line) -> list[str]:
    values = [getattr(line, name) for name in _NAMES]
    return ["" if isinstance(v, float) and math.isnan(v) else f"{v:.5g}" if isinstance(v, float) else str(v)
            for v in values]  # fmt: skip
