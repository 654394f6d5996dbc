"""``simnav sweep``: error against a dial of a scenario, and where estimators break."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import (
    Debug,
    FirstSeed,
    Json,
    MemoryLimit,
    ScenarioName,
    Set,
    TimeLimit,
    Workers,
    absolute,
    campaign_progress,
    parameters,
)
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError, mistakes

if TYPE_CHECKING:
    from simnav.leaderboard.sweep.report import Sweep

__all__ = ["command"]

_DIAL = "A dial with its values, like multipath=0,1,2,4, or a key, like fault[0].sigma_m=1,2. Two make a map."
_ESTIMATOR = "Names or files, separated by commas; 'sw-fgo:window=10' sets a parameter."


def command(
    scenario: ScenarioName,
    dial: Annotated[list[str], typer.Option(help=_DIAL)],
    estimator: Annotated[list[str], typer.Option("--estimator", "-e", help=_ESTIMATOR)],
    runs: Annotated[int, typer.Option("--runs", "-n", min=1, help="Seeds a value.")] = 30,
    limit: Annotated[float | None, typer.Option(help="Threshold of the error, in the unit of the score.")] = None,
    score: Annotated[str, typer.Option(help="A score that is better when lower.")] = "horizontal_rmse",
    plot: Annotated[Path | None, typer.Option(help="Write a figure: .png, .svg or .pdf.")] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder of the results. Default: results/sweep-SCENARIO.")
    ] = None,
    set_: Set = None,
    seed: FirstSeed = 0,
    workers: Workers = 2,
    time_limit: TimeLimit = None,
    memory_limit: MemoryLimit = 2048,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Vary a quantity of a scenario (a dial): the error of estimators against it, and their breaking points."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise RequestError(f"--plot {plot.name}: it should end in .png, .svg or .pdf")
        with out.progress("starting") as bar:
            sweep = interface.sweep(
                scenario, dial, estimator, runs=runs, seed=seed, score=score, limit=limit, output=output,
                parameters=parameters(set_), workers=workers, time_limit=time_limit, memory_limit=memory_limit,
                progress=campaign_progress(bar),
            )  # fmt: skip
        written = None if plot is None else _draw(sweep, absolute(plot))
        out.document({**sweep.to_dict(), "figure": None if written is None else str(written)})
        out.print(_errors(sweep), _breaking(sweep))
        if written is not None:
            out.print(f"figure:  {written}")
        summary = sweep.summary
        out.print(f"results: {summary.folder} ({summary.computed} computed, {summary.skipped} were there, "
                  f"{tables.duration(summary.seconds)})")  # fmt: skip
        out.code = 0 if any(r.status == "ok" for r in sweep.results) else FAILED


def _figure(x: float) -> str:
    return "failed" if math.isinf(x) else tables.number(x)


def _errors(sweep: Sweep) -> tables.Fitted:
    """A row an estimator and setting."""
    from simnav.leaderboard.ranking.ranking_table import between
    from simnav.leaderboard.sweep.report import axis_label
    from simnav.scoring import SCORES

    at = {(p.estimator, p.values): p for p in sweep.points}
    rows = []
    for e in sweep.estimators:
        for setting in sweep.settings:
            p = at[e, setting.values]
            failed = f"{p.failed} of {p.runs}" if p.failed else ""
            dials = [f"{v:g}" for v in setting.values]
            rows.append([e, *dials, _figure(p.error.value), between(p.error.low, p.error.high), failed])
    score, dials = SCORES[sweep.score], [axis_label(d) for d in sweep.dials]
    return tables.Fitted(
        f"{sweep.scenario}: {score.title}, median of the runs",
        ["estimator", *dials, f"error [{score.unit}]", "95 % interval", "failed"],
        rows,
        ["estimator", *dials, f"error [{score.unit}]", "95 % interval", "failed"],
        always=2 + len(dials),
        numeric=[*dials, f"error [{score.unit}]"],
    )


def _breaking(sweep: Sweep) -> tables.Fitted:
    """Where each estimator breaks."""
    from simnav.leaderboard.sweep.report import axis_label

    beyond = f"beyond {sweep.values[0][-1]:g}"

    def figure(x: float) -> str:
        return "–" if math.isnan(x) else beyond if math.isinf(x) else f"{x:.3g}"

    rows = []
    for b in sweep.breaking_points:
        words = "twice its clean error" if b.criterion == "twice-clean" else "the limit"
        interval = f"{figure(b.value.low)} to {figure(b.value.high)}" if not math.isnan(b.value.low) else ""
        passes = f"{words}, {tables.number(b.threshold)}"
        rows.append([b.estimator, *([] if b.at is None else [f"{b.at:g}"]), passes, figure(b.value.value), interval])
    second = [axis_label(sweep.dials[1])] if len(sweep.dials) == 2 else []
    at = f"at: {axis_label(sweep.dials[0])}"
    columns = ["estimator", *second, "passes", at, "95 % interval"]
    value = ["estimator", at, *second, "95 % interval", "passes"]
    return tables.Fitted("Breaking points", columns, rows, value, always=2 + len(second), numeric=[*second, at])


def _draw(sweep: Sweep, path: Path) -> Path:
    from simnav.leaderboard.figures.style import save_as

    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        return save_as(sweep.plot(), path)
