"""``simnav bound``: the best that any estimator could do, by the posterior Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simnav.leaderboard.given import scenario_of
from simnav.leaderboard.inspection import bound
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes

from .commands import BoundCommand
from .console import Output
from .options import absolute

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.ranking.bounds import BoundReport

__all__ = ["show"]

#: Epochs that the table shows.
_ROWS = 12


def show(out: Output, request: BoundCommand) -> None:
    """Show the posterior Cramer-Rao bound of a scenario by epoch: without faults, faults known, faults unknown."""
    chosen = scenario_of(request.scenario)
    with out.progress(f"{chosen.id}, {request.runs} seeds") as progress:
        report = bound.of(replace(request, scenario=chosen, progress=progress))
    written = None if request.csv is None else _write(report, absolute(request.csv))
    out.document({**report.to_dict(), "csv": None if written is None else str(written)})
    out.print(_table(report))
    out.print("clean: no faults; flags: faults known as they come; mix: only their statistics known")
    if written is not None:
        out.print(f"table: {written}")


def _table(report: BoundReport) -> Table:
    """A dozen epochs and the whole run."""

    shown = np.unique(np.linspace(0, len(report.time) - 1, _ROWS).astype(int))
    rows = [[f"{report.time[i]:g}", *(tables.number(float(b.horizontal[i])) for b in report.bounds)] for i in shown]
    rows.append(["whole run", *(tables.number(b.horizontal_rms) for b in report.bounds)])
    error = "horizontal error of smoothed output" if report.smoothed else "horizontal error"
    title = f"{report.scenario}: bound on the RMS {error} [m], {report.runs} seeds"
    return tables.table(title, ["time [s]", "clean", "flags", "mix"], rows)


def _write(report: BoundReport, path: Path) -> Path:
    """All epochs and components [m, m/s, rad] as CSV."""

    columns = report.columns()
    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        values = np.column_stack(list(columns.values()))
        np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path
