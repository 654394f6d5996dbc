"""``simnav bound``: the best that any estimator could do, by the posterior Cramer-Rao bound."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, Json, absolute
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.ranking.bounds import BoundReport

__all__ = ["command"]

#: Epochs that the table shows.
_ROWS = 12


def command(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="A name or a TOML file; a simulated one.")],
    runs: Annotated[int, typer.Option("--runs", "-n", min=1, help="Seeds over which it is averaged.")] = 12,
    smoothed: Annotated[
        bool, typer.Option("--smoothed", help="Bound of smoothed output, not of real-time output.")
    ] = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write every epoch to this file.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Show the posterior Cramer-Rao bound of a scenario by epoch: without faults, faults known, faults unknown."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        chosen = interface.scenario_of(scenario)
        with out.progress(f"{chosen.id}, {runs} seeds") as progress:
            report = interface.bound(chosen, runs=runs, smoothed=smoothed, progress=progress)
        written = None if csv is None else _write(report, absolute(csv))
        out.document({**report.to_dict(), "csv": None if written is None else str(written)})
        out.print(_table(report))
        out.print("clean: no faults; flags: faults known as they come; mix: only their statistics known")
        if written is not None:
            out.print(f"table: {written}")


def _table(report: BoundReport) -> Table:
    """A dozen epochs and the whole run."""
    import numpy as np

    shown = np.unique(np.linspace(0, len(report.time) - 1, _ROWS).astype(int))
    rows = [[f"{report.time[i]:g}", *(tables.number(float(b.horizontal[i])) for b in report.bounds)] for i in shown]
    rows.append(["whole run", *(tables.number(b.horizontal_rms) for b in report.bounds)])
    error = "horizontal error of smoothed output" if report.smoothed else "horizontal error"
    title = f"{report.scenario}: bound on the RMS {error} [m], {report.runs} seeds"
    return tables.table(title, ["time [s]", "clean", "flags", "mix"], rows)


def _write(report: BoundReport, path: Path) -> Path:
    """All epochs and components [m, m/s, rad] as CSV."""
    import numpy as np

    columns = report.columns()
    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        values = np.column_stack(list(columns.values()))
        np.savetxt(path, values, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    return path
