"""``simnav bench``: time and memory of an epoch, compared with estimators that come with simnav."""

from __future__ import annotations

from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import Debug, FilesOrNames, Json, Seed, Set, parameters

__all__ = ["command"]


def command(
    estimator: FilesOrNames,
    scenario: Annotated[str, typer.Option("--scenario", "-s", help="A name or a TOML file.")] = "open-sea",
    against: Annotated[
        list[str] | None, typer.Option(help="Rows for comparison, separated by commas. Default: one of each family.")
    ] = None,
    epochs: Annotated[int, typer.Option(min=2, help="Epochs that are run.")] = 120,
    rounds: Annotated[int, typer.Option(min=1, help="Runs; the smallest time of an epoch counts.")] = 3,
    set_: Set = None,
    seed: Seed = 0,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure time and memory of an epoch, compared with estimators that come with simnav."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.ranking.costs import cost_table

        with out.progress("measuring") as bar:
            report = interface.bench(
                estimator, against=against, scenario=scenario, seed=seed, epochs=epochs, rounds=rounds,
                parameters=parameters(set_), progress=bar,
            )  # fmt: skip
        out.document(report.to_dict())
        out.print(cost_table(report))
        out.print(*(f"{c.estimator}: {c.status}: {c.reason}" for c in report.costs if c.status != "ok"))
        out.print("time: processor time of update(); memory: from construction to smooth(), measurements aside")
        if any(c.status != "ok" for c in report.costs if c.estimator in report.estimators):
            out.code = FAILED
