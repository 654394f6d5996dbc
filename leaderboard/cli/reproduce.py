"""``simnav reproduce``: a paper's comparison, run again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, Workers, absolute
from simnav.leaderboard.papers import PAPERS

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress

__all__ = ["command"]


def command(
    paper: Annotated[str, typer.Argument(metavar="PAPER", help=f"{', '.join(PAPERS)}: see docs/papers.md.")],
    runs: Annotated[
        int | None, typer.Option("--runs", "-n", min=1, help="Seeds a scenario. [few: ends within minutes]")
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("--method", "-m", help="Only what is about these methods. [all]")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder of results, tables, figures, page. [reproduced/PAPER]")
    ] = None,
    workers: Workers = 2,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run a paper's comparison again: ours beside theirs, row by row; started again, it goes on where it was."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.papers import figures, page, report
        from simnav.leaderboard.papers.comparison import RULES

        folder = absolute(output or Path("reproduced") / paper)
        with out.progress("starting") as bar:

            def show(scenario: str, p: Progress) -> None:
                bar.begin("compiling kernels" if p.stage == "compile" else scenario)
                bar(p.done, p.total, f"{p.failed} failed, {p.note}" if p.failed else p.note, p.left)

            found = interface.reproduce(
                paper, runs=runs, methods=method or (), output=folder, workers=workers, progress=show
            )
        folder.mkdir(parents=True, exist_ok=True)
        table = report.write_csv(found, folder / f"paper-{paper}.csv")
        with out.progress("drawing") as bar:
            drawn = figures.write_figures(found, folder, lambda done, total, note: bar(done, total, note=note))
        written = page.write(found, drawn, folder)
        paths = [d.path for d in drawn if d.path is not None]
        out.document({**found.to_dict(), "contents": report.whereabouts(found, drawn), "csv": str(table),
                      "page": str(written), "figures": [str(p) for p in paths]})  # fmt: skip
        out.print(f"Paper {paper}: {found.paper.title}", f"{found.paper.citation}\n")
        out.print(*report.paper_tables(found), report.contents_table(found, drawn))
        for note in found.paper.notes:
            out.print(f"note: {note}")
        out.print(f"rule: {RULES}", f"{report.summary(found)}; the paper's number: --runs {found.paper.full}")
        out.print(f"table:   {table}", f"figures: {len(paths)} as PNG in {folder}", f"page:    {written}")
