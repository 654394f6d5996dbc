"""The profile of a track: the result of each row in each kind of trouble, tested within the kind.

The mean over a track is one number over unlike questions: which row is best with a lasting bias, and which in an
outage. So the scenarios of a track are grouped by what goes wrong in them (`simnav.leaderboard.ranking.troubles`), and
each group is ranked by itself, as a track is (`simnav.leaderboard.ranking.ranking`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.forks import forked
from simnav.leaderboard.results.plain import as_json

from . import tables
from .board import TrackRanking
from .ranking import rank_track
from .statistics import Gain, share
from .track_runs import TrackRuns, runs_of_tracks
from .troubles import trouble_of, troubles, within

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

    from .rows import Row
    from .scenario_runs import ScenarioRuns

__all__ = ["BAD", "GroupRow", "TrackProfile", "TroubleGroup", "group_of", "profile_table", "profiles", "profiles_of",
           "ranked_group"]  # fmt: skip

#: A run is bad if it fails, is lost, or has an error of more than so many times that of the plain row in the same run.
BAD = 5.0


@dataclass(frozen=True)
class GroupRow:
    """One estimator in one kind of trouble.

    Attributes
    ----------
    estimator : str
        Label.
    ranked : bool
        Whether it is compared with the others; the plain row is, references are not.
    to_plain, to_plain_low, to_plain_high : float
        Geometric mean of its error over that of the plain row in the same run, with the 95 % interval over seeds
        (recordings). NaN where there is no plain row; the interval also with too few seeds.
    scenarios_low, scenarios_high : float
        The same interval for other scenarios of the kind; NaN with fewer than three scenarios.
    to_reference, to_reference_low, to_reference_high : float
        The same over the reference of the group: an oracle, or the plain row on recorded voyages.
    coverage : float
        Share of the epochs at which the truth lies in the stated 95 % ellipse, mean over the runs; NaN without one.
    bad, bad_low, bad_high : float
        Share of the runs that are bad (`BAD`), with its 95 % interval. NaN where there is no plain row.
    runs : int
        Number of runs that count.
    may_be_best : bool
        Whether it belongs to the set that holds the best row of the group with 95 % probability.
    better_than, worse_than : tuple of str
        The rows that are significantly worse, and better: all pairs of the group tested together.
    update_median : float
        Median wall-clock time of an epoch in these runs [s].
    """

    estimator: str
    ranked: bool
    to_plain: float
    to_plain_low: float
    to_plain_high: float
    scenarios_low: float
    scenarios_high: float
    to_reference: float
    to_reference_low: float
    to_reference_high: float
    coverage: float
    bad: float
    bad_low: float
    bad_high: float
    runs: int
    may_be_best: bool
    better_than: tuple[str, ...]
    worse_than: tuple[str, ...]
    update_median: float


@dataclass(frozen=True)
class TroubleGroup:
    """The scenarios of a track with one kind of trouble.

    Attributes
    ----------
    trouble, title : str
        Name and title of the kind of trouble.
    scenarios : tuple of str
        Versioned ids.
    plain, reference : str
        The plain row, and what `GroupRow.to_reference` is over, as in `simnav.leaderboard.ranking.board.TrackRanking`.
    unit : str
        ``seed`` or ``recording``.
    units : int
        How many of them the ranked rows have, at least.
    insufficient : str
        Why the rows cannot be ordered; empty where they can.
    rows : tuple of GroupRow
        Ranked rows by error, then the others that were run.
    """

    trouble: str
    title: str
    scenarios: tuple[str, ...]
    plain: str
    reference: str
    unit: str
    units: int
    insufficient: str
    rows: tuple[GroupRow, ...]

    @property
    def ranked(self) -> tuple[GroupRow, ...]:
        """The rows that are compared."""
        return tuple(r for r in self.rows if r.ranked)

    @property
    def separates(self) -> bool:
        """Whether any row is told from any other."""
        return any(r.better_than for r in self.ranked)

    def row(self, estimator: str) -> GroupRow | None:
        """The row of an estimator; None where it was not run."""
        return next((r for r in self.rows if r.estimator == estimator), None)


@dataclass(frozen=True)
class TrackProfile:
    """The results on a track by kind of trouble.

    Attributes
    ----------
    track, title, score : str
        As in `simnav.leaderboard.ranking.board.TrackRanking`.
    groups : tuple of TroubleGroup
        In the order of `simnav.leaderboard.ranking.troubles.troubles`.
    """

    track: str
    title: str
    score: str
    groups: tuple[TroubleGroup, ...]

    @property
    def silence(self) -> str:
        """The groups that separate nobody, in one sentence; empty where each separates somebody."""
        silent = [within(g.title) for g in self.groups if not g.separates]
        return f"No two rows differ significantly in these groups: {', '.join(silent)}." if silent else ""

    def to_dict(self) -> dict[str, Any]:
        """Plain dicts and lists for JSON."""
        found: dict[str, Any] = as_json(vars(self))
        return found | {"silence": self.silence}


def profiles(
    results: Iterable[Result], *, score: str | None = None, tracks: Mapping[str, str] | None = None
) -> tuple[TrackProfile, ...]:
    """The profile of each track; scenarios without a kind of trouble are left out.

    Parameters
    ----------
    results, score, tracks
        As for `simnav.leaderboard.ranking.ranking.rank`.

    Raises
    ------
    ValueError
        If an estimator has two results for one run.
    """
    return profiles_of(runs_of_tracks(results, score, tracks))


def profiles_of(every: Iterable[TrackRuns], workers: int = 1) -> tuple[TrackProfile, ...]:
    """As `profiles`, from the runs of the tracks, in several processes.

    Parameters
    ----------
    every : iterable of TrackRuns
        As from `simnav.leaderboard.ranking.track_runs.runs_of_tracks`.
    workers : int
        Number of processes.
    """
    tracks = list(every)
    asked = [(runs, name) for runs in tracks for name in troubles() if _with_trouble(runs, name) not in runs.groups]
    with forked(lambda k: group_of(*asked[k]), range(len(asked)), workers) as made:
        for (runs, name), group in zip(asked, made, strict=True):
            if group is not None:
                runs.groups[_with_trouble(runs, name)] = group
    return tuple(filter(None, map(_profile, tracks)))


def _profile(runs: TrackRuns) -> TrackProfile | None:
    groups = tuple(filter(None, (group_of(runs, name) for name in troubles())))
    return TrackProfile(runs.track.name, runs.track.title, runs.track.score, groups) if groups else None


def group_of(runs: TrackRuns, trouble: str) -> TroubleGroup | None:
    """The results on the scenarios with one kind of trouble; None where there is none among the runs.

    The same scenarios are ranked once, whoever asks: the profile of the track, or the advice for some instruments.
    """
    key = _with_trouble(runs, trouble)
    if key and key not in runs.groups:
        runs.groups[key] = ranked_group(replace(runs, tables=key), trouble, troubles()[trouble].title)
    return runs.groups.get(key)


def _with_trouble(runs: TrackRuns, trouble: str) -> tuple[ScenarioRuns, ...]:
    """The scenarios with one kind of trouble."""
    return tuple(t for t in runs.tables if trouble_of(t.name) == trouble)


def ranked_group(runs: TrackRuns, trouble: str, title: str) -> TroubleGroup:
    """The results on some scenarios, whatever their kinds of trouble are."""
    board = rank_track(runs)
    rows = tuple(_row(r, board, runs.tables) for r in board.rows if r.runs)
    return TroubleGroup(
        trouble, title, board.scenarios, board.plain, board.reference, board.unit, board.units, board.insufficient, rows
    )


def _row(row: Row, board: TrackRanking, every: Sequence[ScenarioRuns]) -> GroupRow:
    gain = row.gain or Gain(math.nan)
    cells = [t.cells[row.estimator] for t in every if row.estimator in t.cells]
    inside = np.concatenate([c.runs.numbers("coverage_95") for c in cells])
    found = _bad(row.estimator, every) if board.plain else []
    bad = share(sum(found), len(found))
    return GroupRow(
        row.estimator, row.ranked, gain.value, gain.low, gain.high, gain.scenarios_low, gain.scenarios_high,
        row.score, row.low, row.high, float(inside.mean()) if len(inside) else math.nan,
        bad.value, bad.low, bad.high, row.runs, row.may_be_best, row.better_than, row.worse_than, row.update_median,
    )  # fmt: skip


def _bad(name: str, every: Iterable[ScenarioRuns]) -> list[bool]:
    """Whether each run of a row is bad beside the plain row's."""
    found = []
    for t in every:
        if name not in t.cells or t.plain not in t.cells:
            continue
        plain = {r.seed: t.log(t.plain, r.seed) for r in t.cells[t.plain].runs.tried}
        mine = t.cells[name]
        for run, log in zip(mine.runs.tried, mine.logs.tolist(), strict=True):
            if run.seed in plain:
                found.append(run.outcome != "ok" or math.isinf(log) or log - plain[run.seed] > math.log(BAD))
    return found


def profile_table(profile: TrackProfile, most: int = 12) -> tables.Fitted:
    """The errors beside the plain row's, a row an estimator and a column a kind of trouble.

    Parameters
    ----------
    profile : TrackProfile
        What is shown.
    most : int
        Rows that are shown: those that may be the best of most groups first.
    """
    names = [r.estimator for r in profile.groups[0].ranked]
    rows = {n: [found for g in profile.groups if (found := g.row(n)) is not None and found.ranked] for n in names}
    best = {n: sum(r.may_be_best for g, r in zip(profile.groups, found, strict=False) if g.separates)
            for n, found in rows.items()}  # fmt: skip
    order = sorted(
        (n for n, found in rows.items() if len(found) == len(profile.groups)),
        key=lambda n: (-best[n], _mean(r.to_plain for r in rows[n]), n),
    )
    cells = [[n, *(_cell(g, n) for g in profile.groups)] for n in order[:most]]
    columns = ["estimator", *(g.title for g in profile.groups)]
    left = f" {len(order) - most} rows more are in the document of --json." if len(order) > most else ""
    return tables.Fitted(
        f"{profile.title}: error beside the plain row's, by kind of trouble", columns, cells, columns,
        always=len(columns), numeric=columns[1:],
        caption=f"+: may be the best of a group that separates rows. {profile.silence}{left}".rstrip(),
    )  # fmt: skip


def _mean(ratios: Iterable[float]) -> float:
    """The geometric mean of those that are known; infinite without any."""
    logs = [math.log(r) for r in ratios if r > 0.0]
    return math.fsum(logs) / len(logs) if logs else math.inf


def _cell(group: TroubleGroup, estimator: str) -> str:
    row = group.row(estimator)
    if row is None:
        return tables.MISSING
    return tables.number(row.to_plain, 2) + (" +" if row.may_be_best and group.separates else "")
