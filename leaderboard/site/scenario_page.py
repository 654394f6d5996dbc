"""The page of a scenario: what happens, its instruments, the board, charts over all runs, and single runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simnav.leaderboard.figures.run_figure import fixes, true_track
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.result import Result
from simnav.leaderboard.site import charts, curves
from simnav.leaderboard.site.charts import Chart, short
from simnav.leaderboard.site.columns import SCORES_SHOWN
from simnav.leaderboard.site.facts import catalogued, datasheets, events
from simnav.leaderboard.site.overview import bar_scale, board_columns, board_row

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import ScenarioRanking
    from simnav.leaderboard.ranking.runs import Runs
    from simnav.leaderboard.site.content import EstimatorEntry, ScenarioEntry
    from simnav.recording import Recording

__all__ = ["BOUND_RUNS", "RUNS_SHOWN", "ScenarioData", "chart_of", "scenario_data", "shown_first"]

#: Runs of a scenario of which track and errors are kept, by default.
RUNS_SHOWN = 2
#: Seeds over which the bound is averaged.
BOUND_RUNS = 2

_FIRST = 6  # rows that a chart shows at first
_PLAIN = "ekf"


@dataclass(frozen=True)
class ScenarioData:
    """What is written for a scenario.

    Attributes
    ----------
    page : dict
        Embedded in the page.
    files : dict
        Name -> content of ``data/NAME.js``.
    charts : tuple of Chart
        With their data, for print.
    first : tuple of str
        Rows that charts show at first.
    """

    page: dict[str, Any]
    files: dict[str, Any]
    charts: tuple[Chart, ...]
    first: tuple[str, ...]


def shown_first(ranking: ScenarioRanking) -> list[str]:
    """Rows that charts show at first: the best, and the plain EKF, which everybody knows."""
    ranked = [r.estimator for r in ranking.rows if not r.reference]
    best = ranked[:_FIRST]
    if _PLAIN in ranked and _PLAIN not in best:
        best[-1] = _PLAIN
    return best or [r.estimator for r in ranking.rows][:_FIRST]


def scenario_data(
    entry: ScenarioEntry,
    ranking: ScenarioRanking,
    runs: Mapping[str, Runs],
    estimators: Mapping[str, EstimatorEntry],
    runs_shown: int = RUNS_SHOWN,
) -> ScenarioData:
    """Everything that the page of a scenario shows."""
    rows = [r.estimator for r in ranking.rows]
    first = shown_first(ranking)
    seeds = _seeds_to_show(runs, first, entry.seeds, runs_shown)
    recordings = {seed: found for seed in seeds if (found := _recording(entry.id, seed)) is not None}
    recording = next(iter(recordings.values()), None)
    made, files = _over_all_runs(entry, ranking, runs, rows, recording)
    for seed in seeds:
        files[f"{entry.data}-run-{seed}"] = _one_run(seed, runs, rows, recordings.get(seed))
    page = {
        "kind": "scenario",
        "scenario": {"id": entry.id, "argument": entry.argument, "data": entry.data},
        "rows": {
            n: {"reference": estimators[n].reference, "page": estimators[n].page, "data": estimators[n].data}
            for n in rows
        },
        "first": first,
        "table": _table(ranking, runs, estimators),
        "failures": _failures(ranking, runs),
        "charts": [
            c.to_dict() | {"data": None, "file": f"{entry.data}-{c.name}"} if c.byrow else c.to_dict() for c in made
        ],
        "runs": {"seeds": seeds, "all": list(entry.seeds), "charts": [c.to_dict() for c in _run_charts()]},
        "instruments": [] if recording is None else datasheets(catalogued(entry.id), recording),
        "unsuitable": [{"name": n, "why": why} for n, why in ranking.unsuitable.items()],
        "remarks": list(ranking.remarks),
        "reference": ranking.reference.text,
        "provisional": ranking.provisional,
    }
    return ScenarioData(page, files, tuple(made), tuple(first))


def _recording(identity: str, seed: int) -> Recording | None:
    """The run, made again; None where that is not possible any more."""
    from simnav.source import record

    scenario = catalogued(identity)
    try:
        return None if scenario is None else record(scenario, seed)
    except (ValueError, OSError):
        return None


def _seeds_to_show(runs: Mapping[str, Runs], first: Sequence[str], seeds: Sequence[int], count: int) -> list[int]:
    """The first seed, then those on which the rows that are shown at first did worst."""

    def badness(seed: int) -> float:
        values = [r.scores.get("horizontal_rmse", math.nan) for n in first for r in runs[n].results if r.seed == seed]
        found = [math.log(v) for v in values if v > 0.0 and math.isfinite(v)]
        return max(found, default=-math.inf)

    rest = sorted(seeds[1:], key=lambda s: (-badness(s), s))
    return sorted([*seeds[:1], *rest[: max(count - 1, 0)]])


# -- tables ----------------------------------------------------------------------------------------------


def _table(
    ranking: ScenarioRanking, runs: Mapping[str, Runs], estimators: Mapping[str, EstimatorEntry]
) -> dict[str, Any]:
    relative = bool(ranking.reference.estimator)
    title = "× reference" if relative else "Error [m]"
    scored = [r for r in ranking.rows if r.ranked and math.isfinite(r.score)]
    shown = [
        (c, f)
        for c, f in SCORES_SHOWN
        if c.key != "update_median" and any(math.isfinite(runs[r.estimator].score(c.key).value) for r in ranking.rows)
    ]
    best = {
        c.key: min((v for r in scored if not math.isnan(v := runs[r.estimator].score(c.key).value)), default=math.nan)
        for c, _ in shown
    }
    rows = []
    for row in ranking.rows:
        item = board_row(row, estimators[row.estimator], provisional=ranking.provisional)
        for column, factor in shown:
            found = runs[row.estimator].score(column.key)
            item[column.key] = {
                "value": short(factor * found.value),
                "best": column.kind == "number"
                and column.key != "nees_horizontal"
                and row.ranked
                and found.value == best[column.key],
                "help": f"95 % interval of the median: {short(factor * found.low)} to {short(factor * found.high)}"
                if math.isfinite(found.low)
                else None,
            }
        rows.append(item)
    explanation = f"Geometric mean over the runs of the error, divided by {ranking.reference.text}."
    more = [c for c, _ in shown]
    return {
        "name": "main",
        "title": f"{ranking.scenario}: ranking",
        "columns": board_columns(title, explanation, bar_scale(scored), more),
        "rows": rows,
    }


def _failures(ranking: ScenarioRanking, runs: Mapping[str, Runs]) -> list[dict[str, Any]]:
    """How many runs of each row ended how, but for those that ended well, and why the first did."""
    found = []
    for row in ranking.rows:
        for status, count in row.statuses.items():
            if status != "ok":
                results = [r for r in runs[row.estimator].results if r.ending == status]
                reason = results[0].reason if results else ""
                if status == "inconsistent":
                    reason = "it reports for most of the time that its measurements contradict it; its error counts"
                found.append({"name": row.estimator, "status": status, "runs": count, "reason": reason})
    return found


# -- charts over all runs ----------------------------------------------------------------------------------


def _over_all_runs(
    entry: ScenarioEntry,
    ranking: ScenarioRanking,
    runs: Mapping[str, Runs],
    rows: Sequence[str],
    recording: Recording | None,
) -> tuple[list[Chart], dict[str, Any]]:
    every = [r for n in rows for r in runs[n].results]
    time = curves.axis(every)
    happening = (
        {key: [] for key in ("group", "name", "start", "end", "words")}
        if recording is None
        else events(catalogued(entry.id), recording)
    )
    faults = _faults(happening)
    limit = _bound(entry)
    made = []
    if happening["name"]:
        made.append(
            charts.timeline("timeline", {"events": happening}, f"Of seed {recording.seed if recording else 0}.")
        )
    seeds = f"{len(entry.seeds)} seeds" if len(entry.seeds) > 1 else "one seed"
    for key, title, unit, factor in curves.QUANTITIES:
        found = {n: b for n in rows if (b := curves.band(runs[n].results, key, factor, time)) is not None}
        if not found:
            continue
        bound = limit if key == "horizontal" else {"time": [], "bound": []}
        data = {
            "curves": {"axis": [short(t) for t in time], "name": "time", "rows": found},
            "faults": faults,
            "bound": bound,
        }
        caption = (
            f"Median over {seeds}, and the band from the 5th to the 95th percentile. "
            "Shaded: faults of the first run that is shown below."
        )
        if bound["time"]:
            caption += " Dashed: the posterior Cramer-Rao bound on the RMS error, faults known."
        made.append(charts.over_time(key, title, unit, data, caption))
    cdf = {n: q for n in rows if (q := curves.quantiles(runs[n].good)) is not None}
    if cdf:
        made.append(
            charts.distribution(
                "cdf",
                "Horizontal error",
                "m",
                {"curves": {"rows": cdf}},
                "Over all epochs of all runs that ended well.",
            )
        )
    made += [
        c
        for c in (
            _spread(ranking, runs, "horizontal_rmse", "rmse", "Horizontal RMSE of every run", "Horizontal RMSE [m]"),
            _spread(
                ranking,
                runs,
                "nees_horizontal",
                "nees",
                "Consistency of every run",
                "NEES by degree of freedom",
                (0.7, 1.5),
            ),
        )
        if c
    ]
    files = {f"{entry.data}-{c.name}": dict(c.data) for c in made if c.byrow}
    return made, files


def _spread(
    ranking: ScenarioRanking,
    runs: Mapping[str, Runs],
    score: str,
    name: str,
    title: str,
    axis: str,
    ideal: Sequence[float] = (),
) -> Chart | None:
    ticks: dict[str, list[Any]] = {"row": [], "value": [], "run": []}
    middles: dict[str, list[Any]] = {"row": [], "value": [], "low": [], "high": []}
    for row in ranking.rows:
        cell = runs[row.estimator]
        found = cell.score(score)
        if not found.value > 0.0:
            continue
        for result in cell.good:
            value = result.scores.get(score, math.nan)
            if value > 0.0:
                for key, x in (("row", row.estimator), ("value", short(value)), ("run", _run_name(result))):
                    ticks[key].append(x)
        low, high = (found.low, found.high) if math.isfinite(found.low) else (found.value, found.value)
        for key, x in (
            ("row", row.estimator),
            ("value", short(found.value)),
            ("low", short(max(low, 1e-9))),
            ("high", short(high)),
        ):
            middles[key].append(x)
    if not middles["row"]:
        return None
    caption = "Ticks: runs that ended well. Point and line: the median with its 95 % interval."
    if ideal:
        caption += " In the band the covariance agrees with the errors; to the right the estimator is optimistic."
    return charts.spread(name, title, axis, {"runs": ticks, "middles": middles}, caption, ideal=ideal)


def _run_name(result: Result) -> str:
    return f"seed {result.seed}" + (f", {result.note}" if result.note else "")


def _faults(happening: Mapping[str, list[Any]]) -> dict[str, list[Any]]:
    """Faults of a run, for shading."""
    keep = [k for k, group in enumerate(happening["group"]) if group != "manoeuvres"]
    names = [happening["group"][k] for k in keep]
    return {
        "start": [short(happening["start"][k]) for k in keep],
        "end": [short(happening["end"][k]) for k in keep],
        "name": names,
    }


def _bound(entry: ScenarioEntry) -> dict[str, list[Any]]:
    """The posterior Cramer-Rao bound on the RMS horizontal error, faults known; empty where there is none."""
    from simnav.estimators.bound import bound

    scenario = catalogued(entry.id)
    if scenario is None or scenario.log is not None:
        return {"time": [], "bound": []}
    try:
        found = bound(scenario, range(BOUND_RUNS), "flags")
    except (ValueError, OSError, ArithmeticError, np.linalg.LinAlgError):
        return {"time": [], "bound": []}
    keep = np.unique(np.linspace(0, len(found.time) - 1, 120).round().astype(int))
    return {"time": [short(t) for t in found.time[keep]], "bound": [short(v) for v in found.horizontal[keep]]}


# -- single runs -------------------------------------------------------------------------------------------


def _run_charts() -> list[Chart]:
    """Charts of one run, without data: they are read when a run is chosen."""
    made = [
        charts.track(
            "track",
            "Track",
            {},
            "Black: the true track, from its start (circle) to its end (square). Wide: where faults act. Grey: fixes.",
        )
    ]
    for key, title, unit, _ in curves.QUANTITIES:
        made.append(charts.over_time(f"run-{key}", title, unit, {}, "Of this run. Shaded: faults.", spread=False))
    return made


def _one_run(seed: int, runs: Mapping[str, Runs], rows: Sequence[str], recording: Recording | None) -> dict[str, Any]:
    """Data of the charts of one run, by the name of the chart."""
    found = {}
    for n in rows:
        result = next((r for r in runs[n].results if r.seed == seed), None)
        if result is not None and (one := curves.one_run(result)) is not None:
            found[n] = one
    faults = {"start": [], "end": [], "name": []} if recording is None else _faults(events(None, recording))
    data: dict[str, Any] = {}
    for key, *_ in curves.QUANTITIES:
        data[f"run-{key}"] = {
            "curves": {
                "rows": {
                    n: {"time": one[key]["time"], "middle": one[key]["middle"]}
                    for n, one in found.items()
                    if key in one
                }
            },
            "faults": faults,
            "bound": {"time": [], "bound": []},
        }
    data["track"] = {
        "curves": {"rows": {n: one["track"] for n, one in found.items() if "track" in one}},
        **chart_of(recording, [r for n in rows for r in runs[n].good if r.seed == seed]),
    }
    notes = [r.note for n in rows for r in runs[n].results if r.seed == seed and r.note]
    drawn = next((r.draws for n in rows for r in runs[n].results if r.seed == seed and r.draws), {})
    draws = ", ".join(
        f"{key} {tables.number(value)}" for key, value in drawn.items() if isinstance(value, (int, float))
    )
    return {"seed": seed, "note": notes[0] if notes else "", "draws": draws, "charts": data}


def chart_of(recording: Recording | None, results: Sequence[Result]) -> dict[str, Any]:
    """Truth, fixes, ends and faulty parts of the track of a run; from its results where there is no recording."""
    nothing: dict[str, list[Any]] = {"east": [], "north": [], "time": []}
    faulty: dict[str, list[Any]] = {"east": [], "north": [], "time": [], "name": [], "part": []}
    spots: dict[str, list[Any]] = {"east": [], "north": [], "time": [], "name": []}
    if recording is None:
        result = next((r for r in results if "truth_north" in r.series), None)
        if result is None:
            return {
                "truth": nothing,
                "faulty": faulty,
                "fixes": spots,
                "ends": spots,
                "frame": {"x": [0.0, 1.0], "y": [0.0, 1.0]},
            }
        east, north, time = (
            np.asarray(result.series[k], dtype=np.float64) for k in ("truth_east", "truth_north", "time")
        )
    else:
        track = true_track(recording)
        east, north = track.east, track.north
        time = np.linspace(0.0, recording.duration, len(east))
        for name, fix in fixes(recording, most=300).items():
            for k in range(len(fix.east)):
                for key, x in (
                    ("east", short(fix.east[k])),
                    ("north", short(fix.north[k])),
                    ("time", None),
                    ("name", name),
                ):
                    spots[key].append(x)
        for part, fault in enumerate(recording.faults):
            inside = np.flatnonzero((time >= fault.start) & (time <= fault.end))
            for k in inside[:: max(1, len(inside) // 40)]:
                for key, x in (
                    ("east", short(east[k])),
                    ("north", short(north[k])),
                    ("time", short(time[k])),
                    ("name", f"{fault.kind.replace('_', ' ')} ({', '.join(fault.instruments)})"),
                    ("part", part),
                ):
                    faulty[key].append(x)
    keep = np.unique(np.linspace(0, len(east) - 1, 300).round().astype(int))
    truth = {
        "east": [short(x) for x in east[keep]],
        "north": [short(x) for x in north[keep]],
        "time": [short(x) for x in time[keep]],
    }
    ends = {
        "east": [truth["east"][0], truth["east"][-1]],
        "north": [truth["north"][0], truth["north"][-1]],
        "name": ["start", "end"],
        "time": [0, short(time[-1])],
    }
    frame = {"x": [float(east.min()), float(east.max())], "y": [float(north.min()), float(north.max())]}
    return {"truth": truth, "faulty": faulty, "fixes": spots, "ends": ends, "frame": frame}
