"""The ranking: who has which error beside an oracle on the same runs, which rows may be the best, and how sure that is.

**Score.** The figure of a run is the ratio of its error to that of an oracle on the same run
(`simnav.leaderboard.ranking.scenario_runs`). The score of a row is the geometric mean over its runs; each kind of
trouble of a track counts the same (`simnav.leaderboard.ranking.troubles`), and recorded voyages by recording. It never
improves when a run gets worse or fails.

**Failures count.** A failed run (error, timeout, out of memory, diverged, invalid output, no position at all) has the
ratio `FAILURE`; no run has more. A lost run has its own error. An epoch without a position counts with the last
position that was given. Nothing is dropped.

**Tracks.** There are ranks within a track only. A row is ranked if it has run all scenarios of the track that are on
the board, with all seeds that the track asks (`simnav.leaderboard.ranking.evidence`); otherwise it is incomplete. One
that needs other instruments is listed as unsuitable, whatever it does elsewhere. Variants of one row beyond the first
few are listed apart (`simnav.leaderboard.ranking.variants`).

**Who is told from whom.** All pairs of rows at once, by seed. On recorded tracks the unit is the recording: each one
counts the same, whatever its scenario, and seeds over one recording are averaged. Where the rows of a track cannot be
ordered, none has a rank, and the board says why.

**More seeds where they decide.** In a track in which a row has more than 30 seeds, the rows are looked at in stages
(`simnav.leaderboard.ranking.statistics.stages`). The score of a row is over all seeds up to the last stage that it has.

**Gain.** Each row is compared with the plain row on the same runs (`simnav.leaderboard.ranking.plain_row`).

**Plausible.** A row whose errors are below the oracle's by more than chance is not ranked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.forks import forked
from simnav.leaderboard.results.errors import RequestError
from simnav.scoring import SCORES
from simnav.scoring.consistency import JUDGED
from simnav.scoring.verdict import verdict
from simnav.spec import closest

from .board import (
    Consistency,
    Ranking,
    Reference,
    Row,
    ScenarioRanking,
    ScenarioRow,
    Standing,
    TrackRanking,
    TrackRow,
)
from .evidence import lacking
from .identity import real_time_twin
from .learning import learned_by
from .remarks import (
    learned_remarks,
    recorded_remarks,
    reference_remarks,
    remarks,
    request_remarks,
    seed_remarks,
    superseded_remarks,
)
from .runs import Runs
from .scenario_runs import Cell, ScenarioRuns
from .statistics import (
    FIRST,
    Gain,
    Interval,
    Separation,
    gain,
    scenario_interval,
    score,
    separate,
    separate_in_stages,
    share,
    unlucky_excess,
    unorderable,
    weighted_quantile,
)
from .superseded import only_version, superseded_by
from .track_runs import TrackRuns, runs_of_tracks
from .tracks import is_derived

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = [
    "FAR",
    "PROVISIONAL",
    "RANKED_SCORES",
    "rank",
    "rank_track",
    "rank_tracks",
    "require_lower",
    "require_score",
    "undecided",
]

Array = NDArray[np.float64]

#: Fewer seeds or recordings than this are provisional.
PROVISIONAL = 10
#: A run is far off from this multiple of an oracle's error on.
FAR = 10.0

#: All scores that a ranking reads, unless it is asked for another one.
RANKED_SCORES = frozenset(
    {"horizontal_rmse", "smoothed_horizontal_rmse", "update_median", "coverage_95", "beyond_sigma"}
) | {f"{name}{part}" for name in ("coverage_95", *(f"nees_{g}" for g in JUDGED)) for part in ("_clean", "_faulty")}

_ORDER: Mapping[Standing, int] = {
    "ranked": 0, "variant": 1, "identical": 2, "implausible": 3, "incomplete": 4, "unsuitable": 5, "reference": 6,
}  # fmt: skip


def require_lower(score: str, why: str) -> None:
    """Refuse a score that is unknown or not better when lower, with the reason why it has to be: RequestError."""
    if score not in SCORES:
        raise RequestError(f"score = {score!r} is unknown{closest(score, list(SCORES))}")
    if SCORES[score].better != "lower":
        raise RequestError(f"score = {score!r} is not better when lower; {why}")


def require_score(score: str | None, results: Iterable[Result]) -> None:
    """Refuse a score, if one was asked for, that no result has: RequestError."""
    if score is not None and not any(math.isfinite(r.scores.get(score, math.nan)) for r in results):
        raise RequestError(f"no result has the score {score!r}; 'simnav campaign rescore' computes it from kept trials")


def rank(
    results: Iterable[Result],
    *,
    score: str | None = None,
    tracks: Mapping[str, str] | None = None,
    requested: Mapping[str, Sequence[int]] | None = None,
) -> Ranking:
    """Rank estimators by their results.

    Parameters
    ----------
    results : iterable of Result
        In any order; the ranking does not depend on it.
    score : str, optional
        Key of `simnav.scoring.SCORES` to rank all tracks by, one whose ``better`` is ``lower``. Default: the horizontal
        error, and for post-processing the smoothed one.
    tracks : mapping of str to str, optional
        Track of scenarios that are not in the catalogue, by versioned id; otherwise they are in ``other``.
    requested : mapping of str to sequence of int, optional
        How many seeds of each scenario were asked for, one number a time (`simnav.leaderboard.results.requested`).

    Returns
    -------
    Ranking

    Raises
    ------
    ValueError
        If an estimator has two results for one run.
    """
    return rank_tracks(runs_of_tracks(results, score, tracks), requested)


def rank_tracks(
    every: Iterable[TrackRuns], requested: Mapping[str, Sequence[int]] | None = None, workers: int = 1
) -> Ranking:
    """As `rank`, from the runs of the tracks, in several processes.

    Parameters
    ----------
    every : iterable of TrackRuns
        As from `simnav.leaderboard.ranking.track_runs.runs_of_tracks`.
    requested : mapping of str to sequence of int, optional
        As for `rank`.
    workers : int
        Number of processes.
    """
    tracks = list(every)
    alone = {t.name: (t, found.apart) for found in tracks if not is_derived(found.track.name) for t in found.tables}
    with forked(lambda k: rank_track(tracks[k].by_trouble(), requested), range(len(tracks)), workers) as made:
        boards = tuple(made)
    with forked(lambda name: _scenario(*alone[name]), sorted(alone), workers) as ranked:
        return Ranking(boards, tuple(ranked))


@dataclass(frozen=True, eq=False)
class _Figures:
    """What the statistics of one row are made from: a figure a unit, and the scenario that it comes from."""

    scenarios: list[str]
    strata: list[str]
    clusters: list[Any]
    logs: Array
    failed: NDArray[np.bool_]

    @property
    def keys(self) -> list[tuple[str, Any]]:
        return list(zip(self.strata, self.clusters, strict=True))


def _scenario(table: ScenarioRuns, apart: Mapping[str, Sequence[str]]) -> ScenarioRanking:
    """The ranking on one scenario alone."""
    cells = {n: {table.name: c} for n, c in table.cells.items() if len(c.logs)}
    standing = {n: _standing(n, [table], c, apart) for n, c in cells.items()}
    rows, separation, why = _rows([table], cells, standing)
    found = []
    for row in rows:
        cell = table.cells[row["estimator"]]
        found.append(ScenarioRow(
            **row,
            median=_median(cell.runs.scores(table.track.score)),
            statuses=cell.runs.statuses,
            ratios={str(u): math.exp(x) for u, x in zip(*cell.by_unit, strict=True)},
        ))  # fmt: skip
    unit = "recording" if table.recorded else "seed"
    return ScenarioRanking(
        table.name, table.track.name, table.track.score, table.reference, table.plain, unit,
        _units(found, [table], cells), remarks(separation, unit, found, [table.reference], why), why, tuple(found),
        table.unsuitable,
    )  # fmt: skip


def rank_track(runs: TrackRuns, requested: Mapping[str, Sequence[int]] | None = None) -> TrackRanking:
    """The ranking over some scenarios of a track, each of their strata counting the same.

    Parameters
    ----------
    runs : TrackRuns
        Their runs.
    requested : mapping of str to sequence of int, optional
        As for `rank`.
    """
    track, tables, apart = runs.track, runs.tables, runs.apart
    names = sorted({n for t in tables for n in (*t.cells, *t.unsuitable)})
    used = [t for t in tables if any(len(c.logs) and not c.runs.reference for c in t.cells.values())] or list(tables)
    cells = {n: {t.name: t.cells[n] for t in used if n in t.cells and len(t.cells[n].logs)} for n in names}
    standing: dict[str, tuple[Standing, str]] = {}
    for n in names:
        if cells[n] or any(n in t.cells for t in used):
            standing[n] = _standing(n, used, cells[n], apart)
        elif not is_derived(track.name) and (why := _not_suited(n, used)):
            standing[n] = "unsuitable", why
    shown = {n: c for n, c in cells.items() if c}
    rows, separation, why = _rows(used, shown, standing)
    found = [
        TrackRow(
            **row,
            covered=len(shown[row["estimator"]]),
            scenarios=len(used),
            ratios={s: math.exp(float(c.capped.mean())) for s, c in shown[row["estimator"]].items()},
        )
        for row in rows
    ]
    found += [
        TrackRow(estimator=n, standing=kind, why=reason, score=math.nan, scenarios=len(used))
        for n, (kind, reason) in standing.items()
        if n not in shown
    ]
    unit = "recording" if _all_recorded(used) else "seed"
    references = [t.reference for t in used]
    plain = sorted({t.plain for t in used if t.plain}) if all(t.plain for t in used) else []
    return TrackRanking(
        track.name, track.title, track.score, _kind(references), " or ".join(plain), unit,
        _units(found, used, shown), tuple(t.name for t in used),
        (
            *remarks(separation, unit, found, references, why),
            *request_remarks([(len(t.seeds), (requested or {}).get(t.name, ())) for t in used]),
            *reference_remarks(references),
            *learned_remarks(found),
            *superseded_remarks(found),
            *seed_remarks([t.seals for t in used]),
            *recorded_remarks(sum(t.recorded for t in used), len(used)),
        ), why, tuple(found),
    )  # fmt: skip


def _kind(references: Sequence[Reference]) -> str:
    """What the scores of a track are multiples of."""
    oracles = {r.bounds for r in references}
    if all(r.paired for r in references) and len(oracles) == 1:
        return "oracle" if oracles == {True} else "plain"
    return "figure" if any(r.estimator for r in references) else ""


_IMPLAUSIBLE = (
    "its errors on {} are below those of an oracle, which knows the noise and every fault, by more than chance"
)
_TOO_CLOSE = "its errors on {} are far below those of the plain smoother: it may hold the reference, which is public"
_IDENTICAL = "in real time it is {}, to the bit; it is ranked by what it smooths"
_VARIANT = "it is one of {} variants of {}; {} of them are ranked"


def _standing(
    name: str, tables: Sequence[ScenarioRuns], cells: Mapping[str, Cell], apart: Mapping[str, Sequence[str]]
) -> tuple[Standing, str]:
    """Whether a row that has runs (by scenario: ``cells``) is ranked over some scenarios, and if not, why."""
    if any(c.runs.reference for c in cells.values()):
        return "reference", ""
    if why := _not_suited(name, tables):
        return "unsuitable", why
    if why := lacking({t.name: (len(cells[t.name].logs) if t.name in cells else 0, len(t.seeds)) for t in tables}):
        return "incomplete", why
    if bad := [t.name for t in tables if t.implausible(name, len(tables))]:
        recorded = any(t.recorded for t in tables if t.name == bad[0])
        return "implausible", (_TOO_CLOSE if recorded else _IMPLAUSIBLE).format(bad[0])
    boards = [{m: c.runs for m, c in t.cells.items()} for t in tables]
    if twin := real_time_twin(name, tables[0].track.score, boards):
        return "identical", _IDENTICAL.format(twin)
    if family := apart.get(name):
        ranked = [m for m in family if m not in apart]
        return "variant", _VARIANT.format(len(family), family[0], len(ranked))
    return "ranked", ""


def _not_suited(name: str, tables: Sequence[ScenarioRuns]) -> str:
    """Which scenario does not suit a row, the first one, and why; empty where all suit it."""
    return next((f"{t.name}: {t.unsuitable[name]}" for t in tables if name in t.unsuitable), "")


def _figures(tables: Sequence[ScenarioRuns], cells: Mapping[str, Cell]) -> _Figures:
    """A figure a scenario and seed. Where all scenarios are recorded, one a recording, each counting the same."""
    scenarios: list[str] = []
    strata: list[str] = []
    clusters: list[Any] = []
    logs, failed = [], []
    for t in tables:
        if t.name not in cells:
            continue
        cell = cells[t.name]
        units, values = cell.by_unit
        completed = {u for u, failed_here in zip(cell.units, cell.failed.tolist(), strict=True) if not failed_here}
        scenarios += [t.name] * len(units)
        strata += ["recordings" if _all_recorded(tables) else t.stratum] * len(units)
        clusters += [(t.name, u) if t.recorded else u for u in units]
        logs.append(values)
        failed += [u not in completed for u in units]
    return _Figures(scenarios, strata, clusters, np.concatenate(logs), np.array(failed, dtype=bool))


def undecided(runs: TrackRuns) -> tuple[list[str], int]:
    """The rows that may still be the best, and how many seeds they should have next; none where no more are to be run.

    Parameters
    ----------
    runs : TrackRuns
        Runs on scenarios that are looked at in stages.
    """
    ranked = rank_track(runs).rows
    names = [r.estimator for r in ranked if r.ranked and r.may_be_best]
    if len(names) < 2 or not all(t.staged for t in runs.tables):
        return [], 0
    figures = {r.estimator: _figures(runs.tables, {t.name: t.cells[r.estimator] for t in runs.tables})
               for r in ranked if r.ranked}  # fmt: skip
    board = _board(figures, staged=True)
    wanted = separate_in_stages(board.values, board.strata, board.clusters).wanted
    return (names, wanted) if wanted else ([], 0)


def _rows(
    tables: Sequence[ScenarioRuns],
    cells: Mapping[str, Mapping[str, Cell]],
    standing: Mapping[str, tuple[Standing, str]],
) -> tuple[list[dict[str, Any]], Separation | None, str]:
    """The fields that all rows have, in the order of a table; which are told apart; why they cannot be ordered."""
    figures = {n: _figures(tables, c) for n, c in cells.items()}
    board = _board({n: f for n, f in figures.items() if standing[n][0] == "ranked"}, all(t.staged for t in tables))
    excess = _excess(board.first)
    usual = float(np.median(list(excess.values()))) if excess else 0.0  # of a row that is not ranked
    scores = {n: score(f.logs, f.strata, f.clusters, f.failed, excess.get(n, usual)) for n, f in figures.items()}
    ranked = sorted(board.names, key=lambda n: (scores[n].value, n))
    separation, places, why = _places(ranked, board)
    rest = sorted((n for n in cells if n not in ranked), key=lambda n: (_ORDER[standing[n][0]], scores[n].value, n))
    oracle = any(t.reference.bounds and t.reference.paired for t in tables)
    rows = []
    for n in [*ranked, *rest]:
        f, mine = figures[n], list(cells[n].values())
        runs = sum(len(c.logs) for c in mine)
        failed = sum(int(c.failed.sum()) for c in mine)
        weights = np.concatenate([np.full(len(c.logs), 1.0 / len(c.logs)) for c in mine])
        every = np.concatenate([c.capped for c in mine])
        lost = share(failed, runs)
        units = _count(tables, cells[n])
        over = (
            scenario_interval(f.logs, f.scenarios, f.strata) if standing[n][0] != "incomplete" else Interval(math.nan)
        )
        rows.append({
            "estimator": n,
            "standing": standing[n][0],
            "why": standing[n][1],
            **places.get(n, {}),
            "provisional": units < PROVISIONAL,
            "score": scores[n].value,
            "low": scores[n].low,
            "high": scores[n].high,
            "scenarios_low": over.low,
            "scenarios_high": over.high,
            "gain": _gain(n, tables, cells[n], excess.get(n, usual)),
            "far": float(np.mean(every > math.log(FAR))) if oracle else math.nan,
            "worst": math.exp(float(every.max())),
            "p95": math.exp(weighted_quantile(every, weights, 0.95)),
            "runs": runs,
            "failed": failed,
            "failed_low": lost.low,
            "failed_high": lost.high,
            "clean": _consistency([c.runs for c in mine], "_clean"),
            "faulty": _consistency([c.runs for c in mine], "_faulty"),
            "update_median": _median([_median(x) for c in mine if len(x := c.runs.numbers("update_median"))]),
            "peak_memory": max(c.runs.peak_memory for c in mine),
            "learned": learned_by(r for c in mine for r in c.runs.results),
            "superseded": superseded_by(n.partition("(")[0], (r for c in mine for r in c.runs.results)),
            "version": only_version(r for c in mine for r in c.runs.results),
        })  # fmt: skip
    return rows, separation, why


def _gain(name: str, tables: Sequence[ScenarioRuns], cells: Mapping[str, Cell], excess: float) -> Gain | None:
    """A row beside the plain row of each scenario, over the seeds that both have; None where there is no plain row."""
    if any(t.plain not in t.cells for t in tables) or any(t.name not in cells for t in tables):
        return None
    mine, theirs, names, strata, clusters = [], [], list[str](), list[str](), list[Any]()
    for t in tables:
        plain = dict(zip(*_by_seed(t.cells[t.plain]), strict=True))
        for seed, log in zip(*_by_seed(cells[t.name]), strict=True):
            if seed not in plain:
                continue
            mine.append(log)
            theirs.append(plain[seed])
            names.append(t.name)
            strata.append(t.stratum)
            clusters.append((t.name, t.unit(seed)) if t.recorded else seed)
    return gain(mine, theirs, strata, clusters, excess, names)


def _by_seed(cell: Cell) -> tuple[list[int], list[float]]:
    return [r.seed for r in cell.runs.tried], cell.capped.tolist()


@dataclass(frozen=True, eq=False)
class _Board:
    """Figures of all rows that are ranked, side by side: ``values`` is (runs, rows), NaN where a row has no run."""

    names: list[str]
    values: Array
    strata: list[str]
    clusters: list[Any]
    staged: bool

    @property
    def first(self) -> _Board:
        """The runs of the first stage, which all rows have."""
        if not self.staged:
            return self
        known = set(sorted(set(self.clusters))[:FIRST])
        inside = [c in known for c in self.clusters]
        strata, clusters = (list(compress(part, inside)) for part in (self.strata, self.clusters))
        return replace(self, values=self.values[inside], strata=strata, clusters=clusters)

    def separated(self) -> Separation:
        """Which rows are told apart, at all stages together."""
        if self.staged:
            return separate_in_stages(self.values, self.strata, self.clusters).separation
        return separate(self.values, self.strata, self.clusters)


def _board(figures: Mapping[str, _Figures], staged: bool) -> _Board:
    keys = sorted({k for f in figures.values() for k in f.keys}, key=repr)
    index = {k: i for i, k in enumerate(keys)}
    values = np.full((len(keys), len(figures)), np.nan)
    for j, f in enumerate(figures.values()):
        values[[index[k] for k in f.keys], j] = f.logs
    return _Board(list(figures), values, [k[0] for k in keys], [k[1] for k in keys], staged)


def _excess(board: _Board) -> dict[str, float]:
    """By how much an unlucky run of each row is worse than its others."""
    if not board.names:
        return {}
    return dict(zip(board.names, unlucky_excess(board.values, board.strata, board.clusters).tolist(), strict=True))


def _places(ranked: Sequence[str], board: _Board) -> tuple[Separation | None, dict[str, dict[str, Any]], str]:
    """Ranks and what is told apart, of the rows that are ranked, which are given in order of score.

    Where they cannot be ordered, they have no ranks, and the reason is the last that is returned.
    """
    if not ranked:
        return None, {}, ""
    board = replace(board, names=list(ranked), values=board.values[:, [board.names.index(n) for n in ranked]])
    found, first = board.separated(), board.first
    why = unorderable(first.values, first.strata, first.clusters)
    places: dict[str, dict[str, Any]] = {}
    for j, n in enumerate(ranked):
        places[n] = {
            "p_value": None if j == 0 else float(found.p_values[0, j]),
            "better_than": tuple(m for i, m in enumerate(ranked) if found.better[j, i]),
            "worse_than": tuple(m for i, m in enumerate(ranked) if found.better[i, j]),
        }
        if not why:
            places[n] |= {
                "rank_low": int(found.rank_low[j]),
                "rank_high": int(found.rank_high[j]),
                "may_be_best": bool(found.may_be_best[j]),
            }
    return found, places, why


def _all_recorded(tables: Sequence[ScenarioRuns]) -> bool:
    return all(t.recorded for t in tables)


def _count(tables: Sequence[ScenarioRuns], cells: Mapping[str, Cell]) -> int:
    """How many seeds a row has in the simulated scenario with the fewest; over recorded ones only, its recordings."""
    every = _all_recorded(tables)
    each = [len(set(cells[t.name].units)) for t in tables if t.name in cells and (every or not t.recorded)]
    return sum(each) if every else min(each, default=0)


def _units(rows: Sequence[Row], tables: Sequence[ScenarioRuns], cells: Mapping[str, Mapping[str, Cell]]) -> int:
    """How many seeds (recordings) the ranked rows have at least, in a scenario (over a recorded track)."""
    names = [r.estimator for r in rows if r.ranked] or [r.estimator for r in rows if r.estimator in cells]
    return min((_count(tables, cells[n]) for n in names), default=0)


def _consistency(runs: Sequence[Runs], part: str) -> Consistency:
    """Over all runs that went as far as having a figure."""
    found = verdict({group: np.concatenate([r.numbers(f"nees_{group}{part}") for r in runs]) for group in JUDGED})
    inside = np.concatenate([r.numbers(f"coverage_95{part}") for r in runs])
    return Consistency(
        found.badge,
        found.nees,
        found.group,
        found.groups,
        float(inside.mean()) if len(inside) else math.nan,
        float(inside.min()) if len(inside) else math.nan,
    )


def _median(values: Sequence[float] | Array) -> float:
    return float(np.median(values)) if len(values) else math.nan
