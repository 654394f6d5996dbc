"""``simnav rescore``: scores from the trials that a campaign kept."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, OwnScenarios

__all__ = ["command"]


def command(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder of 'simnav campaign --keep-trials'.")],
    score: Annotated[
        list[str] | None,
        typer.Option("--score", help="Names of scores, separated by commas. Default: those that are missing."),
    ] = None,
    scenario: OwnScenarios = None,
    key: Annotated[Path | None, typer.Option(metavar="KEYFILE", help="Key file, if the seeds are sealed.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Compute new scores, or existing scores again, without running an estimator."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        with out.progress("rescoring") as progress:
            done = interface.rescore(results, ",".join(score or ()), scenarios=scenario, key=key, progress=progress)
        out.document(done.to_dict())
        counts = {"were complete": done.complete, "have no trial": done.without_trial}
        others = "".join(f", {count} {words}" for words, count in counts.items() if count)
        named = "no score" if not done.scores else ", ".join(done.scores[:5]) + (", ..." if done.scores[5:] else "")
        out.print(
            f"results: {done.folder} ({done.rescored} were given {named}{others})",
            f"next:    simnav leaderboard {quote(str(done.folder))}",
        )
