"""The ranking: who has which error, as a multiple of a fixed reference figure, and how sure we are.

**Score.** The figure of a run is the ratio of its error to the scenario's reference figure
(`simnav.leaderboard.ranking.reference`). The score of a row is the geometric mean over its runs; each scenario counts
the same (`simnav.leaderboard.ranking.statistics`). It never improves when a run gets worse or fails.

**Failures count.** A failed run (error, timeout, out of memory, diverged, invalid output, no position at all) has the
ratio `FAILURE`; no run has more. An epoch without a position counts with the last position that was given. Nothing is
dropped.

**Tracks.** There are ranks within a track only. A row is ranked if it has run all scenarios of the track that are on
the board. One that needs other instruments is listed as unsuitable, whatever it does elsewhere.

**Runs that count.** Seeds count in order up to the first that a row has not run, so that nobody can choose seeds. The
score of a row with fewer seeds than others is adjusted for how hard the missing ones are
(`simnav.leaderboard.ranking.adjustment`).

**Who is told from whom.** Sign flips over all pairs of rows at once, by seed. On recorded tracks the unit is the
recording: each one counts the same, whatever its scenario, and seeds over one recording are averaged.

**Plausible.** A row whose errors are below the oracle's by more than chance is not ranked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.ranking.adjustment import adjustments
from simnav.leaderboard.ranking.board import (
    Consistency,
    Ranking,
    Row,
    ScenarioRanking,
    ScenarioRow,
    Standing,
    TrackRanking,
    TrackRow,
)
from simnav.leaderboard.ranking.identity import real_time_twin
from simnav.leaderboard.ranking.plausibility import beats, too_good
from simnav.leaderboard.ranking.reference import reference_of
from simnav.leaderboard.ranking.remarks import reference_remarks, remarks
from simnav.leaderboard.ranking.runs import Runs, group
from simnav.leaderboard.ranking.statistics import (
    FAILURE,
    Separation,
    score,
    separate,
    share,
    tiers,
    weighted_quantile,
)
from simnav.leaderboard.ranking.tracks import RECORDED, Track, catalogued_tracks, tracks_of
from simnav.leaderboard.results.errors import RequestError
from simnav.scoring import SCORES, badge
from simnav.spec import closest

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["PROVISIONAL", "RANKED_SCORES", "rank", "require_lower", "require_score"]

Array = NDArray[np.float64]
Unit = tuple[str, Any]  # scenario, and seed or recording

#: Fewer seeds or recordings than this are provisional.
PROVISIONAL = 10

#: All scores that a ranking reads, unless it is asked for another one.
RANKED_SCORES = frozenset({"horizontal_rmse", "smoothed_horizontal_rmse", "update_median"}) | {
    f"{name}{part}" for name in ("nees_horizontal", "coverage_95") for part in ("_clean", "_faulty")
}

_CAP = math.log(FAILURE)
_LEAST = math.log(1e-9)  # of an error of zero
_RECORDING = re.compile(r"recording '([^']*)'")


def require_lower(score: str, why: str) -> None:
    """Refuse a score that is unknown or not better when lower, with the reason why it has to be: RequestError."""
    if score not in SCORES:
        raise RequestError(f"score = {score!r} is unknown{closest(score, list(SCORES))}")
    if SCORES[score].better != "lower":
        raise RequestError(f"score = {score!r} is not better when lower; {why}")


def require_score(score: str | None, results: Iterable[Result]) -> None:
    """Refuse a score, if one was asked for, that no result has: RequestError."""
    if score is not None and not any(math.isfinite(r.scores.get(score, math.nan)) for r in results):
        raise RequestError(f"no result has the score {score!r}; 'simnav rescore' computes it from kept trials")


def rank(results: Iterable[Result], *, score: str | None = None, tracks: Mapping[str, str] | None = None) -> Ranking:
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

    Returns
    -------
    Ranking

    Raises
    ------
    ValueError
        If an estimator has two results for one run.
    """
    runs = group(results)
    known = dict(tracks or {})
    if not known.keys() >= runs.keys():
        known = {**catalogued_tracks(), **known}
    boards: list[TrackRanking] = []
    scenarios: dict[str, ScenarioRanking] = {}
    for track in tracks_of(runs, known, score):
        tables = [_Scenario(name, runs[name], track) for name in track.scenarios]
        tables = [t for t in tables if t.cells]
        if not tables:
            continue
        boards.append(_track(track, tables))
        if track.name != "post-processing":
            scenarios |= {t.name: t.ranking() for t in tables}
    return Ranking(tuple(boards), tuple(scenarios[name] for name in sorted(scenarios)))


@dataclass(frozen=True, eq=False)
class _Cell:
    """The runs of one estimator on one scenario that count.

    Attributes
    ----------
    runs : Runs
        All runs of the estimator on the scenario.
    units : list
        The seed or recording of each.
    logs : (n,) array
        Logarithms of the ratios to the reference figure; infinite where a run failed.
    adjustment : float
        What the score adds to them for the seeds that are missing.
    """

    runs: Runs
    units: list[Any]
    logs: Array
    adjustment: float = 0.0

    @property
    def capped(self) -> Array:
        """The logarithms as they count in a comparison by seed."""
        return np.minimum(self.logs, _CAP)

    @property
    def adjusted(self) -> Array:
        """The logarithms as they count in the score."""
        return np.minimum(self.logs + self.adjustment, _CAP)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which runs failed."""
        return np.isinf(self.logs)


class _Scenario:
    """One scenario with its rows: those that have runs, and those that it does not suit."""

    def __init__(self, name: str, by: Mapping[str, Runs], track: Track):
        self.name, self.track = name, track
        self.recorded = track.name == RECORDED or any(_RECORDING.match(r.note) for x in by.values() for r in x.results)
        self.unsuitable = {n: why for n in sorted(by) if (why := by[n].unsuitable())}
        entries = {n: by[n] for n in sorted(by) if by[n].tried and n not in self.unsuitable}
        if track.name == "post-processing":  # whoever never smooths is not in it
            entries = {n: r for n, r in entries.items() if np.isfinite(r.scores(track.score)).any()}
        self.reference = reference_of(name, track.score, entries, self.recorded)
        ranked = [r for r in entries.values() if not r.reference] or list(entries.values())
        seeds = sorted({x.seed for r in ranked for x in r.tried})
        self._logs = {n: self._logs_of(r) for n, r in entries.items()}
        cells = {n: self._cell(r, seeds) for n, r in entries.items()}
        references = [n for n, c in cells.items() if c.runs.reference]
        added = adjustments({n: _by_unit(c) for n, c in cells.items()}, references)
        self.cells = {n: replace(c, adjustment=added[n]) for n, c in cells.items()}

    def _cell(self, runs: Runs, seeds: Sequence[int]) -> _Cell:
        there = {r.seed: r for r in runs.tried}
        logs, counted = self._logs[runs.estimator], []
        for seed in seeds if not runs.reference else sorted(there):
            if seed not in there:
                break
            counted.append(there[seed])
        units = [self.unit(r) for r in counted]
        return _Cell(runs, units, np.array([logs[r.seed] for r in counted], dtype=np.float64))

    def _logs_of(self, runs: Runs) -> dict[int, float]:
        """By seed: logarithm of the ratio to the reference figure; infinite where a run failed."""

        def log(status: str, value: float) -> float:
            if status != "ok" or not math.isfinite(value):
                return math.inf
            return max(math.log(value / self.reference.value), _LEAST) if value > 0.0 else _LEAST

        values = runs.column(self.track.score).tolist()
        return {r.seed: log(r.status, v) for r, v in zip(runs.results, values, strict=True) if r.tried}

    def unit(self, result: Result) -> Any:
        """The independent unit of a run."""
        if not self.recorded:
            return result.seed
        found = _RECORDING.match(result.note)
        return found.group(1) if found else result.note

    def implausible(self, name: str, scenarios: int = 1) -> bool:
        """Whether a row is better here than what is possible."""
        cell = self.cells[name]
        if cell.runs.reference or not self.reference.bounds:
            return False
        oracle = self.cells.get(self.reference.estimator)
        best = self._logs[self.reference.estimator] if oracle is not None else {}
        mine = self._logs[name]
        pairs = [log - best[seed] for seed, log in mine.items() if math.isfinite(log - best.get(seed, math.inf))]
        return beats(pairs, scenarios) or too_good(cell.logs[~cell.failed], self.reference, scenarios)

    def ranking(self) -> ScenarioRanking:
        """The ranking on this scenario alone."""
        shown = {n: {self.name: c} for n, c in self.cells.items() if len(c.logs)}
        standing = {n: _standing(n, [self], c, self.track.score) for n, c in shown.items()}
        rows, separation = _rows([self], shown, standing)
        found = []
        for row in rows:
            cell = self.cells[row["estimator"]]
            found.append(ScenarioRow(
                **row,
                median=_median(cell.runs.scores(self.track.score)),
                statuses=cell.runs.statuses,
                ratios={str(u): math.exp(x) for u, x in zip(*_by_unit(cell), strict=True)},
            ))  # fmt: skip
        unit = "recording" if self.recorded else "seed"
        return ScenarioRanking(
            self.name, self.track.name, self.track.score, self.reference, unit, _units(found, [self], shown),
            remarks(separation, unit, found, [self.reference]), tuple(found), self.unsuitable,
        )  # fmt: skip


_NO_SEED = "it has not run the first seed that the others have run"
_IMPLAUSIBLE = (
    "its errors on {} are below those of an oracle, which knows the noise and every fault, by more than chance"
)
_IDENTICAL = "in real time it is {}, to the bit; it is ranked by what it smooths"


def _track(track: Track, tables: Sequence[_Scenario]) -> TrackRanking:
    """The ranking over the scenarios of a track."""
    names = sorted({n for t in tables for n in (*t.cells, *t.unsuitable)})
    used = [t for t in tables if any(len(c.logs) and not c.runs.reference for c in t.cells.values())] or list(tables)
    standing: dict[str, tuple[Standing, str]] = {}
    cells: dict[str, dict[str, _Cell]] = {}
    for n in names:
        cells[n] = {t.name: t.cells[n] for t in used if n in t.cells and len(t.cells[n].logs)}
        if cells[n]:
            standing[n] = _standing(n, used, cells[n], track.score)
        elif track.name != "post-processing" and (why := _not_suited(n, used)):
            standing[n] = "unsuitable", why
        elif any(n in t.cells for t in used):
            standing[n] = "incomplete", _NO_SEED
    shown = {n: c for n, c in cells.items() if c}
    rows, separation = _rows(used, shown, standing)
    found = []
    for row in rows:
        mine = shown[row["estimator"]]
        found.append(TrackRow(
            **row,
            covered=len(mine),
            scenarios=len(used),
            ratios={s: math.exp(float(c.adjusted.mean())) for s, c in mine.items()},
        ))  # fmt: skip
    for n, (kind, why) in standing.items():
        if n not in shown:
            found.append(TrackRow(estimator=n, standing=kind, why=why, score=math.nan, scenarios=len(used)))
    unit = "recording" if any(t.recorded for t in used) else "seed"
    references = [t.reference for t in used]
    relative = any(r.estimator for r in references)
    return TrackRanking(
        track.name, track.title, track.score, relative, unit, _units(found, used, shown),
        tuple(t.name for t in used), (*remarks(separation, unit, found, references), *reference_remarks(references)),
        tuple(found),
    )  # fmt: skip


def _standing(name: str, tables: Sequence[_Scenario], cells: Mapping[str, _Cell], score: str) -> tuple[Standing, str]:
    """Whether a row that has runs (by scenario: ``cells``) is ranked over some scenarios, and if not, why."""
    if any(c.runs.reference for c in cells.values()):
        return "reference", ""
    if why := _not_suited(name, tables):
        return "unsuitable", why
    if missing := [t.name for t in tables if t.name not in cells]:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        return "incomplete", f"it has not run {missing[0]}{more}"
    if bad := [t.name for t in tables if t.implausible(name, len(tables))]:
        return "implausible", _IMPLAUSIBLE.format(bad[0])
    if twin := real_time_twin(name, score, [{m: c.runs for m, c in t.cells.items()} for t in tables]):
        return "identical", _IDENTICAL.format(twin)
    return "ranked", ""


def _not_suited(name: str, tables: Sequence[_Scenario]) -> str:
    """Which scenario does not suit a row, the first one, and why; empty where all suit it."""
    return next((f"{t.name}: {t.unsuitable[name]}" for t in tables if name in t.unsuitable), "")


def _by_unit(cell: _Cell) -> tuple[list[Any], Array]:
    """The units of a cell, each once, and the mean of what counts."""
    if len(set(cell.units)) == len(cell.units):
        return cell.units, cell.capped
    units = list(dict.fromkeys(cell.units))
    index = np.array([units.index(u) for u in cell.units])
    return units, np.bincount(index, cell.capped) / np.bincount(index)


@dataclass(frozen=True, eq=False)
class _Figures:
    """What the statistics of one row are made from: a figure a unit."""

    strata: list[str]
    clusters: list[Any]
    logs: Array
    adjusted: Array
    failed: NDArray[np.bool_]

    @property
    def keys(self) -> list[Unit]:
        return list(zip(self.strata, self.clusters, strict=True))


def _figures(tables: Sequence[_Scenario], cells: Mapping[str, _Cell]) -> _Figures:
    """Simulated: a figure a scenario and seed. Recorded: one a recording, each counting the same."""
    strata: list[str] = []
    clusters: list[Any] = []
    logs, adjusted, failed = [], [], []
    for t in tables:
        if t.name not in cells:
            continue
        cell = cells[t.name]
        units, values = _by_unit(cell)
        completed = {u for u, failed_here in zip(cell.units, cell.failed.tolist(), strict=True) if not failed_here}
        strata += ["recordings" if t.recorded else t.name] * len(units)
        clusters += [(t.name, u) if t.recorded else u for u in units]
        logs.append(values)
        adjusted.append(np.minimum(values + cell.adjustment, _CAP))
        failed += [u not in completed for u in units]
    return _Figures(strata, clusters, np.concatenate(logs), np.concatenate(adjusted), np.array(failed, dtype=bool))


def _rows(
    tables: Sequence[_Scenario], cells: Mapping[str, Mapping[str, _Cell]], standing: Mapping[str, tuple[Standing, str]]
) -> tuple[list[dict[str, Any]], Separation | None]:
    """The fields that all rows have, in the order of a table, and which ranked rows are told apart."""
    figures = {n: _figures(tables, c) for n, c in cells.items()}
    scores = {n: score(f.adjusted, f.strata, f.clusters, f.failed) for n, f in figures.items()}
    ranked = sorted((n for n in cells if standing[n][0] == "ranked"), key=lambda n: (scores[n].value, n))
    separation, places = _places(ranked, {n: figures[n] for n in ranked}, {n: scores[n].value for n in ranked})
    order: dict[str, int] = {
        "ranked": 0, "identical": 1, "implausible": 2, "incomplete": 3, "unsuitable": 4, "reference": 5,
    }  # fmt: skip
    rest = sorted((n for n in cells if n not in places), key=lambda n: (order[standing[n][0]], scores[n].value, n))
    rows = []
    for n in [*ranked, *rest]:
        f, mine = figures[n], list(cells[n].values())
        runs = sum(len(c.logs) for c in mine)
        failed = sum(int(c.failed.sum()) for c in mine)
        weights = np.concatenate([np.full(len(c.logs), 1.0 / len(c.logs)) for c in mine])
        every = np.concatenate([c.capped for c in mine])
        lost = share(failed, runs)
        units = min(len(set(f.clusters)), *(len(set(c.units)) for c in mine)) if not tables[0].recorded else len(f.logs)
        rows.append({
            "estimator": n,
            "standing": standing[n][0],
            "why": standing[n][1],
            **places.get(n, {}),
            "provisional": units < PROVISIONAL,
            "score": scores[n].value,
            "low": scores[n].low,
            "high": scores[n].high,
            "adjustment": math.exp(float(np.mean([c.adjustment for c in mine]))),
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
        })  # fmt: skip
    return rows, separation


def _places(
    ranked: Sequence[str], figures: Mapping[str, _Figures], scores: Mapping[str, float]
) -> tuple[Separation | None, dict[str, dict[str, Any]]]:
    """Ranks, tiers and what is told apart, of the rows that are ranked, which are given in order of score."""
    if not ranked:
        return None, {}
    keys = sorted({k for f in figures.values() for k in f.keys}, key=repr)
    index = {k: i for i, k in enumerate(keys)}
    values = np.full((len(keys), len(ranked)), np.nan)
    for j, n in enumerate(ranked):
        values[[index[k] for k in figures[n].keys], j] = figures[n].logs
    found = separate(values, [k[0] for k in keys], [k[1] for k in keys])
    tier = tiers(range(len(ranked)), found.better)
    places: dict[str, dict[str, Any]] = {}
    for j, n in enumerate(ranked):
        equal = next(i for i, m in enumerate(ranked) if math.isclose(scores[m], scores[n], rel_tol=1e-9))
        places[n] = {
            "rank": equal + 1,
            "rank_low": int(found.rank_low[j]),
            "rank_high": int(found.rank_high[j]),
            "tier": tier[j],
            "may_be_best": bool(found.may_be_best[j]),
            "p_value": None if j == 0 else float(found.p_values[0, j]),
            "better_than": tuple(m for i, m in enumerate(ranked) if found.better[j, i]),
            "worse_than": tuple(m for i, m in enumerate(ranked) if found.better[i, j]),
        }
    return found, places


def _units(rows: Sequence[Row], tables: Sequence[_Scenario], cells: Mapping[str, Mapping[str, _Cell]]) -> int:
    """How many seeds (recordings) the ranked rows have at least, in a scenario (over a recorded track)."""
    names = [r.estimator for r in rows if r.ranked] or [r.estimator for r in rows if r.estimator in cells]
    counts = []
    for n in names:
        each = [len(set(c.units)) for c in cells[n].values()]
        counts.append(sum(each) if tables[0].recorded else min(each))
    return min(counts, default=0)


def _consistency(runs: Sequence[Runs], part: str) -> Consistency:
    """Over all runs that went as far as having a figure."""
    nees = np.concatenate([r.numbers(f"nees_horizontal{part}") for r in runs])
    inside = np.concatenate([r.numbers(f"coverage_95{part}") for r in runs])
    return Consistency(
        badge(nees),
        float(nees.mean()) if len(nees) else math.nan,
        float(inside.mean()) if len(inside) else math.nan,
        float(inside.min()) if len(inside) else math.nan,
    )


def _median(values: Sequence[float] | Array) -> float:
    return float(np.median(values)) if len(values) else math.nan
