"""``simnav campaign``: scenarios x estimators x seeds."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import (
    Debug,
    Estimators,
    FirstSeed,
    Force,
    Json,
    MemoryLimit,
    Minutes,
    Scenarios,
    Set,
    Shard,
    TimeLimit,
    Workers,
    campaign_progress,
    parameters,
    part_of,
)
from simnav.leaderboard.ranking import tables

__all__ = ["command"]


class Backend(StrEnum):
    """Where a campaign runs."""

    LOKY = "loky"
    DASK = "dask"


def command(
    scenario: Scenarios = None,
    estimator: Estimators = None,
    runs: Annotated[
        int | None, typer.Option("--runs", "-n", min=1, help="Seeds a scenario. [50, or as the profile says]")
    ] = None,
    seed: FirstSeed = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("results"),
    profile: Annotated[
        str | None, typer.Option(help="What is run: smoke, quick, standard, full, or a TOML file of your own.")
    ] = None,
    set_: Set = None,
    workers: Workers = 2,
    time_limit: TimeLimit = None,
    memory_limit: MemoryLimit = 2048,
    retry: Annotated[bool, typer.Option("--retry", help="Run the failed runs of the folder again.")] = False,
    force: Force = None,
    keep_trials: Annotated[
        bool, typer.Option("--keep-trials", help="Keep the estimates, for 'simnav rescore'.")
    ] = False,
    covariance_interval: Annotated[
        float, typer.Option(min=0.0, help="Smallest number of seconds between two kept covariances. 0 keeps all.")
    ] = 0.0,
    backend: Annotated[Backend, typer.Option(help="Processes of this machine, or a Dask cluster.")] = Backend.LOKY,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of the Dask scheduler, e.g. tcp://host:8786; implies dask."),
    ] = None,
    shard: Shard = "1/1",
    confinement: Annotated[
        str, typer.Option(help="How estimators are kept from the truth: auto, bubblewrap, process, none.")
    ] = "auto",
    sealed: Annotated[
        Path | None, typer.Option("--sealed", metavar="KEYFILE", help="Derive the seeds from the secret in this file.")
    ] = None,
    oracle: Annotated[
        bool, typer.Option(help="Run the oracles on simulated scenarios, too: the reference of a board, not ranked.")
    ] = True,
    minutes: Minutes = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run estimators on scenarios and seeds. Started again, the campaign continues."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.ranking.confinement import confinement_line
        from simnav.leaderboard.ranking.failures import failure_table
        from simnav.leaderboard.ranking.ranking_table import ranking_tables

        chosen = None if profile and not scenario else interface.scenarios_of(scenario, note=out.remark)
        with out.progress("starting") as bar:
            report = interface.campaign(
                chosen, estimator, runs=runs, seed=seed, output=output, profile=profile, parameters=parameters(set_),
                workers=workers, time_limit=time_limit, memory_limit=memory_limit, retry=retry, force=force or (),
                keep_trials=keep_trials,
                covariance_interval=covariance_interval, confinement=confinement, sealed=sealed,
                oracle=oracle,
                backend=(Backend.DASK if scheduler else backend).value, scheduler=scheduler, shard=part_of(shard),
                minutes=minutes, progress=campaign_progress(bar),
            )  # fmt: skip
        summary = report.summary
        out.document(report.to_dict())
        out.print(*ranking_tables(report.ranking), *failure_table(report.results))
        out.print(*filter(None, [confinement_line(report.results)]))
        if summary.left:
            out.print(f"{summary.left} of {summary.total} runs are left; the same command continues")
        out.print(f"results: {summary.folder} ({summary.computed} computed, {summary.skipped} were there, "
                  f"{tables.duration(summary.seconds)})",
                  f"next:    simnav leaderboard {quote(str(summary.folder))}")  # fmt: skip
        out.code = 0 if any(r.status == "ok" for r in report.results) else FAILED
