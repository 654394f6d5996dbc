"""``simnav score``: estimates that were made elsewhere, with the scores of a run."""

from __future__ import annotations

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.logs import score_files

from .commands import ScoreCommand
from .console import FAILED, Output
from .options import absolute, require_figure

__all__ = ["show"]


def show(out: Output, request: ScoreCommand) -> None:
    """Score estimates that were made elsewhere."""
    require_figure("--plot", request.plot)
    report = score_files.of(request)
    drawn = None
    if request.plot is not None and any(len(e.trial) for e in report.estimators):
        drawn = save_as(report.plot(), absolute(request.plot))
    out.document({**report.to_dict(), "plot": None if drawn is None else str(drawn)})
    out.print(*report.shown())
    for e in report.estimators:
        if e.status != "ok":
            out.remark(f"{e.estimator}: {e.status}: {e.reason}")
    if drawn is not None:
        out.print(f"figure: {drawn}")
    if any(e.failed for e in report.estimators):
        out.code = FAILED
