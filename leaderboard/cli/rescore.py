"""``simnav rescore``: scores from the trials that a campaign kept."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json

__all__ = ["command"]


def command(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder of 'simnav campaign --keep-trials'.")],
    score: Annotated[
        list[str] | None, typer.Option("--score", help="Names of scores, separated by commas. Default: all.")
    ] = None,
    scenario: Annotated[
        list[str] | None, typer.Option("--scenario", "-s", help="TOML files of scenarios outside the catalogue.")
    ] = None,
    key: Annotated[Path | None, typer.Option(metavar="KEYFILE", help="The key, where the seeds are sealed.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Compute scores again, new ones too, without running an estimator."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        with out.progress("rescoring") as progress:
            done = interface.rescore(results, ",".join(score or ()), scenarios=scenario, key=key, progress=progress)
        out.document(done.to_dict())
        without = f", {done.without_trial} have no trial" if done.without_trial else ""
        out.print(
            f"results: {done.folder} ({done.rescored} have {len(done.scores)} scores now{without})",
            f"next:    simnav leaderboard {quote(str(done.folder))}",
        )
