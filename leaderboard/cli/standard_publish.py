"""``simnav standard publish``: what comes with simnav, from the results of a campaign."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from simnav.leaderboard.publishing import publish_standard
from simnav.leaderboard.publishing_requests import PublishRequest
from simnav.leaderboard.standard.readme import BEGIN

from .console import Output

__all__ = ["show"]


def show(out: Output, request: PublishRequest) -> None:
    """Pack the standard result, and make its site, the README's tables and the history of rows from it."""
    here = Path("README.md")
    if request.readme is None and here.is_file() and BEGIN in here.read_text(encoding="utf-8", errors="replace"):
        request = replace(request, readme=here)
    with out.progress("site") as bar:
        made = publish_standard.of(replace(request, progress=bar))
    site = Path(request.site or "site")
    out.document({**made.to_dict(), "site": str(site)})
    out.print(
        f"results: {made.folder} ({len(made.results)} runs, {made.size / 2**20:.1f} MiB)",
        f"edition: {made.edition or 'none yet, because runs are missing'}",
        *(f"remark:  {text}" for text in made.remarks),
        *([f"tables:  {made.readme}"] if made.readme is not None else []),
        f"site:    {site / 'index.html'}",
    )
