"""``simnav submit``: an estimator with its results as one file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, Minutes, Set, Workers, campaign_progress, parameters

__all__ = ["command"]


def command(
    estimator: Annotated[
        str, typer.Argument(metavar="FILE_OR_PACKAGE", help="my_filter.py, or an installed package with estimators.")
    ],
    profile: Annotated[str, typer.Option(help="What is run: a profile of simnav.")] = "standard",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="The bundle. Default: NAME.simnav.zip.")] = None,
    results: Annotated[
        Path | None, typer.Option(help="Keep the results in this folder. Default: results/submit-NAME.")
    ] = None,
    requires: Annotated[
        list[str] | None, typer.Option(help="Package that a file needs beside simnav; repeatable.")
    ] = None,
    set_: Set = None,
    workers: Workers = 2,
    minutes: Minutes = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run an estimator on a profile, and write its source and results as a bundle."""
    with session(json, debug) as out:
        from simnav.leaderboard import publishing

        with out.progress("starting") as bar:
            made = publishing.submit(
                estimator, profile=profile, parameters=parameters(set_), requires=requires or (), output=output,
                results=results, workers=workers, minutes=minutes, progress=campaign_progress(bar),
            )  # fmt: skip
        out.document(made.to_dict())
        out.print(
            f"bundle:  {made.path} ({', '.join(made.estimators)}; {made.results} results, {made.failed} failed)",
            f"sha256:  {made.digest}",
            *(f"remark:  {text}" for text in made.remarks),
            f"next:    simnav verify {made.path}",
        )
