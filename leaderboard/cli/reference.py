"""``simnav standard reference``: measure the fixed figures that the errors of scenarios are divided by."""

from __future__ import annotations

import math

from simnav.leaderboard.arguments import scenarios_of
from simnav.leaderboard.ranking import reference, tables
from simnav.leaderboard.ranking.reference_measurement import measure, save
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.results.store import StoreError

from .commands import ReferenceCommand
from .console import Output
from .options import absolute

__all__ = ["show"]


def _with_error(value: float, error: float) -> str:
    return f"{value:.3f} +- {error:.3f}" if math.isfinite(value) else ""


def show(out: Output, request: ReferenceCommand) -> None:
    """Run the oracles over many seeds, and store the figures that errors are divided by."""
    chosen = scenarios_of(request.scenarios, note=out.remark)
    file = reference.FILE if request.output is None else absolute(request.output)
    with mistakes(StoreError):
        with out.progress("starting") as bar:
            found = measure(
                chosen,
                request.runs,
                absolute(request.results),
                workers=request.workers,
                progress=bar,
                found=lambda f: save(f, file),
            )
        save(found, file)
    rows = [
        [
            scenario_id,
            score,
            r.estimator,
            r.runs,
            tables.number(r.value, 4),
            tables.number(r.spread),
            _with_error(r.to_bound, r.to_bound_error),
            _with_error(r.nees, r.nees_error),
        ]
        for scenario_id, scores in sorted(found.items())
        for score, r in scores.items()
    ]
    columns = ["scenario", "score", "estimator", "runs", "figure [m]", "log spread", "to bound", "NEES"]
    out.document({"file": str(file), "figures": {s: {n: vars(r) for n, r in x.items()} for s, x in found.items()}})
    out.print(tables.table("Reference figures", columns, rows, numeric=columns[3:]), f"stored: {file}")
