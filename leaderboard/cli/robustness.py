"""``simnav robustness``: error beside that of the plain row when a datasheet is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.running import robustness

from .commands import RobustnessCommand
from .console import FAILED, Output
from .options import absolute, campaign_progress, require_figure

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.sweep.datasheets import Robustness

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
    out.print(_table(made))
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


def _table(made: Robustness) -> Table:
    """A row an estimator and plain row: the ratio with true datasheets, and the worst one for each instrument."""
    names = list(dict.fromkeys(p.instrument for row in made.rows for p in row.points))
    rows = []
    for row in made.rows:
        true = next((p.ratio for p in row.points if p.factor == 1.0), None)
        cells = []
        for name in names:
            wrong = [p for p in row.points if p.instrument == name and p.factor != 1.0]
            worst = max(wrong, key=lambda p: p.ratio, default=None)
            cells.append("" if worst is None else f"{tables.number(worst.ratio)} at {worst.factor:.3g}")
        failed = sum(p.failed for p in row.points if p.factor != 1.0)
        rows.append([row.estimator, row.plain, tables.number(true), *cells, str(failed) if failed else ""])
    return tables.table(
        "Error over that of the plain row; for each instrument the worst ratio, and datasheet over truth there",
        ["estimator", "plain row", "true datasheets", *names, "failed"],
        rows,
        numeric=("true datasheets", *names, "failed"),
        caption="Geometric mean over the seeds. The plain row is told the same wrong datasheet.",
    )
