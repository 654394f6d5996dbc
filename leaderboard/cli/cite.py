"""``simnav cite``: how to cite simnav, or results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json

__all__ = ["command"]


def command(
    results: Annotated[
        Path | None, typer.Argument(metavar="RESULTS", help="Folder that a campaign wrote. Default: simnav itself.")
    ] = None,
    text: Annotated[bool, typer.Option("--text", help="Print one line of text instead of BibTeX.")] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Print how to cite this version of simnav, or the results of a campaign."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        found = interface.cite(results)
        out.document(found.to_dict())
        out.print(found.text if text else found.bibtex)
