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
    papers: Annotated[Path, typer.Option(help="Folder that 'simnav reproduce' wrote; its papers get pages.")] = Path(
        "reproduced"
    ),
    sweeps: Annotated[
        Path, typer.Option(help="Folder with the folders of sweeps; the pages of scenarios show them.")
    ] = Path("results"),
    runs_shown: Annotated[
        int, typer.Option(min=1, help="Runs of each scenario of which the site has track and errors.")
    ] = 2,
    figures: Annotated[bool, typer.Option("--print", help="Write the charts as SVG and PNG, too.")] = False,
    against: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Results of another campaign, for the rank correlation."),
    ] = None,
    workers: Workers = 2,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Rank the results of a campaign and write the site."""
    with session(json, debug) as out:
        from simnav.leaderboard import publishing
        from simnav.leaderboard.ranking.agreement import LEAST, correlation_table
        from simnav.leaderboard.ranking.confinement import confinement_line
        from simnav.leaderboard.ranking.failures import failure_table
        from simnav.leaderboard.ranking.ranking_table import ranking_tables

        with out.progress("site") as progress:
            made = publishing.site(
                results, output=output, papers=papers, sweeps=sweeps, runs_shown=runs_shown, figures=figures,
                against=against, workers=workers, progress=progress,
            )  # fmt: skip
        out.document(made.to_dict())
        out.print(*ranking_tables(made.ranking), *failure_table(made.results))
        out.print(*filter(None, [confinement_line(made.results)]))
        if made.correlations:
            out.print(correlation_table(made.correlations))
        elif against is not None:
            out.note(f"simnav: no track of {against} has {LEAST} rows in common with one of {results}")
        out.print(f"site: {made.index}")
