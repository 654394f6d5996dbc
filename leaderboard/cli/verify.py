"""``simnav verify``: seals, and a sample of results that is repeated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import Debug, Estimators, Json

__all__ = ["command"]


def command(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder of results.")],
    key: Annotated[
        Path | None, typer.Option("--key", metavar="KEYFILE", help="Published key of a sealed campaign.")
    ] = None,
    sample: Annotated[int, typer.Option(min=1, help="Runs that are repeated at most.")] = 10,
    scenario: Annotated[
        list[str] | None, typer.Option("--scenario", "-s", help="TOML files of scenarios outside the catalogue.")
    ] = None,
    estimator: Estimators = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Check the seal of results, and repeat some of them to the bit."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        with out.progress("repeating") as progress:
            done = interface.verify(
                results, key=key, sample=sample, scenarios=scenario, estimators=estimator, progress=progress
            )
        out.document(done.to_dict())
        seal = f"sealed by {done.seal}" if done.seal else "public seeds"
        lines = [f"results: {done.folder} ({done.results}, {seal})"]
        if done.other_seals:
            lines.append(f"{done.other_seals} results were not made under this key")
        lines += [f"different: {text}" for text in done.different]
        lines += [f"not repeatable: {text}" for text in done.not_repeatable]
        same = done.repeated - len(done.different) - len(done.not_repeatable)
        lines.append(f"{same} of {done.repeated} repeated runs are the same to the bit")
        out.print(*lines)
        out.code = 0 if done.passed else FAILED
