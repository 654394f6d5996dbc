"""``simnav sweep``: error against a dial of a scenario, and where estimators break."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.ranking_table import between
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.running import sweep
from simnav.leaderboard.sweep.report import axis_label
from simnav.scoring import SCORES

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
    out.print(_errors(made), _breaking(made))
    if written is not None:
        out.print(f"figure:  {written}")
    summary = made.summary
    out.print(f"results: {summary.folder} ({summary.computed} computed, {summary.skipped} were there, "
              f"{tables.duration(summary.seconds)})")  # fmt: skip
    out.code = 0 if any(r.status == "ok" for r in made.results) else FAILED


def _figure(x: float) -> str:
    return "failed" if math.isinf(x) else tables.number(x)


def _errors(sweep: Sweep) -> tables.Fitted:
    """A row an estimator and setting."""

    at = {(p.estimator, p.values): p for p in sweep.points}
    rows = []
    for e in sweep.estimators:
        for setting in sweep.settings:
            p = at[e, setting.values]
            failed = f"{p.failed} of {p.runs}" if p.failed else ""
            dials = [f"{v:g}" for v in setting.values]
            rows.append([e, *dials, _figure(p.error.value), between(p.error.low, p.error.high), failed])
    score, dials = SCORES[sweep.score], [axis_label(d) for d in sweep.dials]
    return tables.Fitted(
        f"{sweep.scenario}: {score.title}, median of the runs",
        ["estimator", *dials, f"error [{score.unit}]", "95 % interval", "failed"],
        rows,
        ["estimator", *dials, f"error [{score.unit}]", "95 % interval", "failed"],
        always=2 + len(dials),
        numeric=[*dials, f"error [{score.unit}]"],
    )


def _breaking(sweep: Sweep) -> tables.Fitted:
    """Where each estimator breaks."""

    beyond = f"beyond {sweep.values[0][-1]:g}"

    def figure(x: float) -> str:
        return "–" if math.isnan(x) else beyond if math.isinf(x) else f"{x:.3g}"

    rows = []
    for b in sweep.breaking_points:
        words = "twice its clean error" if b.criterion == "twice-clean" else "the limit"
        interval = f"{figure(b.value.low)} to {figure(b.value.high)}" if not math.isnan(b.value.low) else ""
        passes = f"{words}, {tables.number(b.threshold)}"
        rows.append([b.estimator, *([] if b.at is None else [f"{b.at:g}"]), passes, figure(b.value.value), interval])
    second = [axis_label(sweep.dials[1])] if len(sweep.dials) == 2 else []
    at = f"at: {axis_label(sweep.dials[0])}"
    columns = ["estimator", *second, "passes", at, "95 % interval"]
    value = ["estimator", at, *second, "95 % interval", "passes"]
    return tables.Fitted("Breaking points", columns, rows, value, always=2 + len(second), numeric=[*second, at])


def _draw(sweep: Sweep, path: Path) -> Path:

    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        return save_as(sweep.plot(), path)
