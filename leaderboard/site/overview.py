"""A track on the page of its heading: its table, its charts, and the weights of its kinds of trouble."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking.confinement import confined
from simnav.leaderboard.ranking.ranking_table import ratio, score_caption, score_title
from simnav.leaderboard.ranking.stored_costs import NOT_MEASURED, CostMultiple, cost_of, not_measured
from simnav.leaderboard.ranking.troubles import trouble_of, troubles

from .charts import COST_HEIGHT, DETECTION_HEIGHT, accuracy_and_cost, columns, detection, spread, spread_data
from .columns import Column, column_dicts
from .datasheets import COLUMN, cells
from .heatmap import heatmap
from .honesty import honesty
from .labels import shifts
from .rounding import short
from .training_columns import training_cells, training_columns

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Row, TrackRanking, TrackRow
    from simnav.leaderboard.ranking.runs import Runs
    from simnav.scoring.verdict import Verdict

    from .content import EstimatorEntry, ScenarioEntry

__all__ = ["BOARD_COLUMNS", "OVER_SCENARIOS", "bar_scale", "board_columns", "board_row", "track_data"]

_WIDEST = 100.0  # largest ratio on the scale of the bars
_INSIDE = 0.9  # share of the rows whose scores the scale must hold

_NAME = Column(
    "name",
    "Estimator",
    "The name leads to the page of the estimator. Hollow rows are references, which are told the truth and not ranked.",
    "name",
    fixed=True,
)
_BEFORE = (
    Column(
        "ranks",
        "Rank",
        "Interval of the rank. Rows that share ranks cannot be told apart. The intervals of all rows hold together "
        "with 95 % probability.",
    ),
    _NAME,
)
_AFTER = (
    Column("family", "Family", "Kind of method.", "text", filter=True),
    Column(
        "badge",
        "Consistency, faults",
        "Whether the stated covariance agrees with the errors from the first fault on; optimistic: errors are larger. "
        "The worst of horizontal, vertical, velocity and heading, as far as the results have them.",
        "badge",
        filter=True,
        hidden=True,
    ),
    Column(
        "coverage",
        "95 % coverage, faults",
        "Mean share of the epochs, from the first fault of a run on, with the truth in the stated 95 % ellipse. The "
        "line is at 95 %.",
        "share",
    ),
    Column("clean_badge", "Consistency, no fault", "The same before the first fault of a run.", "badge", hidden=True),
    Column(
        "clean_coverage", "95 % coverage, no fault", "The same before the first fault of a run.", "percent", hidden=True
    ),
    Column(
        "failed",
        "Failed",
        "Runs with an exception, an invalid output, a timeout, too much memory or divergence, and lost ones: an error "
        "beyond 100 times its stated sigma for more than a tenth of the time. They count as the worst.",
        "text",
    ),
    Column("gain", "× plain row", "Error over that of the plain row on the same runs; below 1 is better.", "ratio"),
    Column("gain_interval", "× plain row, 95 %", "Interval over the seeds.", "interval", hidden=True),
    Column(
        "gain_scenarios",
        "× plain row, 95 % over scenarios",
        "Interval over seeds and scenarios: what the gain may be on other scenarios of the same kind.",
        "interval",
        hidden=True,
    ),
    Column("won", "Scenarios won", "Scenarios with a smaller error than the plain row's.", "text", hidden=True),
    Column(
        "worse",
        "Above 1.5 ×",
        "Share of the runs with more than 1.5 times the error of the plain row.",
        "percent",
        hidden=True,
    ),
    Column(
        "far",
        "Above 10 ×",
        "Share of the runs with more than ten times the error of the oracle.",
        "percent",
        hidden=True,
    ),
    Column(
        "over_scenarios",
        "Score, 95 % over scenarios",
        "Interval of the score over seeds and scenarios.",
        "interval",
        hidden=True,
    ),
    Column("p95", "95 % of runs", "Ratio to the reference that 95 % of the runs do not exceed.", "ratio", hidden=True),
    Column("worst", "Worst run", "Largest ratio to the reference of a run.", "ratio", hidden=True),
    Column("p", "p-value", "Adjusted for all pairs of rows, against the row with the best score.", "p", hidden=True),
    Column(
        "cost",
        "Cost × plain row",
        "Processor time of the epochs over that of the plain row, measured in turns with it (simnav bench), not in the "
        "runs of the board. In post-processing the time of the smoother is included.",
    ),
    Column(
        "cost_spread",
        "Cost × plain row, 95 %",
        "Interval over the rounds in which it was measured.",
        "interval",
        wide=True,
        hidden=True,
    ),
    Column(
        "wall",
        "Wall clock per epoch",
        "Median wall-clock time of one epoch in the runs of the board. It depends on what else the machine did.",
        "duration",
        hidden=True,
    ),
    Column("memory", "Memory", "Largest memory of all runs.", "size", hidden=True),
)

#: Keys of columns that say something of several scenarios only.
OVER_SCENARIOS = ("gain_scenarios", "won", "over_scenarios")

#: Columns whose meaning does not depend on the board.
BOARD_COLUMNS = tuple(c for c in (*_BEFORE, *_AFTER) if c is not _NAME)


def bar_scale(rows: Sequence[Row]) -> tuple[float, float]:
    """Ends of the logarithmic scale on which scores are drawn.

    A few rows that are far behind do not decide the scale; they are drawn at its end.
    """
    ends = [v for r in rows for v in (r.score, r.low, r.high) if v > 0.0 and math.isfinite(v)]
    if not ends:
        return 1.0, 2.0
    low = min(ends)
    scores = sorted(r.score for r in rows if r.score > 0.0 and math.isfinite(r.score))
    most = scores[math.ceil(_INSIDE * len(scores)) - 1] if scores else low
    return low, max(min(max(ends), 1.5 * most, low * _WIDEST), low * 1.5)


def board_columns(
    title: str, explanation: str, scale: tuple[float, float], more: Sequence[Column] = ()
) -> list[dict[str, Any]]:
    """Columns of a board; ``more`` stand at the end."""
    score = (
        Column("score", title, explanation, "ratio"),
        Column("bar", "On a log scale", f"{title} with its 95 % interval on a logarithmic scale.", "bar", scale=scale),
        Column("interval", "95 % interval", "Interval of the score.", "interval", hidden=True),
    )
    return column_dicts((*_BEFORE, *score, *_AFTER, *more))


def board_row(
    row: Row,
    entry: EstimatorEntry,
    cost: CostMultiple | None,
    same: Sequence[str] = (),
    *,
    provisional: bool = False,
) -> dict[str, Any]:
    """What all boards show of a row.

    ``cost`` is what was measured of it; ``same`` are the references that have the same result; ``provisional`` says
    that all of the board is, so that a row need not say it.
    """
    notes: list[str] = [] if row.ranked else [row.standing]
    if row.ranked and row.provisional and not provisional:
        notes.append("provisional")
    if row.learned:
        notes.append("learned")
    if row.superseded:
        notes.append("older version")
    if same:
        notes.append(f"same result: {', '.join(same)}")
    return {
        "name": {"text": row.estimator, "page": entry.page, "note": ", ".join(notes)},
        "ranks": {"text": row.ranks.replace("-", "–") or None, "sort": row.rank_low},
        "best": row.may_be_best,
        "score": {"value": short(row.score), "help": row.why or row.superseded or row.learned or None},
        "bar": {"value": short(row.score), "low": short(row.low), "high": short(row.high)},
        "interval": _ends(row.low, row.high),
        "over_scenarios": _ends(row.scenarios_low, row.scenarios_high),
        **_gain(row),
        "far": short(row.far),
        "family": entry.facts.family,
        "badge": _verdict(row.faulty),
        "coverage": short(row.faulty.coverage),
        "clean_badge": _verdict(row.clean),
        "clean_coverage": short(row.clean.coverage),
        "failed": {"text": f"{row.failed} of {row.runs}", "value": row.failed} if row.runs else None,
        "p95": short(row.p95),
        "worst": short(row.worst),
        "p": short(row.p_value),
        **_cost(row.estimator, cost),
        "wall": short(row.update_median),
        "memory": row.peak_memory or None,
        "reference": row.reference,
        "mark": row.standing if not row.ranked else "",
        "words": f"{entry.facts.summary} {row.why} {row.learned}",
    }


def _ends(low: float, high: float) -> dict[str, Any]:
    return {"value": None, "low": short(low), "high": short(high)}


def _cost(label: str, cost: CostMultiple | None) -> dict[str, Any]:
    """What a board shows of the cost of a row."""
    if cost is None:
        said = {"value": None, "text": NOT_MEASURED, "sort": None, "help": not_measured([label])}
        return {"cost": said, "cost_spread": None}
    measured = f"{cost.rounds} rounds beside {cost.plain} on {cost.scenario}"
    return {
        "cost": {
            "value": short(cost.value),
            "help": f"{measured}; 95 % interval {cost.low:.3g} to {cost.high:.3g}",
        },
        "cost_spread": _ends(cost.low, cost.high),
    }


def _verdict(found: Verdict) -> str:
    """A verdict, and of what it is: ``optimistic (heading)``."""
    return "" if found.badge == "unknown" else f"{found.badge} ({found.words})"


def _gain(row: Row) -> dict[str, Any]:
    """What a board shows of the comparison with the plain row."""
    g = row.gain
    if g is None:
        return dict.fromkeys(("gain", "gain_interval", "gain_scenarios", "won", "worse"))
    return {
        "gain": short(g.value),
        "gain_interval": _ends(g.low, g.high),
        "gain_scenarios": _ends(g.scenarios_low, g.scenarios_high),
        "won": {"text": f"{g.won} of {g.scenarios}", "value": g.won},
        "worse": short(g.worse),
    }


def track_data(
    track: TrackRanking,
    estimators: Mapping[str, EstimatorEntry],
    scenarios: Mapping[str, ScenarioEntry],
    runs: Mapping[str, Mapping[str, Runs]],
) -> dict[str, Any]:
    """A track on the page of its heading.

    Parameters
    ----------
    track : TrackRanking
        Its ranking.
    estimators, scenarios : mapping
        Estimators by label, and scenarios by versioned id.
    runs : mapping
        Runs by scenario and label.
    """
    title = score_title(track).replace("error", "Error")
    explanation = score_caption(track)
    more = [
        Column(
            f"s:{s}", scenarios[s].name, f"{title} on {scenarios[s].title or scenarios[s].name}.", "ratio", hidden=True
        )
        for s in track.scenarios
    ]
    wrong = cells(track)
    more = [*training_columns(track), *([COLUMN] if wrong else []), *more]
    every = all(r.provisional for r in track.rows if r.ranked)
    rows = [
        board_row(
            row, estimators[row.estimator], cost_of(row.estimator, track.plain, track.score), others, provisional=every
        )
        | {f"s:{s}": {"value": short(v), "page": scenarios[s].page} for s, v in row.ratios.items()}
        | ({COLUMN.key: wrong.get(row.estimator)} if wrong else {})
        | training_cells(row.estimator, track, runs)
        for row, others in _once(track.rows)
    ]
    scored = [r for r in track.rows if r.ranked and math.isfinite(r.score)]
    kinds: dict[str, list[str]] = {}
    for s in track.scenarios:
        kinds.setdefault(trouble_of(s) or s, []).append(s)
    return {
        "key": track.track,
        "title": track.title,
        "best": any(r.may_be_best for r in track.rows),
        "sentence": track.sentence.replace("`", ""),
        "remarks": list(track.remarks),
        "provisional": track.provisional,
        "facts": f"{_count(len(track.scenarios), 'scenario')}, {_count(len(scored), 'ranked estimator')}, "
        f"at least {_count(track.units, track.unit)} each, confined by "
        + ", ".join(confined(r for s in track.scenarios for x in runs[s].values() for r in x.results)),
        "table": {
            "name": track.track,
            "title": f"{track.title}: ranking",
            "columns": board_columns(title, explanation, bar_scale(scored), more),
            "rows": rows,
        },
        "map": None if (drawn := heatmap(track, scored, scenarios)) is None else drawn.to_dict(),
        "charts": [c.to_dict() for c in _charts(track, scored, title, estimators, runs)],
        "scenarios": [
            {"id": s, "name": scenarios[s].name, "title": scenarios[s].title, "page": scenarios[s].page}
            for s in track.scenarios
        ],
        "kinds": [
            {"id": kind, "name": _kind(kind, scenarios), "title": ", ".join(scenarios[s].name for s in those)}
            for kind, those in kinds.items()
        ],
        "ratios": {r.estimator: _by_kind(r, kinds) for r in scored},
    }


def _kind(kind: str, scenarios: Mapping[str, ScenarioEntry]) -> str:
    """The title of a kind of trouble; the name of a scenario that has none."""
    return troubles()[kind].title if kind in troubles() else scenarios[kind].name


def _by_kind(row: TrackRow, kinds: Mapping[str, Sequence[str]]) -> dict[str, float | None]:
    """The geometric mean of the ratios in each kind of trouble that the row has run."""
    logs = {kind: [math.log(row.ratios[s]) for s in those if row.ratios.get(s, 0.0) > 0.0]
            for kind, those in kinds.items()}  # fmt: skip
    return {kind: short(math.exp(sum(x) / len(x)), 6) for kind, x in logs.items() if x}


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("s" if number != 1 else "")


def _once(rows: Sequence[TrackRow]) -> list[tuple[TrackRow, list[str]]]:
    """Each row with the references that have the same result, which are not shown again."""
    found: list[tuple[TrackRow, list[str]]] = []
    seen: dict[tuple[Any, ...], list[str]] = {}
    for row in rows:
        key = tuple(sorted((s, short(v, 6)) for s, v in row.ratios.items()))
        if row.reference and key and key in seen:
            seen[key].append(row.estimator)
            continue
        others: list[str] = []
        if row.reference and key:
            seen[key] = others
        found.append((row, others))
    return found


def _charts(
    track: TrackRanking,
    rows: Sequence[TrackRow],
    title: str,
    estimators: Mapping[str, EstimatorEntry],
    runs: Mapping[str, Mapping[str, Runs]],
) -> list[Any]:
    measured = {r.estimator: cost_of(r.estimator, track.plain, track.score) for r in rows if r.score > 0.0}
    costed = [(r, cost) for r in rows if (cost := measured.get(r.estimator)) is not None]
    made = []
    end = bar_scale(rows)[1]
    far = [(r, cost) for r, cost in costed if r.score > end]
    costed = [pair for pair in costed if pair not in far]
    if len(costed) > 1:
        costs, errors = [c.value for _, c in costed], [r.score for r, _ in costed]
        names, front = [r.estimator for r, _ in costed], _front(list(zip(costs, errors, strict=True)))
        data = {
            "rows": {
                "row": names,
                "cost": [short(c) for c in costs],
                "low": [short(c.low) for _, c in costed],
                "high": [short(c.high) for _, c in costed],
                "error": [short(e) for e in errors],
                "family": [estimators[name].facts.family for name in names],
                "front": front,
                **shifts(names, costs, errors, front, COST_HEIGHT),
            }
        }
        plain_name = " or ".join(dict.fromkeys(c.plain for _, c in costed))
        beyond = ", ".join(f"{r.estimator} ({ratio(r.score)})" for r, _ in far)
        unknown = not_measured(name for name, cost in measured.items() if cost is None)
        missing = " ".join(filter(None, [f"Above the chart: {beyond}." if far else "", unknown]))
        made.append(accuracy_and_cost(f"{track.track}-cost", f"Score ({title})", plain_name, data, missing))
    honest = honesty(track, title, end, _front)
    made += [] if honest is None else [honest]
    nees = _medians_by_scenario(track, rows, runs, "nees_horizontal")
    if nees["middles"]["row"]:
        made.append(
            spread(
                f"{track.track}-nees",
                "Consistency",
                "NEES by degree of freedom",
                nees,
                "Ticks: median of a scenario. Point and line: median and range over the scenarios. In the band the "
                "covariance agrees with the errors; to the right the estimator is optimistic.",
                ideal=(0.7, 1.5),
            )
        )
    found = _detection(track, rows, runs)
    if len(found["row"]) > 1:
        made.append(detection(f"{track.track}-detection", {"rows": found}))
    return made


def _front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Whether no other point is at least as good in both and better in one.

    >>> _front([(1.0, 2.0), (2.0, 1.0), (2.0, 3.0)])
    [True, True, False]
    """
    return [not any(c <= x and e <= y and (c, e) != (x, y) for c, e in points) for x, y in points]


def _medians_by_scenario(
    track: TrackRanking, rows: Sequence[TrackRow], runs: Mapping[str, Mapping[str, Runs]], name: str
) -> dict[str, dict[str, list[Any]]]:
    """Medians of a score by scenario, as ticks, and over the scenarios."""
    ticks = []
    middles = []
    for row in rows:
        cells = ((s, runs[s][row.estimator]) for s in track.scenarios if row.estimator in runs[s])
        found = [(s, v) for s, cell in cells if (v := cell.score(name).value) > 0.0 and math.isfinite(v)]
        ticks += [(row.estimator, short(value), s) for s, value in found]
        if found:
            values = sorted(value for _, value in found)
            middles.append((row.estimator, *(short(values[k]) for k in (len(values) // 2, 0, -1))))
    return spread_data(ticks, middles)


def _detection(
    track: TrackRanking, rows: Sequence[TrackRow], runs: Mapping[str, Mapping[str, Runs]]
) -> dict[str, list[Any]]:
    """Detection and false-alarm rates of each row, in percent: means of the medians of the scenarios."""
    found: list[tuple[str, Any, Any]] = []
    for row in rows:
        cells = [runs[s][row.estimator] for s in track.scenarios if row.estimator in runs[s]]
        pairs = [(c.score("detection_rate").value, c.score("false_alarm_rate").value) for c in cells]
        pairs = [pair for pair in pairs if all(map(math.isfinite, pair))]
        if pairs:
            right, false = (100.0 * sum(values) / len(pairs) for values in zip(*pairs, strict=True))
            found.append((row.estimator, short(right), short(false)))
    front = _front([(false, -right) for _, right, false in found])
    names, right, false = [n for n, *_ in found], [r or 0.0 for _, r, _ in found], [f or 0.0 for *_, f in found]
    places = shifts(names, false, right, front, DETECTION_HEIGHT, log=(False, False))
    return {**columns(("row", "found", "false"), found), "front": front, **places}
