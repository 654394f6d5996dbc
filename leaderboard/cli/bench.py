"""``simnav bench``: time and memory of an epoch, and processor time as a multiple of that of the plain row."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, Output, session
from simnav.leaderboard.cli.options import Debug, Json, Seed, Set, parameters

__all__ = ["command"]


def command(
    estimator: Annotated[
        list[str] | None,
        typer.Argument(metavar="FILE_OR_NAME...", help="my_filter.py, or a name; one or several.", show_default=False),
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Multiples of all rows that come with simnav, and nothing else.")
    ] = False,
    scenario: Annotated[
        str | None,
        typer.Option("--scenario", "-s", help="A name or a TOML file. Default: those of a fixed list that suit."),
    ] = None,
    against: Annotated[
        list[str] | None, typer.Option(help="Rows for comparison, separated by commas. Default: one of each family.")
    ] = None,
    epochs: Annotated[int, typer.Option(min=2, help="Epochs that are run.")] = 120,
    rounds: Annotated[
        int, typer.Option(min=1, help="Runs; the smallest time of an epoch counts, and the median of the multiples.")
    ] = 21,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="File for the multiples, as boards read it; with --all.")
    ] = None,
    set_: Set = None,
    seed: Seed = 0,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Measure time and memory of an epoch, and processor time as a multiple of that of the plain row."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.ranking.costs import cost_table, multiple_table
        from simnav.leaderboard.results.errors import RequestError

        if every:
            if estimator or against or set_:
                raise RequestError(
                    "--all measures the rows that come with simnav; leave out names, --against and --set"
                )
            _all(out, scenario, seed, epochs, rounds, output)
            return
        if output is not None:
            raise RequestError("--output goes with --all; 'simnav bench --json' prints what was measured of other rows")
        if not estimator:
            raise RequestError("no estimator was asked for; name one or several, or use --all")
        with out.progress("measuring") as bar:
            report = interface.bench(
                estimator, against=against, scenario=scenario, seed=seed, epochs=epochs, rounds=rounds,
                parameters=parameters(set_), progress=bar,
            )  # fmt: skip
        out.document(report.to_dict())
        out.print(multiple_table(report.multiples), cost_table(report))
        out.print(*(f"{c.estimator}: {c.status}: {c.reason}" for c in report.costs if c.status != "ok"))
        out.print("time: processor time of update(); memory: from construction to smooth(), measurements aside")
        measured = {m.estimator for m in report.multiples.rows}
        failed = [c for c in report.costs if c.estimator in report.estimators and c.status != "ok"]
        if any(c.status == "error" or c.estimator not in measured for c in failed):
            out.code = FAILED


def _all(out: Output, scenario: str | None, seed: int, epochs: int, rounds: int, output: Path | None) -> None:
    """Measure the rows that come with simnav."""
    from simnav.leaderboard import interface
    from simnav.leaderboard.ranking.costs import multiple_table

    with out.progress("measuring") as bar:
        report = interface.costs(
            scenario=scenario, seed=seed, epochs=epochs, rounds=rounds, output=output, progress=bar
        )  # fmt: skip
    out.document(report.to_dict())
    out.print(multiple_table(report))
    out.print(*(f"{u.estimator}: {u.status}: {u.reason}" for u in report.unmeasured))
    if report.file:
        out.print(f"stored: {report.file}")
    if report.unmeasured:
        out.code = FAILED
