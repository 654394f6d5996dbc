"""``simnav bound``: the best that any estimator could do, by the posterior Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.inspection import bound
from simnav.leaderboard.results.errors import mistakes

from .commands import BoundCommand
from .console import Output
from .options import absolute

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.bounds import BoundReport

__all__ = ["show"]


def show(out: Output, request: BoundCommand) -> None:
    """Show the posterior Cramer-Rao bound of a scenario by epoch: without faults, faults known, faults unknown."""
    chosen = scenario_of(request.scenario)
    with out.progress(f"{chosen.id}, {request.runs} seeds") as progress:
        report = bound.of(replace(request, scenario=chosen, progress=progress))
    written = None if request.csv is None else _write(report, absolute(request.csv))
    out.document({**report.to_dict(), "csv": None if written is None else str(written)})
    out.print(*report.shown())
    out.print("clean: no faults; flags: faults known as they come; mix: only their statistics known")
    if written is not None:
        out.print(f"table: {written}")


def _write(report: BoundReport, path: Path) -> Path:
    """All epochs and components [m, m/s, rad] as CSV."""

    columns = report.columns()
    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        values = np.column_stack(list(columns.values()))
        np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path
