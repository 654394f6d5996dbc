"""What is to be run next where rows have more seeds: which rows, on which scenarios, with how many seeds.

Each kind of trouble of a track is a board, and so is the track. The rows that may still be the best of a board have the
seeds of its next stage (`simnav.leaderboard.ranking.statistics.stages`) on all of its scenarios, and beside them the
plain row and the oracle, which their errors are compared with. The plan follows from the results alone: a run that was
stopped goes on where it was.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .ranking import undecided
from .reference import ORACLES
from .statistics import STAGES
from .track_runs import TrackRuns, runs_of_tracks
from .tracks import SMOOTHED
from .troubles import trouble_of, troubles

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["NextRuns", "core_minutes", "next_runs"]


@dataclass(frozen=True)
class NextRuns:
    """Rows that should have more seeds on a scenario.

    Attributes
    ----------
    scenario : str
        Versioned id.
    estimators : tuple of str
        Labels.
    seeds : int
        How many seeds they should have, from 0 on.
    """

    scenario: str
    estimators: tuple[str, ...]
    seeds: int


def next_runs(
    results: Iterable[Result], tracks: Mapping[str, str] | None = None, *, most: int = STAGES[-1].seeds
) -> list[NextRuns]:
    """What is to be run next, by scenario; empty where all boards are decided or have all seeds.

    Parameters
    ----------
    results : iterable of Result
        Results on the scenarios that are looked at in stages.
    tracks : mapping of str to str, optional
        As for `simnav.leaderboard.ranking.ranking.rank`.
    most : int
        Seeds of the last stage that is to be run.
    """
    asked: dict[tuple[str, int], set[str]] = {}
    for runs in runs_of_tracks(results, None, tracks, staged=True):
        if runs.track.score == SMOOTHED:  # of scenarios that other tracks rank, too
            continue
        for board in (runs, *_groups(runs)):
            names, seeds = undecided(board)
            for table in board.tables if names and seeds <= most else ():
                beside = {table.plain, ORACLES.get(runs.track.score, "oracle")} & table.cells.keys()
                asked.setdefault((table.name, seeds), set()).update(names, beside)
    return [NextRuns(scenario, tuple(sorted(names)), seeds) for (scenario, seeds), names in sorted(asked.items())]


def _groups(runs: TrackRuns) -> list[TrackRuns]:
    """The kinds of trouble of a track."""
    found = (runs.only(lambda scenario, name=name: trouble_of(scenario) == name) for name in troubles())  # type: ignore[misc]
    return [group for group in found if group.tables]


def core_minutes(wanted: Iterable[NextRuns], results: Iterable[Result]) -> float:
    """How long the runs that are missing take on one core, from the times of the results [min]."""
    times: dict[tuple[str, str], list[float]] = {}
    for r in results:
        if r.tried:
            times.setdefault((r.scenario, r.estimator), []).append(r.seconds)
    missing: dict[tuple[str, str], int] = {}
    for each in wanted:
        for name in each.estimators:
            missing[each.scenario, name] = max(each.seeds, missing.get((each.scenario, name), 0))
    found = ((times[key], seeds) for key, seeds in missing.items() if key in times)
    return sum(max(seeds - len(known), 0) * sum(known) / len(known) for known, seeds in found) / 60.0
