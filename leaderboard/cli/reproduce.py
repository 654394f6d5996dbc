"""``simnav reproduce``: the comparison of a paper, repeated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, Workers, absolute, campaign_progress
from simnav.leaderboard.papers import PAPERS

__all__ = ["command"]


def command(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help=f"{', '.join(PAPERS)}.")],
    runs: Annotated[
        int | None, typer.Option("--runs", "-n", min=1, help="Runs of each scenario. Default: a few, done in minutes.")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("--method", "-m", help="Only the rows about these methods. Default: all.")
    ] = None,
    until_decided: Annotated[
        bool, typer.Option("--until-decided", help="More runs for undecided rows, until all are decided.")
    ] = False,
    limit: Annotated[
        int, typer.Option(min=1, help="With --until-decided: largest number of runs of a scenario.")
    ] = 200,
    minutes: Annotated[
        float | None,
        typer.Option(min=0.0, help="With --until-decided: start no run after this time. Default: no limit."),
    ] = None,
    stored: Annotated[
        bool, typer.Option("--stored", help="Show the results that come with simnav; nothing is run.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of results, tables, figures, page. Default: reproduced/PAPER."),
    ] = None,
    workers: Workers = 2,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Repeat the comparison of a paper: our figures beside the paper's, with a verdict on each row.

    Results are kept: started again, the command continues.
    """
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.papers import figures, page, report
        from simnav.leaderboard.papers.comparison import RULES

        with out.progress("starting") as bar:
            found = interface.reproduce(
                paper, runs=runs, methods=method or (), until_decided=until_decided, limit=limit, minutes=minutes,
                stored=stored, output=output, workers=workers,
                progress=lambda scenario, p: campaign_progress(bar, scenario)(p),
            )  # fmt: skip
        about = found.paper
        folder = absolute(output or Path("reproduced") / about.key)
        folder.mkdir(parents=True, exist_ok=True)
        table = report.write_csv(found, folder / f"paper-{about.key}.csv")
        with out.progress("drawing") as bar:
            drawn = figures.write_figures(
                found, folder, lambda done, total, note: bar(done, total, note=note), scores_only=stored
            )
        written = page.write(found, drawn, folder)
        paths = [d.path for d in drawn if d.path is not None]
        out.document({**found.to_dict(), "contents": report.whereabouts(found, drawn), "csv": str(table),
                      "page": str(written), "figures": [str(p) for p in paths]})  # fmt: skip
        out.print(f"{about.short}: {about.about}", f"{about.citation}\n")
        out.print(*report.paper_tables(found), report.contents_table(found, drawn))
        for note in about.notes:
            out.print(f"note: {note}")
        out.print(f"rule: {RULES}", report.summary(found))
        if found.count("undecided") and not stored:
            out.print(f"more runs for undecided rows: simnav reproduce {about.key} --until-decided")
        out.print(f"table:   {table}", f"figures: {len(paths)} as PNG in {folder}", f"page:    {written}")
