"""``simnav reference``: measure the fixed figures that the errors of scenarios are divided by."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, Scenarios, Workers, absolute
from simnav.leaderboard.ranking import tables

__all__ = ["command"]


def _with_error(value: float, error: float) -> str:
    return f"{value:.3f} +- {error:.3f}" if math.isfinite(value) else ""


def command(
    scenario: Scenarios = None,
    runs: Annotated[int, typer.Option("--runs", "-n", min=2, help="Seeds a scenario.")] = 200,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File of the figures. Default: the one that comes with simnav."),
    ] = None,
    results: Annotated[
        Path, typer.Option(help="Keep the runs in this folder; started again, it continues there.")
    ] = Path("results/reference"),
    workers: Workers = 2,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run the oracles over many seeds, and store the figures that errors are divided by."""
    with session(json, debug) as out:
        from simnav.leaderboard import given
        from simnav.leaderboard.ranking import reference
        from simnav.leaderboard.ranking.reference_measurement import measure, save
        from simnav.leaderboard.results.errors import mistakes
        from simnav.leaderboard.results.store import StoreError

        chosen = given.scenarios_of(scenario, note=out.remark)
        file = reference.FILE if output is None else absolute(output)
        with mistakes(StoreError):
            with out.progress("starting") as bar:
                found = measure(
                    chosen, runs, absolute(results), workers=workers, progress=bar, found=lambda f: save(f, file)
                )
            save(found, file)
        rows = [
            [
                scenario_id,
                score,
                r.estimator,
                r.runs,
                tables.number(r.value, 4),
                tables.number(r.spread),
                _with_error(r.to_bound, r.to_bound_error),
                _with_error(r.nees, r.nees_error),
            ]
            for scenario_id, scores in sorted(found.items())
            for score, r in scores.items()
        ]
        columns = ["scenario", "score", "estimator", "runs", "figure [m]", "log spread", "to bound", "NEES"]
        out.document({"file": str(file), "figures": {s: {n: vars(r) for n, r in x.items()} for s, x in found.items()}})
        out.print(tables.table("Reference figures", columns, rows, numeric=columns[3:]), f"stored: {file}")
