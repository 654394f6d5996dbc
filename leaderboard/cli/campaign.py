"""``simnav campaign``: scenarios x estimators x seeds."""

from __future__ import annotations

from dataclasses import replace
from shlex import quote

from simnav.leaderboard.arguments import scenarios_of
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.confinement import confinement_line
from simnav.leaderboard.ranking.failures import failure_table
from simnav.leaderboard.ranking.ranking_table import ranking_tables
from simnav.leaderboard.requests import CampaignRequest
from simnav.leaderboard.running import campaign

from .console import FAILED, Output
from .options import campaign_progress

__all__ = ["show"]


def show(out: Output, request: CampaignRequest) -> None:
    """Run estimators on scenarios and seeds. Started again, the campaign continues."""
    if request.scenarios or request.profile is None:
        request = replace(request, scenarios=scenarios_of(request.scenarios, note=out.remark))
    with out.progress("starting") as bar:
        report = campaign.of(replace(request, progress=campaign_progress(bar)))
    summary = report.summary
    out.document(report.to_dict())
    out.print(*ranking_tables(report.ranking), *failure_table(report.results))
    out.print(*filter(None, [confinement_line(report.results)]))
    if summary.left:
        out.print(f"{summary.left} of {summary.total} runs are left; the same command continues")
    out.print(f"results: {summary.folder} ({summary.computed} computed, {summary.skipped} were there, "
              f"{tables.duration(summary.seconds)})",
              f"next:    simnav leaderboard {quote(str(summary.folder))}")  # fmt: skip
    out.code = 0 if any(r.status == "ok" for r in report.results) else FAILED
