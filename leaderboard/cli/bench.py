"""``simnav bench``: time and memory of an epoch, and processor time as a multiple of that of the plain row."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.costing import bench, costs
from simnav.leaderboard.results.errors import RequestError

from .commands import BenchCommand
from .console import FAILED, Output

__all__ = ["show"]


def show(out: Output, request: BenchCommand) -> None:
    """Measure time and memory of an epoch, and processor time as a multiple of that of the plain row."""
    if request.every:
        if request.estimators or request.against or request.parameters:
            raise RequestError("--all measures the rows that come with simnav; leave out names, --against and --set")
        _all(out, request)
        return
    if request.output is not None:
        raise RequestError("--output goes with --all; 'simnav bench --json' prints what was measured of other rows")
    if not request.estimators:
        raise RequestError("no estimator was asked for; name one or several, or use --all")
    with out.progress("measuring") as bar:
        report = bench.of(replace(request, progress=bar))
    out.document(report.to_dict())
    out.print(*report.shown())
    out.print(*(f"{c.estimator}: {c.status}: {c.reason}" for c in report.costs if c.status != "ok"))
    out.print("time: processor time of update(); memory: from construction to smooth(), measurements aside")
    measured = {m.estimator for m in report.multiples.rows}
    failed = [c for c in report.costs if c.estimator in report.estimators and c.status != "ok"]
    if any(c.status == "error" or c.estimator not in measured for c in failed):
        out.code = FAILED


def _all(out: Output, request: BenchCommand) -> None:
    """Measure the rows that come with simnav."""
    with out.progress("measuring") as bar:
        report = costs(
            scenario=request.scenario, seed=request.seed, epochs=request.epochs, rounds=request.rounds,
            output=request.output, progress=bar,
        )  # fmt: skip
    out.document(report.to_dict())
    out.print(*report.shown())
    out.print(*(f"{u.estimator}: {u.status}: {u.reason}" for u in report.unmeasured))
    if report.file:
        out.print(f"stored: {report.file}")
    if report.unmeasured:
        out.code = FAILED
