"""``simnav leaderboard``: the ranking of a campaign, and the site."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.publishing import site
from simnav.leaderboard.publishing_requests import SiteRequest
from simnav.leaderboard.ranking.agreement import LEAST, correlation_table
from simnav.leaderboard.ranking.confinement import confinement_line
from simnav.leaderboard.ranking.failures import failure_table
from simnav.leaderboard.ranking.voyages import voyage_tables

from .console import Output

__all__ = ["show"]


def show(out: Output, request: SiteRequest) -> None:
    """Rank the results of a campaign and write the site."""
    with out.progress("site") as progress:
        made = site.of(replace(request, progress=progress))
    out.document(made.to_dict())
    out.print(*made.shown(), *failure_table(made.results))
    out.print(*filter(None, [confinement_line(made.results)]))
    out.print(*voyage_tables(made.voyages))
    if made.correlations:
        out.print(correlation_table(made.correlations))
    elif request.against is not None:
        out.note(f"simnav: no track of {request.against} has {LEAST} rows in common with one of {request.results}")
    out.print(f"site: {made.index}")
