"""The command ``simnav reproduce``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.cli.console import Output, UserError, absolute, mistakes, sentence, session
from simnav.leaderboard.papers import PAPERS

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress

__all__ = ["register", "run"]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("reproduce")(_command)


def _command(
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
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document, for machines.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Run a paper's comparison again: ours beside theirs, row by row; started again, it goes on where it was."""
    with session(json, debug) as out:
        run(out, paper, runs, output, workers, method or ())


def run(
    out: Output, key: str, runs: int | None, output: Path | None, workers: int, methods: Sequence[str] = ()
) -> None:
    """Reproduce a paper and show it; all of it, or what is about some of its methods."""
    from simnav.leaderboard.campaign.campaign import CampaignError
    from simnav.leaderboard.papers import figures, page, paper, report
    from simnav.leaderboard.papers.comparison import RULES
    from simnav.leaderboard.papers.reproduction import reproduce
    from simnav.leaderboard.results.store import StoreError

    with mistakes(ValueError):
        chosen = paper.load(key)
        if methods:
            chosen = chosen.only(methods)
    folder = absolute(output or Path("reproduced") / key)
    begun: list[str] = []
    with out.progress("starting") as bar:

        def told(scenario: str, p: Progress) -> None:
            begun.append(scenario)
            bar.begin("compiling kernels" if p.stage == "compile" else scenario)
            bar(p.done, p.total, f"{p.failed} failed, {p.note}" if p.failed else p.note, p.left)

        try:
            found = reproduce(chosen, runs or chosen.runs, folder / "results", workers=workers, progress=told)
        except StoreError as error:
            raise UserError(sentence(error)) from error
        except CampaignError as error:
            if not begun:
                raise UserError(sentence(error)) from error
            raise
    folder.mkdir(parents=True, exist_ok=True)
    table = report.write_csv(found, folder / f"paper-{key}.csv")
    with out.progress("drawing", len(chosen.figures)) as bar:
        drawn = figures.write_figures(found, folder, lambda done, total, note: bar(done, total, note=note))
    written = page.write(found, drawn, folder)
    paths = [d.path for d in drawn if d.path is not None]
    out.document({**found.to_dict(), "contents": report.whereabouts(found, drawn), "csv": str(table),
                  "page": str(written), "figures": [str(p) for p in paths]})  # fmt: skip
    out.print(f"Paper {key}: {chosen.title}", f"{chosen.citation}\n")
    for shown in report.paper_tables(found):
        out.print(shown)
    out.print(report.contents_table(found, drawn))
    for note in chosen.notes:
        out.print(f"note: {note}")
    out.print(f"rule: {RULES}", f"{report.summary(found)}; the paper's number: --runs {chosen.full}")
    out.print(f"table:   {table}", f"figures: {len(paths)} as PNG in {folder}", f"page:    {written}")
