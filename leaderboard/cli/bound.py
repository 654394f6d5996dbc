"""The command ``simnav bound``: the best that any estimator could do, by the posterior Cramer-Rao bound."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from simnav.leaderboard.cli.console import Output, absolute, mistakes, session
from simnav.leaderboard.ranking import tables

if TYPE_CHECKING:
    from simnav.estimators.bound import Bound

__all__ = ["register", "run"]

#: Epochs that the table shows.
_ROWS = 12


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("bound")(_command)


def _command(
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="A name or a TOML file; a simulated one.")],
    runs: Annotated[int, typer.Option("--runs", "-n", min=1, help="Seeds over which it is averaged.")] = 12,
    smoothed: Annotated[bool, typer.Option("--smoothed", help="The bound of smoothed output.")] = False,
    csv: Annotated[Path | None, typer.Option("--csv", help="Write every epoch to this file.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document, for machines.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Show the posterior Cramer-Rao bound of a scenario by epoch: clean, flags known, flags unknown (mix)."""
    with session(json, debug) as out:
        run(out, scenario, runs, csv, smoothed)


def run(out: Output, name: str, runs: int, csv: Path | None, smoothed: bool = False) -> None:
    """Compute the three bounds and show them."""
    from simnav.estimators.bound import KINDS, bound
    from simnav.scenario import load

    with mistakes(ValueError, FileNotFoundError):
        scenario = load(name)
        bounds: list[Bound] = []
        with out.progress(f"{scenario.id}, {runs} seeds", len(KINDS)) as progress:
            for k, kind in enumerate(KINDS):
                progress(k, note=kind)
                bounds.append(bound(scenario, range(runs), kind, smoothed))
            progress(len(KINDS))
    written = None if csv is None else _write(bounds, absolute(csv))
    out.document(
        {
            "scenario": scenario.id,
            "runs": runs,
            "smoothed": smoothed,
            "bounds": [{**b.summary(), "time": b.time.tolist(), "horizontal": b.horizontal.tolist()} for b in bounds],
            "csv": None if written is None else str(written),
        }
    )
    time = bounds[0].time
    rows = [
        [f"{time[i]:g}", *(tables.number(float(b.horizontal[i])) for b in bounds)]
        for i in np.unique(np.linspace(0, len(time) - 1, _ROWS).astype(int))
    ]
    rows.append(["whole run", *(tables.number(b.horizontal_rms) for b in bounds)])
    error = "horizontal error of smoothed output" if smoothed else "horizontal error"
    out.print(
        tables.table(
            f"{scenario.id}: bound on the RMS {error} [m], {runs} seeds",
            ["time [s]", "clean", "flags", "mix"],
            rows,
        )
    )
    out.print("clean: no faults; flags: faults known as they come; mix: only their statistics known")
    if written is not None:
        out.print(f"table: {written}")


def _write(bounds: list[Bound], path: Path) -> Path:
    """All epochs and components [m, m/s, rad] as CSV."""
    from simnav.types import COMPONENTS

    names = ["time", *(f"{b.kind}_{c}" for b in bounds for c in COMPONENTS)]
    values = np.column_stack([bounds[0].time, *(b.sigma for b in bounds)])
    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(path, values, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path
