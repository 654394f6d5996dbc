"""The page of an estimator: what it is, where it stands, its robustness, its worst run; and the data of its runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.stored_costs import NOT_MEASURED, cost_of
from simnav.leaderboard.ranking.superseded import only_version
from simnav.leaderboard.results.stored_scores import score_matrix

from . import charts, curves
from .background import Background
from .columns import SCORES_SHOWN, Column, column_dicts
from .content import PLAIN, Fact
from .datasheets import profile_charts
from .entries import run_names
from .losses import losses
from .rounding import short, shorts
from .scenario_page import inside_chart, track_from

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Ranking, ScenarioRanking, ScenarioRow
    from simnav.leaderboard.ranking.runs import Runs
    from simnav.leaderboard.results.result import Result

    from .content import EstimatorEntry, ScenarioEntry

__all__ = ["estimator_data", "facts_of", "worst_runs"]

_COLUMNS = (
    Column("name", "Scenario", "The name leads to the page of the scenario.", "name", fixed=True),
    Column("track", "Track", "Scenarios of one track are ranked together.", "text", filter=True),
    Column("group", "Difficulty", "What makes the scenario difficult.", "text", filter=True),
    Column("ranks", "Rank", "Interval of the rank on this scenario."),
    Column("score", "× reference", "Geometric mean of the error over the reference of the scenario.", "ratio"),
    Column("interval", "95 % interval", "Interval of the score.", "interval"),
    Column("failed", "Failed", "Runs that failed count as the worst.", "text"),
)


def facts_of(label: str, ranking: Ranking) -> list[Fact]:
    """Rank and score in each track, and cost."""
    found = []
    costs = []
    multiples = {}
    for track in ranking.tracks:
        for row in track.rows:
            if row.estimator != label or not row.runs:
                continue
            costs.append(row.update_median)
            cost = cost_of(label, track.plain, track.score)
            if cost is not None:
                multiples[cost.plain] = cost
            place: str = row.standing
            if row.ranked:
                place = f"rank {row.ranks.replace('-', '–')}" if row.ranks else "not enough data for a rank"
                place += ", provisional" if row.provisional else ""
            found.append(Fact(f"{track.title}: {place}", tables.number(row.score)))
    for plain_row, cost in multiples.items():
        found.append(Fact(f"Processor time × {plain_row}", tables.interval(cost.value, cost.low, cost.high)))
    if costs and not multiples:
        found.append(Fact("Processor time", NOT_MEASURED))
    known = [c for c in costs if c > 0.0]
    if known:
        found.append(Fact("Wall clock per epoch", tables.duration(sum(known) / len(known))))
    return found


def _errors_data(label: str, ranking: Ranking, scenarios: Mapping[str, ScenarioEntry]) -> dict[str, Any]:
    """The ranked figure of every run of an estimator, of which two are compared.

    It is the ratio to the reference figure as the ranking counts it, by seed or recording.
    """
    found = {}
    for table, row in _tables(label, ranking):
        entry, names = scenarios[table.scenario], run_names(table)
        found[table.scenario] = {
            "name": entry.name,
            "page": entry.page,
            "argument": entry.argument,
            "run": [names.get(run, run) for run in row.ratios],
            "error": shorts(list(row.ratios.values()), 5),
        }
    return {"label": label, "scenarios": found}


def _tables(label: str, ranking: Ranking) -> Iterator[tuple[ScenarioRanking, ScenarioRow]]:
    for table in ranking.scenarios:
        row = next((r for r in table.rows if r.estimator == label), None)
        if row is not None:
            yield table, row


def _runs_data(label: str, ranking: Ranking, runs: Mapping[str, Mapping[str, Runs]]) -> dict[str, Any]:
    """Every run of an estimator with its scores; None stands for a column that says nothing."""
    found = {}
    for table, _ in _tables(label, ranking):
        results = runs[table.scenario][label].results
        found[table.scenario] = {
            "seed": [r.seed for r in results],
            "note": [r.note for r in results] if any(r.note for r in results) else None,
            "status": [r.ending for r in results] if any(r.ending != "ok" for r in results) else None,
            "reason": [r.why for r in results] if any(r.why for r in results) else None,
            "seconds": shorts([r.seconds for r in results], 3),
            "scores": _scores(results),
        }
    return {"label": label, "scenarios": found}


def _scores(results: Sequence[Result]) -> dict[str, list[float | None]]:
    """Columns of the scores that any of the runs has."""
    matrix = score_matrix([r.scores for r in results], [c.key for c in SCORES_SHOWN])
    found = {c.key: c.factor * matrix[:, k] for k, c in enumerate(SCORES_SHOWN)}
    return {key: shorts(values, 3) for key, values in found.items() if np.isfinite(values).any()}


def estimator_data(
    entry: EstimatorEntry,
    ranking: Ranking,
    runs: Mapping[str, Mapping[str, Runs]],
    scenarios: Mapping[str, ScenarioEntry],
    estimators: Mapping[str, EstimatorEntry],
    worst: tuple[Result, float] | None,
    single: dict[str, Any] | None,
) -> dict[str, Any]:
    """Everything that the page of an estimator shows.

    ``worst`` is one of `worst_runs`, and ``single`` what `simnav.leaderboard.site.curves.one_run` made of it.
    """
    label = entry.label
    rows = []
    shown = [
        c
        for c in SCORES_SHOWN
        if any(label in by and math.isfinite(by[label].score(c.key).value) for by in runs.values())
    ]
    for table, row in _tables(label, ranking):
        scenario, cell = scenarios[table.scenario], runs[table.scenario][label]
        rows.append(
            {
                "name": {"text": scenario.name, "page": scenario.page},
                "words": scenario.title,
                "track": table.track,
                "group": scenario.group,
                "ranks": {"text": row.ranks.replace("-", "–") or None, "sort": row.rank_low},
                "score": short(row.score),
                "interval": {"value": None, "low": short(row.low), "high": short(row.high)},
                "failed": {"text": f"{row.failed} of {row.runs}", "value": row.failed},
                **{c.key: short(c.factor * cell.score(c.key).value) for c in shown},
            }
        )
    other = None if label == PLAIN else estimators.get(PLAIN)
    version = only_version(r for by in runs.values() if label in by for r in by[label].results)
    return {
        "kind": "estimator",
        "label": label,
        "data": entry.data,
        "errors": _errors_data(label, ranking, scenarios),
        "runs": _runs_data(label, ranking, runs),
        "plain": None if other is None else {"label": PLAIN, "data": other.data, "page": other.page},
        "losses": None if label == PLAIN else losses(label, PLAIN, ranking, scenarios),
        "table": {
            "name": "main",
            "title": f"{label} by scenario",
            "columns": column_dicts((*_COLUMNS, *shown)),
            "rows": rows,
            "sort": "-score",
        },
        "charts": [c.to_dict() for c in (*_profile(label, ranking, scenarios), *profile_charts(label, version))],
        "rows": {label: {"reference": entry.reference}},
        "first": [label],
        "worst": None if worst is None or single is None else _worst_page(label, *worst, single, scenarios),
        "unsuitable": [
            {"name": scenarios[table.scenario].name, "why": table.unsuitable[label]}
            for table in ranking.scenarios
            if label in table.unsuitable
        ],
        "parameters": [
            {"name": n, "default": d, "annotation": a, "meaning": m} for n, d, a, m in entry.facts.parameters
        ],
    }


def _profile(label: str, ranking: Ranking, scenarios: Mapping[str, ScenarioEntry]) -> list[charts.Chart]:
    points = [
        (scenarios[table.scenario].group, row.estimator, short(row.score), scenarios[table.scenario].name,
         row.estimator != label)
        for table, _ in _tables(label, ranking)
        for row in table.rows
        if row.estimator in (label, PLAIN) and row.score > 0.0 and math.isfinite(row.score)
    ]  # fmt: skip
    if not points:
        return []
    points.sort(key=lambda point: (point[0], point[1] != PLAIN))
    data = {"points": charts.columns(("group", "row", "value", "scenario", "plain"), points)}
    beside = " Diamonds: the plain EKF." if label != PLAIN else ""
    caption = f"One point a scenario, by what makes it difficult; 1 is the reference figure of the scenario.{beside}"
    return [charts.ratios_by_group("profile", data, caption)]


def worst_runs(label: str, ranking: Ranking, runs: Mapping[str, Mapping[str, Runs]]) -> list[tuple[Result, float]]:
    """The runs that ended well with their errors as multiples of the reference figure, the largest first."""
    found = []
    for table, row in _tables(label, ranking):
        for result in runs[table.scenario][label].good:
            ratio = row.ratios.get(str(result.seed), math.nan)  # a run that does not count has none
            if table.unit != "seed":
                ratio = result.scores.get("horizontal_rmse", math.nan) / table.reference.value
            if math.isfinite(ratio):
                found.append((result, ratio))
    return sorted(found, key=lambda f: -f[1])


def _worst_page(
    label: str, result: Result, ratio: float, one: dict[str, Any], scenarios: Mapping[str, ScenarioEntry]
) -> dict[str, Any]:
    scenario = scenarios[result.scenario]
    made = []
    if "track" in one:
        data = {"curves": {"rows": {label: one["track"]}}, **track_from([one])}
        made.append(
            charts.track("worst-track", "Track of the worst run", data, "The line without a name is the true track.")
        )
    for key, title, unit, _ in curves.QUANTITIES:
        if key not in one or key in ("vertical", "velocity"):
            continue
        curve = {name: one[key][name] for name in ("time", "middle")}
        bound, caption = charts.NO_BOUND, "Of the worst run."
        if "bound" in one[key]:
            bound = {name: one[key][name] for name in ("time", "bound")}
            caption = "Dashed: three times the standard deviation that the estimator states."
        data = charts.timed({"rows": {label: curve}}, bound=bound)
        made.append(charts.over_time(f"worst-{key}", title, unit, data, caption, spread=False))
    for key in sorted(k for k in one if k.partition(".")[0] in ("weight", "nis")):
        if not key.endswith(".motion"):
            made.append(inside_chart(key, Background(), charts.timed({"rows": {label: one[key]}})))
    return {
        "scenario": {"name": scenario.name, "page": f"{scenario.page}#row={quote(label)}&seed={result.seed}"},
        "seed": result.seed,
        "note": result.note,
        "ratio": short(ratio),
        "error": tables.number(result.scores.get("horizontal_rmse")),
        "command": f"simnav run {scenario.argument} --seed {result.seed} -e {label} --plot run.svg",
        "charts": [c.to_dict() for c in made],
    }
