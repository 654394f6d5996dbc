"""``simnav evaluate``: estimators beside the baselines on the same seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import (
    Debug,
    FilesOrNames,
    FirstSeed,
    Json,
    MemoryLimit,
    Set,
    TimeLimit,
    Workers,
    campaign_progress,
    parameters,
)
from simnav.leaderboard.results.errors import RequestError

__all__ = ["command"]


def command(
    estimator: FilesOrNames,
    scenario: Annotated[list[str], typer.Option("--scenario", "-s", help="Names or TOML files, separated by commas.")],
    runs: Annotated[int, typer.Option("--runs", "-n", min=2, help="Seeds.")] = 20,
    against: Annotated[
        list[str] | None, typer.Option(help="Baselines, separated by commas. Default: all that suit the scenario.")
    ] = None,
    set_: Set = None,
    seed: FirstSeed = 0,
    workers: Workers = 2,
    time_limit: TimeLimit = None,
    memory_limit: MemoryLimit = 2048,
    results: Annotated[
        Path | None, typer.Option(help="Keep the results in this folder. Default: they are not kept.")
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Compare estimators with the baselines on the same seeds."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.ranking.failures import failure_table
        from simnav.leaderboard.ranking.ranking_table import ranking_tables
        from simnav.leaderboard.ranking.standing import standing_table

        chosen = interface.scenarios_of(scenario, note=out.remark)
        with out.progress("starting") as bar:
            report = interface.evaluate(
                estimator, chosen, runs=runs, seed=seed, against=against, parameters=parameters(set_),
                workers=workers, time_limit=time_limit, memory_limit=memory_limit, results=results,
                progress=campaign_progress(bar),
            )  # fmt: skip
        out.document(report.to_dict())
        out.print(*ranking_tables(report.ranking, report.estimators))
        for stand in report.standings:
            out.print(standing_table(stand))
        out.print(*failure_table(report.results))
        for label in report.estimators:
            own = [r for r in report.results if r.estimator == label]
            if own and all(r.status == "unsuitable" for r in own):
                raise RequestError(f"{label} does not suit {', '.join(sorted(report.scenarios))}: {own[0].reason}")
            if any(r.tried and r.status != "ok" for r in own):
                out.code = FAILED
