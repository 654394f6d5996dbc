"""What the templates of the site are given: one frozen class for each thing that they show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_table import between

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Row, ScenarioRow, TrackRow
    from simnav.leaderboard.ranking.runs import Runs
    from simnav.leaderboard.ranking.statistics import Interval

__all__ = [
    "Bar",
    "Cell",
    "Column",
    "EstimatorEntry",
    "EstimatorPage",
    "EstimatorRow",
    "ExtraPage",
    "Fact",
    "Failure",
    "Image",
    "IndexRow",
    "IndexTrack",
    "MatrixRow",
    "ScenarioEntry",
    "ScenarioPage",
    "ScenarioPageRow",
    "SiteFacts",
    "bars",
    "score_cells",
]

_WIDEST = 50.0  # largest ratio on the scale of the bars
_DEGREES = math.degrees(1.0)


@dataclass(frozen=True)
class Fact:
    """A name and a value at the head of a page."""

    name: str
    value: str | int


@dataclass(frozen=True)
class Image:
    """A figure: its file without ending, and its size in CSS pixels."""

    file: str
    caption: str
    alt: str
    width: int
    height: int


@dataclass(frozen=True)
class EstimatorEntry:
    """An estimator wherever it is named: its page, its colours on a light and a dark ground."""

    label: str
    page: str
    colour: str
    dark: str
    reference: bool


@dataclass(frozen=True)
class ScenarioEntry:
    """A scenario wherever it is named, with what the catalogue knows of it.

    Attributes
    ----------
    id, name, page : str
    seeds : tuple of int
        All that any estimator ran.
    title, description, source : str
        Empty for one that is not in the catalogue.
    argument : str
        As the command takes it.
    facts : tuple of Fact
    """

    id: str
    name: str
    page: str
    seeds: tuple[int, ...]
    argument: str
    facts: tuple[Fact, ...]
    title: str = ""
    description: str = ""
    source: str = ""


class ExtraPage(Protocol):
    """A page that something other than a campaign's results brings to the site: a reproduction of a paper."""

    @property
    def page(self) -> str:
        """Name of its file."""

    @property
    def paper(self) -> str:
        """Key of the paper, for the menu."""

    @property
    def title(self) -> str:
        """Of the paper."""

    @property
    def summary(self) -> str:
        """One line for the index."""

    def install(self, folder: Path, site: SiteFacts) -> None:
        """Write the page and its figures into the folder of a site."""


@dataclass(frozen=True)
class SiteFacts:
    """What all pages share.

    Attributes
    ----------
    version, generated : str
        Of simnav; date and time.
    total : int
        Results; 0 for a page that stands alone.
    scenarios : sequence of ScenarioEntry
    papers : sequence of ExtraPage
    command : str
        That makes the results again.
    versions : mapping of str to str
        Of simnav and what it runs on.
    """

    version: str
    generated: str
    total: int = 0
    scenarios: Sequence[ScenarioEntry] = ()
    papers: Sequence[ExtraPage] = ()
    command: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Bar:
    """A score with its interval on a logarithmic scale: places in percent; ``width`` is None without an interval."""

    point: float
    beyond: bool
    left: float
    width: float | None
    title: str


@dataclass(frozen=True)
class Cell:
    """A score in a table: its text and interval, what it is sorted by, and where it leads."""

    text: str
    value: float
    interval: str = ""
    best: bool = False
    page: str = ""


@dataclass(frozen=True)
class Column:
    """A column of a score table.

    Attributes
    ----------
    key, title : str
        Of the score; heading.
    factor : float
        From SI to what is shown.
    form : str
        ``%``, ``time`` or ``-`` (a figure) are shown without interval; empty: with it.
    lowest_is_best : bool
    """

    key: str
    title: str
    factor: float = 1.0
    form: str = ""
    lowest_is_best: bool = True

    def cell(self, f: Interval, barred: bool, best: float) -> Cell:
        """The cell of a score; one that is barred is never the best."""
        if math.isnan(f.value):
            return Cell("–", math.nan)
        write = {"%": tables.percent, "time": tables.duration}.get(self.form, tables.number)
        interval = "" if self.form else between(f.low * self.factor, f.high * self.factor)
        is_best = self.lowest_is_best and not barred and f.value == best
        return Cell(write(f.value * self.factor), f.value, interval, is_best)


_COLUMNS = (
    Column("horizontal_rmse", "Horizontal RMSE [m]"),
    Column("r95", "R95 [m]"),
    Column("vertical_rmse", "Vertical RMSE [m]"),
    Column("velocity_horizontal_rmse", "Velocity RMSE [m/s]"),
    Column("heading_rmse", "Heading RMSE [deg]", _DEGREES),
    Column("outage_end_error", "At outage end [m]"),
    Column("recovery_time", "Recovery [s]"),
    Column("nees_horizontal", "NEES / dof", form="-", lowest_is_best=False),
    Column("coverage_95", "95 % coverage", form="%", lowest_is_best=False),
    Column("detection_rate", "Faults detected", form="%", lowest_is_best=False),
    Column("false_alarm_rate", "False alarms", form="%", lowest_is_best=False),
    Column("smoothed_horizontal_rmse", "Smoothed RMSE [m]"),
    Column("update_median", "Per epoch", form="time", lowest_is_best=False),
)


@dataclass(frozen=True)
class IndexRow:
    """A row of the ranking of a track."""

    row: TrackRow
    entry: EstimatorEntry
    starts_tier: bool
    bar: Bar | None


@dataclass(frozen=True)
class IndexTrack:
    """The ranking of a track on the index.

    Attributes
    ----------
    track : str
        In kebab-case.
    title, caption : str
    score : str
        Heading of the score.
    provisional : bool
    rows : tuple of IndexRow
    notes : tuple of str
        Sentences below the table.
    figure : Image or None
    """

    track: str
    title: str
    caption: str
    score: str
    provisional: bool
    rows: tuple[IndexRow, ...]
    notes: tuple[str, ...]
    figure: Image | None


@dataclass(frozen=True)
class MatrixRow:
    """An estimator's medians, a cell a scenario."""

    entry: EstimatorEntry
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class ScenarioPageRow:
    """An estimator on the page of a scenario."""

    row: ScenarioRow
    entry: EstimatorEntry
    cells: tuple[Cell, ...]
    starts_tier: bool


@dataclass(frozen=True)
class Failure:
    """How many runs of an estimator ended with a status, and why the first did."""

    label: str
    status: str
    runs: int
    reason: str


@dataclass(frozen=True)
class ScenarioPage:
    """The page of a scenario; ``unsuitable`` maps a reason to the estimators that it keeps out."""

    entry: ScenarioEntry
    baseline: str
    remarks: tuple[str, ...]
    columns: tuple[Column, ...]
    rows: tuple[ScenarioPageRow, ...]
    unsuitable: Mapping[str, Sequence[str]]
    failures: tuple[Failure, ...]
    figures: tuple[Image, ...]


@dataclass(frozen=True)
class EstimatorRow:
    """A scenario on the page of an estimator."""

    scenario: ScenarioEntry
    runs: int
    failed: int
    cells: tuple[Cell, ...]
    badge: str


@dataclass(frozen=True)
class EstimatorPage:
    """The page of an estimator; ``unsuitable`` maps a reason to the scenarios that do not suit it."""

    entry: EstimatorEntry
    summary: str
    facts: tuple[Fact, ...]
    columns: tuple[Column, ...]
    rows: tuple[EstimatorRow, ...]
    unsuitable: Mapping[str, Sequence[str]]
    parameters: str


def score_cells(runs: Sequence[tuple[Runs, bool]]) -> tuple[tuple[Column, ...], list[tuple[Cell, ...]]]:
    """Columns in which anybody who is ranked has a figure, and the cells of each row.

    The second of a pair says whether it is barred from being the best.
    """
    columns: list[Column] = []
    cells: list[list[Cell]] = [[] for _ in runs]
    for column in _COLUMNS:
        found = [r.score(column.key) for r, _ in runs]
        ranked = [f for f, (r, _) in zip(found, runs, strict=True) if not r.reference] or found
        if all(math.isnan(f.value) for f in ranked):
            continue
        columns.append(column)
        free = (f.value for f, (_, barred) in zip(found, runs, strict=True) if not barred and not math.isnan(f.value))
        best = min(free, default=math.nan)
        for row, f, (_, barred) in zip(cells, found, runs, strict=True):
            row.append(column.cell(f, barred, best))
    return tuple(columns), [tuple(row) for row in cells]


def bars(rows: Iterable[Row]) -> list[Bar | None]:
    """Every score with its interval on one logarithmic scale, which ends at `_WIDEST` times the least."""
    rows = list(rows)
    ends = [v for r in rows for v in (r.score, r.low, r.high) if v > 0.0 and math.isfinite(v)]
    low = math.log(min(ends, default=1.0))
    high = min(math.log(max(ends, default=math.e)), low + math.log(_WIDEST))
    span = max(high - low, 1e-9)

    def place(value: float) -> float:
        return round(min(2.0 + 96.0 * (math.log(value) - low) / span, 100.0), 2)

    def bar(row: Row) -> Bar | None:
        if not row.score > 0.0 or not math.isfinite(row.score):
            return None
        known = row.low > 0.0 and math.isfinite(row.high)
        return Bar(
            point=place(row.score),
            beyond=math.log(row.score) > high,
            left=place(row.low) if known else 0.0,
            width=round(place(row.high) - place(row.low), 2) if known else None,
            title=tables.interval(row.score, row.low, row.high),
        )

    return [bar(row) for row in rows]
