"""The page of a scenario: what happens, its instruments, the board, charts over all runs, and single runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.evidence import notes_by_seed
from simnav.leaderboard.ranking.stored_costs import cost_of
from simnav.leaderboard.results.result import Result
from simnav.scoring.integrity import ALERT_LIMITS
from simnav.scoring.plot_series import DIAGNOSTICS

from . import charts, curves
from .background import Background, faulty_points, fix_points, truth_of
from .charts import NO_BOUND, NO_FAULTS, Chart, spread_data, timed
from .columns import SCORES_SHOWN
from .content import PLAIN
from .curves import Curves, Gathered
from .latency import latency_chart
from .overview import OVER_SCENARIOS, bar_scale, board_columns, board_row
from .rounding import short
from .sky_charts import sky_charts
from .sweeps import SweepFile

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import ScenarioRanking
    from simnav.leaderboard.ranking.runs import Runs

    from .content import EstimatorEntry, ScenarioEntry

__all__ = ["RUNS_SHOWN", "ScenarioData", "inside_chart", "scenario_data", "seeds_to_show", "shown_first", "track_from"]

#: Runs of a scenario of which track and errors are kept, by default.
RUNS_SHOWN = 1

_FIRST = 6  # rows that a chart shows at first
_BAND = 5  # runs from which on a band is drawn
_TICKS = 20  # runs of a row that a chart marks


@dataclass(frozen=True)
class ScenarioData:
    """Data of the page of one scenario.

    Attributes
    ----------
    page : dict
        Data of the page.
    charts : tuple of Chart
        Charts with their data, for print.
    first : tuple of str
        Rows that charts show at first.
    """

    page: dict[str, Any]
    charts: tuple[Chart, ...]
    first: tuple[str, ...]


def shown_first(ranking: ScenarioRanking, drawn: Sequence[str]) -> list[str]:
    """Rows that charts show at first: the best, and the plain EKF, which everybody knows; of equal rows one.

    Parameters
    ----------
    ranking : ScenarioRanking
        Ranking of the scenario.
    drawn : sequence of str
        The rows of which curves are kept, in order of rank.
    """
    again: set[str] = set()
    for names in same_results(ranking):
        again.update([name for name in names if name in drawn][1:])
    references = {r.estimator for r in ranking.rows if r.reference}
    ranked = [name for name in drawn if name not in references | again]
    best = ranked[:_FIRST]
    if PLAIN in ranked and PLAIN not in best:
        best[-1] = PLAIN
    return best or list(drawn)[:_FIRST]


def same_results(ranking: ScenarioRanking) -> list[list[str]]:
    """Groups of rows that have the same error in every run, in order of rank."""
    found: dict[tuple[Any, ...], list[str]] = {}
    for row in ranking.rows:
        key = tuple((run, short(value, 6)) for run, value in row.ratios.items())
        if key and math.isfinite(row.score) and row.failed < row.runs:
            found.setdefault(key, []).append(row.estimator)
    return [names for names in found.values() if len(names) > 1]


def scenario_data(
    entry: ScenarioEntry,
    ranking: ScenarioRanking,
    runs: Mapping[str, Runs],
    estimators: Mapping[str, EstimatorEntry],
    seeds: Sequence[int],
    around: Background,
    gathered: Gathered,
    sweeps: Sequence[SweepFile] = (),
) -> ScenarioData:
    """Everything that the page of a scenario shows.

    Parameters
    ----------
    entry, ranking, runs, estimators
        Facts and ranking of the scenario; runs and facts of its rows, by label.
    seeds : sequence of int
        Seeds of the runs that are shown one by one.
    around : Background
        Background of the scenario.
    gathered : Gathered
        Gathered series: curves of the runs for the bands, and the single runs.
    sweeps : sequence of SweepFile
        Over dials of the scenario.
    """
    rows = [r.estimator for r in ranking.rows]
    by = {n: [gathered.curves[r] for r in runs[n].good if r in gathered.curves] for n in rows}
    drawn = [n for n in rows if by[n]]
    over_time = [n for n in drawn if any(len(c.time) for c in by[n])]
    first = shown_first(ranking, over_time or drawn or rows)
    made, inside = _over_all_runs(entry, ranking, runs, by, around)
    kinds: dict[str, None] = {}
    alone = {}
    for seed in seeds:
        single = {
            n: curves.one_run(gathered.single[r])
            for n in rows
            for r in runs[n].results
            if r.seed == seed and r in gathered.single
        }
        for one in single.values():
            kinds |= dict.fromkeys(k for k in one if k.partition(".")[0] in DIAGNOSTICS)
        alone[seed] = _one_run(seed, runs, rows, single, around) | {"inside": _inside(single, around, str(seed))}
    page = {
        "kind": "scenario",
        "scenario": {"id": entry.id, "argument": entry.argument},
        "rows": {
            n: {"reference": estimators[n].reference, "page": estimators[n].page, "data": estimators[n].data}
            for n in rows
        },
        "drawn": drawn,
        "timed": len(over_time),
        "first": first,
        "table": _table(ranking, runs, estimators),
        "failures": _failures(ranking, runs),
        "charts": [c.to_dict() for c in made],
        "inside": [c.to_dict() for c in inside],
        "runs": {
            "seeds": list(seeds),
            "all": list(entry.seeds),
            "charts": [c.to_dict() for c in _run_charts(around)],
            "inside": [inside_chart(k, around).to_dict() for k in sorted(kinds, key=_by_instrument)],
            "data": alone,
        },
        "sweeps": [sweep.section(k) for k, sweep in enumerate(sweeps)],
        "instruments": around.instruments,
        "unsuitable": [{"name": n, "why": why} for n, why in ranking.unsuitable.items()],
        "remarks": [*ranking.remarks, *(_same(names) for names in same_results(ranking))],
        "reference": ranking.reference.text,
        "provisional": ranking.provisional,
    }
    return ScenarioData(page, (*made, *inside), tuple(first))


def _same(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]} gave the same errors in every run."


def seeds_to_show(ranking: ScenarioRanking, runs: Mapping[str, Runs], seeds: Sequence[int], count: int) -> list[int]:
    """The first seed, then those on which the rows that are shown at first did worst."""
    worst: dict[int, float] = {}
    for n in shown_first(ranking, [r.estimator for r in ranking.rows]):
        for r in runs[n].results:
            value = r.scores.get("horizontal_rmse", math.nan)
            if value > 0.0 and math.isfinite(value):
                worst[r.seed] = max(worst.get(r.seed, -math.inf), math.log(value))
    rest = sorted(seeds[1:], key=lambda s: (-worst.get(s, -math.inf), s))
    return sorted([*seeds[:1], *rest[: max(count - 1, 0)]])


# -- tables ----------------------------------------------------------------------------------------------


def _table(
    ranking: ScenarioRanking, runs: Mapping[str, Runs], estimators: Mapping[str, EstimatorEntry]
) -> dict[str, Any]:
    by = ranking.reference
    title = ("× oracle" if by.bounds and by.paired else "× reference") if by.estimator else "Error [m]"
    scored = [r for r in ranking.rows if r.ranked and math.isfinite(r.score)]
    shown = [
        c
        for c in SCORES_SHOWN
        if c.key != "update_median" and any(math.isfinite(runs[r.estimator].score(c.key).value) for r in ranking.rows)
    ]
    best = {
        c.key: min((v for r in scored if not math.isnan(v := runs[r.estimator].score(c.key).value)), default=math.nan)
        for c in shown
    }
    same = {n: [m for m in names if m != n] for names in same_results(ranking) for n in names}
    rows = []
    for row in ranking.rows:
        cost = cost_of(row.estimator, ranking.plain, ranking.score)
        others = same.get(row.estimator, ())
        item = board_row(row, estimators[row.estimator], cost, others, provisional=ranking.provisional)
        for column in shown:
            found = runs[row.estimator].score(column.key)
            item[column.key] = {
                "value": short(column.factor * found.value),
                "best": column.kind == "number"
                and column.key != "nees_horizontal"
                and row.ranked
                and found.value == best[column.key],
                "help": f"95 % interval of the median: {tables.number(column.factor * found.low)} to "
                f"{tables.number(column.factor * found.high)}"
                if math.isfinite(found.low)
                else None,
            }
        rows.append(item)
    explanation = f"Geometric mean over the runs of the error, divided by {by.text}."
    columns = board_columns(title, explanation, bar_scale(scored), shown)
    return {
        "name": "main",
        "title": f"{ranking.scenario}: ranking",
        "columns": [c for c in columns if c["key"] not in OVER_SCENARIOS],
        "rows": rows,
    }


def _failures(ranking: ScenarioRanking, runs: Mapping[str, Runs]) -> list[dict[str, Any]]:
    """How runs ended, but for those that ended well: each status and reason of a first run once, with its rows."""
    found: dict[tuple[str, str], dict[str, int]] = {}
    for row in ranking.rows:
        for status, count in row.statuses.items():
            if status != "ok":
                reason = next(r.why for r in runs[row.estimator].tried if r.ending == status)
                if status == "inconsistent":
                    reason = "it reports for most of the time that its measurements contradict it; its error counts"
                found.setdefault((status, reason), {})[row.estimator] = count
    return [
        {
            "names": ", ".join(f"{name} ({count})" for name, count in rows.items()),
            "status": status,
            "runs": sum(rows.values()),
            "reason": reason,
        }
        for (status, reason), rows in found.items()
    ]


# -- charts over all runs ----------------------------------------------------------------------------------


def _over_all_runs(
    entry: ScenarioEntry,
    ranking: ScenarioRanking,
    runs: Mapping[str, Runs],
    by: Mapping[str, Sequence[Curves]],
    around: Background,
) -> tuple[list[Chart], list[Chart]]:
    """Charts of errors, and charts of weights."""
    time = curves.axis(c for found in by.values() for c in found)
    first = next(iter(around.runs), "0")
    faults = around.runs[first]["faults"] if around.runs else NO_FAULTS
    made = []
    if around.happening["name"]:
        ends = [t for t in around.happening["end"] if t is not None]
        duration = max([entry.duration, float(time[-1]) if len(time) else 0.0, *ends])
        made.append(charts.timeline("timeline", {"events": around.happening}, f"Of seed {first}.", duration))
    made += sky_charts(around.sky, first)
    timed_runs = [count for c in by.values() if (count := sum(bool(len(x.time)) for x in c))]
    drawn, wide = _counted(timed_runs, len(entry.seeds)), max(timed_runs, default=0) >= _BAND
    band = (
        ", and, of the first three rows, the band from the 5th to the 95th percentile"
        if wide
        else ", too few for a band"
    )
    words = f"Median over {drawn}{band}."
    if faults["start"]:
        words += f" Shaded: faults of seed {first}."
    for key, title, unit, factor in curves.QUANTITIES:
        found = {n: b for n, c in by.items() if (b := curves.band(c, key, factor, time)) is not None}
        if not found:
            continue
        bound = around.bound if key == "horizontal" else NO_BOUND
        caption = words + (
            " Dashed: the posterior Cramer-Rao bound on the RMS error, faults known." if bound["time"] else ""
        )
        data = timed(_over(time, found), faults, bound)
        made.append(charts.over_time(key, title, unit, data, caption, spread=wide))
    spreads = (
        ("horizontal_rmse", "rmse", "Horizontal RMSE of every run", "Horizontal RMSE [m]", ()),
        ("nees_horizontal", "nees", "Consistency of every run", "NEES by degree of freedom [-]", (0.7, 1.5)),
    )
    made += [c for words in spreads if (c := _spread(ranking, runs, *words))]
    if (late := latency_chart([row.estimator for row in ranking.rows], runs)) is not None:
        made.append(late)
    cdf = {n: q for n, c in by.items() if (q := curves.quantiles(c)) is not None}
    if cdf:
        counted = _counted([len(c) for c in by.values() if c], len(entry.seeds))
        caption = f"Over all epochs of {counted}."
        made.append(charts.distribution("cdf", "Horizontal error", "m", {"curves": curves.over_shares(cdf)}, caption))
    limit = ALERT_LIMITS[0]
    cells = {n: q for n, c in by.items() if (q := curves.integrity(c, limit)) is not None}
    if cells:
        made.append(charts.stanford("stanford", {"curves": {"rows": cells}}, limit, f"Epochs of {drawn}."))
    inside = []
    for name in sorted({n for found in by.values() for c in found for n in c.diagnostics if n != "time"}):
        axis = max((c.diagnostics["time"] for found in by.values() for c in found if name in c.diagnostics), key=len)
        bands = {n: b for n, c in by.items() if (b := curves.band(c, name, 1.0, axis.astype(float))) is not None}
        instrument = name.partition(".")[2]
        inside.append(
            charts.over_time(
                f"weight-{instrument}", f"Weight of {instrument}", "-", timed(_over(axis, bands), faults),
                f"{_MEANING['weight']} {words}", log=False, spread=wide,
            )
        )  # fmt: skip
    return made, inside


def _counted(runs: Sequence[int], seeds: int) -> str:
    """How many runs the curves of a scenario are made of, from those of each row, and from all its seeds."""
    least, most = min(runs, default=0), max(runs, default=0)
    if most < 2:
        return "one run"
    first = "the first " if seeds > curves.BAND_RUNS else ""
    count = f"{least} to {most} runs a row" if least < most else f"{most} runs"
    return f"{first}{count} that ended well"


def _over(time: Any, rows: Mapping[str, Any]) -> dict[str, Any]:
    """Curves by row over a common time."""
    return {"axis": [short(t) for t in time], "name": "time", "rows": rows}


_MEANING = {
    "weight": "1: the measurement counts in full. 0: it is rejected.",
    "residual": "What remains between measurement and estimate after the adjustment, by its standard deviation.",
    "innovation": "Length of the difference between the measurement and what was predicted.",
    "nis": "Innovation squared, by its covariance; its mean is the number of components where the model is right.",
}
_TITLES = {
    "weight": "Weight",
    "residual": "Residual",
    "innovation": "Innovation",
    "nis": "Normalised innovation squared",
}


def _by_instrument(name: str) -> tuple[bool, str, int]:
    kind, _, instrument = name.partition(".")
    return instrument == "motion", instrument, DIAGNOSTICS.index(kind)


def inside_chart(name: str, around: Background, data: Mapping[str, Any] | None = None) -> Chart:
    """The chart of a diagnostic of one instrument, as ``weight.gnss``, in one run."""
    kind, _, instrument = name.partition(".")
    unit = around.units.get(instrument, ["SI"])[0] if kind == "innovation" else "sigma" if kind == "residual" else "-"
    title = f"{_TITLES[kind]} of {'the motion model' if instrument == 'motion' else instrument}"
    return charts.over_time(
        f"run-{kind}-{instrument}", title, unit, data or {}, _MEANING[kind], spread=False, log=kind != "weight"
    )


def _spread(
    ranking: ScenarioRanking,
    runs: Mapping[str, Runs],
    score: str,
    name: str,
    title: str,
    axis: str,
    ideal: Sequence[float] = (),
) -> Chart | None:
    ticks: list[tuple[Any, ...]] = []
    middles: list[tuple[Any, ...]] = []
    for row in ranking.rows:
        cell = runs[row.estimator]
        found = cell.score(score)
        if not found.value > 0.0:
            continue
        values = zip(cell.scores(score).tolist(), cell.good, strict=True)
        marked = _marked([(v, r) for v, r in values if v > 0.0])
        ticks += [(row.estimator, short(value, 3), _run_name(result)) for value, result in marked]
        low, high = (found.low, found.high) if math.isfinite(found.low) else (found.value, found.value)
        middles.append((row.estimator, short(found.value), short(max(low, 1e-9)), short(high)))
    if not middles:
        return None
    most = max(len(runs[row.estimator].good) for row in ranking.rows)
    some = f", at most {_TICKS} of a row from the smallest to the largest value" if most > _TICKS else ""
    line = any(low < high for *_, low, high in middles)
    middle = "Point and line: the median with its 95 % interval." if line else "Point: the median."
    caption = f"Ticks: runs that ended well{some}. {middle}"
    if ideal:
        caption += " In the band the covariance agrees with the errors; to the right the estimator is optimistic."
    return charts.spread(name, title, axis, spread_data(ticks, middles), caption, ideal=ideal)


def _marked(runs: list[tuple[float, Result]]) -> list[tuple[float, Result]]:
    """Runs in order of their value: all, or as many as a chart can show, at even steps of the rank."""
    runs.sort(key=lambda run: run[0])
    count = len(runs)
    return runs if count <= _TICKS else [runs[k * (count - 1) // (_TICKS - 1)] for k in range(_TICKS)]


def _run_name(result: Result) -> str:
    return f"seed {result.seed}" + (f", {result.note}" if result.note else "")


# -- single runs -------------------------------------------------------------------------------------------


def _run_charts(around: Background) -> list[Chart]:
    """Charts of one run, without data: they are read when a run is chosen.

    Their captions name faults and fixes only where a recording of the runs has them.
    """
    faulty = any(run["faults"]["start"] for run in around.runs.values())
    words = "With a circle at its start and a square at its end: the true track."
    if faulty:
        words += " Wide: where faults act."
    if any(run["track"]["fixes"]["name"] for run in around.runs.values()):
        words += " Grey: fixes."
    made = [charts.track("track", "Track", {}, words)]
    words = "Of this run. Shaded: faults." if faulty else "Of this run."
    for key, title, unit, _ in curves.QUANTITIES:
        more = " Dashed: three standard deviations that the chosen estimator states." if key == "horizontal" else ""
        made.append(charts.over_time(f"run-{key}", title, unit, {}, words + more, spread=False))
    return made


def _one_run(
    seed: int, runs: Mapping[str, Runs], rows: Sequence[str], single: Mapping[str, dict[str, Any]], around: Background
) -> dict[str, Any]:
    """Data of the charts of one run, by the name of the chart."""
    known = around.runs.get(str(seed), {})
    faults = known.get("faults", NO_FAULTS)
    data: dict[str, Any] = {}
    for key, *_ in curves.QUANTITIES:
        found = {n: {"time": one[key]["time"], "middle": one[key]["middle"]} for n, one in single.items() if key in one}
        data[f"run-{key}"] = timed({"rows": found}, faults)
        if key == "horizontal":  # the page shows that of the estimator that is chosen
            bounds = {n: one[key] for n, one in single.items() if "bound" in one.get(key, ())}
            data[f"run-{key}"]["bounds"] = {n: {k: o[k] for k in ("time", "bound")} for n, o in bounds.items()}
    track = {n: one["track"] for n, one in single.items() if "track" in one}
    data["track"] = {"curves": {"rows": track}, **(known.get("track") or track_from(single.values()))}
    mine = [r for n in rows for r in runs[n].results if r.seed == seed]
    drawn = next((r.draws for r in mine if r.draws), {})
    return {
        "seed": seed,
        "note": notes_by_seed([r for r in mine if r.status != "no-recording"]).get(seed, ""),  # as most rows have it
        "draws": [[key, tables.number(v) if isinstance(v, (int, float)) else str(v)] for key, v in drawn.items()],
        "charts": data,
    }


def _inside(single: Mapping[str, dict[str, Any]], around: Background, seed: str) -> dict[str, Any]:
    """Data of the charts of innovations, residuals and weights of one run, by the name of the chart."""
    faults = around.runs.get(seed, {}).get("faults", NO_FAULTS)
    found: dict[str, Any] = {}
    for n, one in single.items():
        for name, values in one.items():
            kind, _, instrument = name.partition(".")
            if kind not in DIAGNOSTICS:
                continue
            factor = around.units.get(instrument, ["", 1.0])[1] if kind == "innovation" else 1.0
            data = found.setdefault(f"run-{kind}-{instrument}", timed({"rows": {}}, faults))
            middle = [short(factor * v) for v in values["middle"]] if factor != 1.0 else values["middle"]
            data["curves"]["rows"][n] = {"time": values["time"], "middle": middle}
    return found


def track_from(single: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Truth and frame of a track from the series of a run, where there is no recording."""
    truth: Sequence[Any] = next((one["truth"] for one in single if "truth" in one), ([], [], []))
    return {"faulty": faulty_points(()), "fixes": fix_points(()), **truth_of(*truth)}
