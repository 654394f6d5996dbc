"""``simnav standard``: the result that comes with simnav."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, session
from simnav.leaderboard.cli.options import Debug, Force, Json, Minutes, Shard, Workers, campaign_progress, part_of

__all__ = ["app"]

app = typer.Typer(help="Run, check and publish the result that comes with simnav.", no_args_is_help=True)
_Results = Annotated[Path, typer.Option("--results", help="Folder to work in.")]
_Profile = Annotated[str, typer.Option(help="What is run: a profile of simnav, or a file.")]
_Shipped = Annotated[Path | None, typer.Option(help="Folder of the packed results. Default: that of simnav.")]
_WORKING = Path("results/standard")


@app.command()
def run(
    minutes: Minutes = 110.0,
    results: _Results = _WORKING,
    profile: _Profile = "standard",
    shipped: _Shipped = None,
    workers: Workers = 2,
    force: Force = None,
    shard: Shard = "1/1",
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run the missing and outdated parts of the standard result."""
    with session(json, debug) as out:
        from simnav.leaderboard import publishing

        with out.progress("starting") as bar:
            report = publishing.run_standard(
                minutes=minutes, profile=profile, results=results, shipped=shipped, workers=workers,
                force=force or (), shard=part_of(shard), progress=campaign_progress(bar),
            )  # fmt: skip
        s = report.summary
        out.document({"results": str(s.folder), "computed": s.computed, "skipped": s.skipped, "left": s.left})
        out.print(
            f"results: {s.folder} ({s.computed} computed, {s.skipped} were there, {s.left} are left)",
            "next:    simnav standard run" if s.left else "next:    simnav standard publish",
        )


@app.command()
def check(
    results: Annotated[
        Path | None, typer.Option("--results", help="Folder of results. Default: those of simnav.")
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Say which rows and scenarios have another version than the standard result."""
    with session(json, debug) as out:
        from simnav.leaderboard import publishing

        found = publishing.check_standard(results)
        out.document(found.to_dict())
        out.print(*(found.sentences() or ["the standard result has the versions of today"]))
        out.code = FAILED if found else 0


@app.command()
def audit(
    sample: Annotated[int, typer.Option(min=1, help="Results that are repeated, drawn at random.")] = 20,
    results: Annotated[
        Path | None, typer.Option("--results", help="Folder of results. Default: those of simnav.")
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Repeat a random sample of the standard result, and compare the scores."""
    with session(json, debug) as out:
        from simnav.leaderboard import publishing

        with out.progress("repeating") as bar:
            made = publishing.audit_standard(sample=sample, results=results, progress=bar)
        found = made.verification
        out.document(made.to_dict())
        out.print(
            f"results:   {found.folder} ({found.results}, of which {found.repeated} were repeated)",
            *(f"close:     {text}" for text in found.close),
            *(f"different: {text}" for text in found.different),
            *(f"left:      {text}" for text in found.not_repeatable),
            f"the sample: {made.sentence()}",
        )
        out.code = 0 if made.passed else FAILED


@app.command()
def publish(
    results: _Results = _WORKING,
    profile: _Profile = "standard",
    shipped: _Shipped = None,
    history: Annotated[Path | None, typer.Option(help="File of the editions. Default: that of simnav.")] = None,
    readme: Annotated[
        Path | None, typer.Option(help="Whose tables are written. Default: README.md, if it is here.")
    ] = None,
    site: Annotated[Path, typer.Option(help="Folder of the site.")] = Path("site"),
    workers: Workers = 2,
    preliminary: Annotated[bool, typer.Option("--preliminary", help="Publish also if runs are missing.")] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Pack the standard result, and make its site, the README's tables and the history of rows from it."""
    with session(json, debug) as out:
        from simnav.leaderboard import publishing
        from simnav.leaderboard.standard.readme import BEGIN

        here = Path("README.md")
        if readme is None and here.is_file() and BEGIN in here.read_text(encoding="utf-8", errors="replace"):
            readme = here
        with out.progress("site") as bar:
            made = publishing.publish_standard(
                results=results, profile=profile, shipped=shipped, history=history, readme=readme, site=site,
                workers=workers, preliminary=preliminary, progress=bar,
            )  # fmt: skip
        out.document({**made.to_dict(), "site": str(site)})
        out.print(
            f"results: {made.folder} ({len(made.results)} runs, {made.size / 2**20:.1f} MiB)",
            f"edition: {made.edition or 'none yet, because runs are missing'}",
            *(f"remark:  {text}" for text in made.remarks),
            *([f"tables:  {made.readme}"] if made.readme is not None else []),
            f"site:    {site / 'index.html'}",
        )
