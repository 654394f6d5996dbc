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
        from simnav.leaderboard import interface
        from simnav.leaderboard.papers.page import find
        from simnav.leaderboard.ranking.agreement import LEAST, correlation_table, rank_correlations
        from simnav.leaderboard.ranking.confinement import confined, confinement_line
        from simnav.leaderboard.ranking.failures import failure_table, failures
        from simnav.leaderboard.ranking.ranking_table import ranking_tables
        from simnav.leaderboard.site import sweeps as swept
        from simnav.leaderboard.site.site import build

        found = interface.results_of(results, series=True)
        ranking = interface.rank(found)
        correlations = [] if against is None else rank_correlations(ranking, interface.rank(against))
        with out.progress("site") as progress:
            index = build(
                found, ranking, output, progress=progress, workers=workers, papers=find(papers), runs_shown=runs_shown,
                figures=figures, sweeps=swept.find(sweeps),
            )  # fmt: skip
        document = {"site": str(index), "runs": len(found), "failed": failures(found), "ranking": ranking.to_dict(),
                    "confinement": confined(found)}  # fmt: skip
        out.document(document | {"correlations": [c.to_dict() for c in correlations]})
        out.print(*ranking_tables(ranking), *failure_table(found), *filter(None, [confinement_line(found)]))
        if correlations:
            out.print(correlation_table(correlations))
        elif against is not None:
            out.note(f"simnav: no track of {against} has {LEAST} rows in common with one of {results}")
        out.print(f"site: {index}")
