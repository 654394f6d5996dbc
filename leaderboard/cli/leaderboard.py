"""``simnav leaderboard``: the ranking of a campaign, and the site."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, Workers

__all__ = ["command"]


def command(
    results: Annotated[Path, typer.Argument(metavar="RESULTS", help="Folder that a campaign wrote.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the site.")] = Path("site"),
    papers: Annotated[Path, typer.Option(help="What 'simnav reproduce' wrote; gets pages.")] = Path("reproduced"),
    runs_shown: Annotated[
        int, typer.Option(min=1, help="Runs of each scenario of which the site has track and errors.")
    ] = 2,
    figures: Annotated[bool, typer.Option("--print", help="Write the charts as SVG and PNG, too.")] = False,
    workers: Workers = 2,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Rank the results of a campaign and write the site."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.papers.page import find
        from simnav.leaderboard.ranking.confinement import confined, confinement_line
        from simnav.leaderboard.ranking.failures import failure_table, failures
        from simnav.leaderboard.ranking.ranking_table import ranking_tables
        from simnav.leaderboard.site.site import build

        found = interface.results_of(results, series=True)
        ranking = interface.rank(found)
        with out.progress("site") as progress:
            index = build(
                found, ranking, output, progress=progress, workers=workers, papers=find(papers), runs_shown=runs_shown,
                figures=figures,
            )  # fmt: skip
        out.document({
            "site": str(index), "runs": len(found), "failed": failures(found), "confinement": confined(found),
            "ranking": ranking.to_dict(),
        })  # fmt: skip
        out.print(*ranking_tables(ranking), *failure_table(found), *filter(None, [confinement_line(found)]))
        out.print(f"site: {index}")
