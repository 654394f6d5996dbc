"""``simnav bound``: the best that any estimator could do, by the posterior Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.inspection import bound

from .commands import BoundCommand
from .console import Output
from .options import absolute, write_columns

__all__ = ["show"]


def show(out: Output, request: BoundCommand) -> None:
    """Show the posterior Cramer-Rao bound of a scenario by epoch: without faults, faults known, faults unknown."""
    chosen = scenario_of(request.scenario)
    with out.progress(f"{chosen.id}, {request.runs} seeds") as progress:
        report = bound.of(replace(request, scenario=chosen, progress=progress))
    written = None if request.csv is None else write_columns(report.columns(), absolute(request.csv))
    out.document({**report.to_dict(), "csv": None if written is None else str(written)})
    out.print(*report.shown())
    out.print("clean: no faults; flags: faults known as they come; mix: only their statistics known")
    if written is not None:
        out.print(f"table: {written}")
