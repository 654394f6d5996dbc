"""``simnav robustness``: error beside that of the plain row when a datasheet is wrong."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.running import robustness

from .commands import RobustnessCommand
from .console import FAILED, Output
from .options import absolute, campaign_progress, require_figure

__all__ = ["show"]


def show(out: Output, request: RobustnessCommand) -> None:
    """Compare estimators with the plain row when a datasheet is wrong: robustness profiles."""
    require_figure("--plot", request.plot)
    with out.progress("starting") as bar:
        made = robustness.of(replace(request, progress=campaign_progress(bar)))
    written = None
    if request.plot is not None:
        path = absolute(request.plot)
        with mistakes(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            written = save_as(made.plot(), path)
    out.document({**made.to_dict(), "figure": None if written is None else str(written)})
    out.print(*made.shown())
    if made.unsuitable:
        out.print(f"neither scenario suits: {', '.join(made.unsuitable)}")
    if written is not None:
        out.print(f"figure:  {written}")
    if made.file:
        out.print(f"stored:  {made.file}")
    summary = made.summary
    out.print(f"results: {summary.folder} ({summary.computed} computed, {summary.skipped} were there, "
              f"{tables.duration(summary.seconds)})")  # fmt: skip
    out.code = 0 if made.rows else FAILED
