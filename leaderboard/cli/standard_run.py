"""``simnav standard run``: the missing and outdated parts of the result that comes with simnav."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.publishing import run_standard
from simnav.leaderboard.publishing_requests import StandardRequest

from .console import Output
from .options import campaign_progress

__all__ = ["show"]


def show(out: Output, request: StandardRequest) -> None:
    """Run the missing and outdated parts of the standard result."""
    with out.progress("starting") as bar:
        report = run_standard.of(replace(request, progress=campaign_progress(bar)))
    s = report.summary
    out.document({"results": str(s.folder), "computed": s.computed, "skipped": s.skipped, "left": s.left})
    out.print(
        f"results: {s.folder} ({s.computed} computed, {s.skipped} were there, {s.left} are left)",
        "next:    simnav standard run" if s.left else "next:    simnav standard publish",
    )
