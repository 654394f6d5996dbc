"""``simnav sweep``: error against a dial of a scenario, and where estimators break."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.running import sweep

from .commands import SweepCommand
from .console import FAILED, Output
from .options import absolute, campaign_progress, require_figure

if TYPE_CHECKING:
    from simnav.leaderboard.sweep.report import Sweep

__all__ = ["show"]


def show(out: Output, request: SweepCommand) -> None:
    """Vary a quantity of a scenario (a dial): the error of estimators against it, and their breaking points."""
    require_figure("--plot", request.plot)
    with out.progress("starting") as bar:
        made = sweep.of(replace(request, progress=campaign_progress(bar)))
    written = None if request.plot is None else _draw(made, absolute(request.plot))
    out.document({**made.to_dict(), "figure": None if written is None else str(written)})
    out.print(*made.shown())
    if written is not None:
        out.print(f"figure:  {written}")
    summary = made.summary
    out.print(f"results: {summary.folder} ({summary.computed} computed, {summary.skipped} were there, "
              f"{tables.duration(summary.seconds)})")  # fmt: skip
    out.code = 0 if any(r.status == "ok" for r in made.results) else FAILED


def _draw(sweep: Sweep, path: Path) -> Path:

    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        return save_as(sweep.plot(), path)
