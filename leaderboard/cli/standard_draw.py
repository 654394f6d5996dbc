"""``simnav standard draw``: the curves and sweeps that come with simnav."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.publishing import draw_standard
from simnav.leaderboard.publishing_requests import DrawRequest

from .console import Output
from .options import campaign_progress

__all__ = ["show"]


def show(out: Output, request: DrawRequest) -> None:
    """Run what the site of the standard result draws, and keep it where it comes with simnav."""
    with out.progress("starting") as bar:
        made = draw_standard.of(replace(request, progress=campaign_progress(bar)))
    out.document(made.to_dict())
    kept = f"{made.results} results with series, {made.sweeps} sweeps, {made.backgrounds} recordings"
    out.print(
        f"drawn:   {made.folder} ({kept}, {made.size / 2**20:.1f} MiB)",
        f"runs:    {made.computed} computed, {made.left} are left",
        "next:    simnav standard draw" if made.left else "next:    simnav standard publish",
    )
