"""``simnav log allan``: the Allan deviation of an IMU."""

from __future__ import annotations

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.inspection import allan

from .commands import AllanCommand
from .console import Output
from .options import absolute, require_figure, write_columns

__all__ = ["show"]


def show(out: Output, request: AllanCommand) -> None:
    """Show the Allan deviation of an IMU and its noise coefficients, beside its datasheet."""
    require_figure("--plot", request.plot)
    report = allan.of(request)
    drawn = None if request.plot is None else save_as(report.plot(), absolute(request.plot))
    written = None if request.csv is None else write_columns(report.columns(), absolute(request.csv))
    files = {"plot": None if drawn is None else str(drawn), "csv": None if written is None else str(written)}
    out.document({**report.to_dict(), **files})
    out.print(*report.shown())
    out.print("in brackets: datasheet; lowest: of the Allan deviation, at its averaging time")
    for name, file in files.items():
        if file is not None:
            out.print(f"{'figure' if name == 'plot' else 'table'}: {file}")
