"""``simnav seal``: the key of sealed seeds, and its commitment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json

__all__ = ["command"]


def command(
    key: Annotated[Path, typer.Argument(metavar="KEYFILE", help="File of the key; a new one is made.")],
    public: Annotated[
        str, typer.Option(metavar="TEXT", help="Public value to mix in, drawn after the commitment was published.")
    ] = "",
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Make or check a key of sealed seeds, and print the commitment to publish before the campaign."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        made = interface.seal(key, public=public)
        where = key.expanduser().resolve()
        out.document({"key": str(where), "commitment": made.commitment, "seal": made.hash, "public": made.public})
        out.print(
            f"key:        {where} (keep it secret until the campaign has ended)", f"commitment: {made.commitment}"
        )
        if made.public:
            out.print(f"public:     {made.public}", f"seal:       {made.hash} (stands in the results)")
        out.print(f"next:       publish the commitment, then simnav campaign --sealed {key}")
