"""``simnav merge``: the results of several folders in one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json

__all__ = ["command"]


def command(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDERS", help="Folders that campaigns wrote.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder that gets all results.")],
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Put the results of several folders into one, e.g. of campaigns with --shard."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        results = interface.merge(folders, output)
        where = output.expanduser().resolve()
        out.document({"results": str(where), "runs": len(results)})
        out.print(f"results: {where} ({len(results)} runs)", f"next:    simnav leaderboard {where}")
