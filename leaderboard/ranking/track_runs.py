"""The runs of a track, scenario by scenario: what the ranking of a track, or of a part of it, is made from."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.estimator import EstimatorError
from simnav.estimator.registry import registered
from simnav.leaderboard.campaign.request import comes_with_simnav

from .learning import voyages_of
from .runs import Runs, group
from .scenario_runs import ScenarioRuns
from .statistics import FIRST
from .tracks import BUDGETS, LEARNED_ON, RECORDED, Track, catalogued, title, tracks_of
from .troubles import trouble_of
from .variants import families, surplus

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["TrackRuns", "runs_of_tracks"]


@dataclass(frozen=True, eq=False)
class TrackRuns:
    """The runs of all rows on some scenarios of a track.

    Attributes
    ----------
    track : Track
        The track, with its score.
    tables : sequence of ScenarioRuns
        One a scenario.
    apart : mapping of str to sequence of str
        Variants beyond the first few of one row, which have no rank, and their family.
    groups : dict
        By scenarios, the results in one kind of trouble that are known already
        (`simnav.leaderboard.ranking.trouble_profile.TroubleGroup`).
    """

    track: Track
    tables: Sequence[ScenarioRuns]
    apart: Mapping[str, Sequence[str]]
    groups: dict[tuple[ScenarioRuns, ...], Any] = field(default_factory=dict)

    def only(self, wanted: Callable[[str], bool]) -> TrackRuns:
        """Those of the scenarios whose versioned ids are wanted."""
        return replace(self, tables=[t for t in self.tables if wanted(t.name)])

    def by_trouble(self) -> TrackRuns:
        """The same, where each kind of trouble counts the same; a scenario without one is a kind of its own."""
        return replace(self, tables=[t.in_stratum(trouble_of(t.name) or t.name) for t in self.tables])

    def of_rows(self, names: Container[str]) -> TrackRuns:
        """Those of some rows; what their errors are divided by stays."""
        return replace(self, tables=[t.of_rows(names) for t in self.tables])


def runs_of_tracks(
    results: Iterable[Result],
    score: str | None = None,
    tracks: Mapping[str, str] | None = None,
    staged: bool = False,
) -> Iterator[TrackRuns]:
    """The runs of each track, in the order in which tracks are shown; tracks without a run are left out.

    Parameters
    ----------
    results, score, tracks
        As for `simnav.leaderboard.ranking.ranking.rank`.
    staged : bool
        True: simulated scenarios are looked at in stages (`simnav.leaderboard.ranking.statistics.stages`). Otherwise
        those of a track are as soon as one of its rows has more seeds than the first stage.

    Raises
    ------
    ValueError
        If an estimator has two results for one run.
    """
    runs = group(results)
    found = list(_ordinary(runs, score, tracks, staged))
    yield from found
    yield from _learned(found)


def _ordinary(
    runs: Mapping[str, Mapping[str, Runs]], score: str | None, tracks: Mapping[str, str] | None, staged: bool
) -> Iterator[TrackRuns]:
    """The runs of the tracks that scenarios name, and of post-processing."""
    headers = catalogued()  # what a scenario is, it says, and not what results say
    known = {**{name: h.track for name, h in headers.items()}, **(tracks or {})}
    for track in tracks_of(runs, known, score):
        apart = surplus(_families(track, runs))
        recorded = {s: headers[s].recorded for s in track.scenarios if s in headers}
        simulated = track.name != RECORDED and not any(recorded.values())
        looks = simulated and (staged or any(_most(runs[s]) > FIRST for s in track.scenarios))
        every = (ScenarioRuns(s, runs[s], track, recorded.get(s), apart, looks) for s in track.scenarios)
        tables = [t for t in every if t.cells]
        if tables:
            yield TrackRuns(track, tables, apart)


def _most(by: Mapping[str, Runs]) -> int:
    """The largest number of seeds of a row that is no reference."""
    return max((len(runs.tried) for runs in by.values() if not runs.reference), default=0)


def _learned(found: Sequence[TrackRuns]) -> Iterator[TrackRuns]:
    """The runs of the rows that learned from no more voyages than a budget.

    A track of one row alone is left out, and one of the same rows as a smaller budget.
    """
    parts = [runs for runs in found if runs.track.name in LEARNED_ON]
    tables = [table for runs in parts for table in runs.tables]
    cells = {name: cell for table in tables for name, cell in table.cells.items()}
    voyages = {name: voyages_of(cell.runs.results) for name, cell in cells.items()}
    references = {name for name, cell in cells.items() if cell.runs.reference}
    fewer: set[str] = set()
    for name, budget in BUDGETS.items():
        mine = {row for row, count in voyages.items() if count <= budget}
        if len(mine) > 1 and mine != fewer:
            fewer = mine
            apart = {row: family for runs in parts for row, family in runs.apart.items()}
            track = Track(name, title(name), parts[0].track.score, tuple(table.name for table in tables))
            yield TrackRuns(track, tables, apart).of_rows(mine | references)


def _families(track: Track, runs: Mapping[str, Mapping[str, Runs]]) -> list[list[str]]:
    """Variants of one row on a track, by name and by what they estimate."""
    logs: dict[str, dict[object, float]] = {}
    for s in track.scenarios:
        for label, found in runs[s].items():
            if not found.reference:
                errors = np.maximum(found.column(track.score), 1e-9)
                with np.errstate(invalid="ignore"):
                    values = np.log(errors).tolist()
                logs.setdefault(label, {}).update(
                    {(s, r.seed): x for r, x in zip(found.results, values, strict=True) if r.status == "ok"}
                )
    return families(logs, _comes_with_simnav)


def _comes_with_simnav(name: str) -> bool:
    try:
        return comes_with_simnav(registered(name))
    except EstimatorError:
        return False
