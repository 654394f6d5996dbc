"""``simnav log realism``: whether simulated errors are like real ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.inspection import realism
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import mistakes

from .commands import RealismCommand
from .console import Output
from .options import absolute, require_figure

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.realism.report import RealismReport

__all__ = ["show"]


def show(out: Output, request: RealismCommand) -> None:
    """Compare the errors of simulated instruments with those of a recording."""
    require_figure("--plot", request.plot)
    report = realism.of(request)
    drawn = None if request.plot is None else save_as(report.plot(), absolute(request.plot))
    written = None if request.fit is None else _write(report.toml(), absolute(request.fit))
    files = {"plot": None if drawn is None else str(drawn), "fit_file": None if written is None else str(written)}
    out.document({**report.to_dict(), **files})
    out.print(_verdicts(report))
    if report.rows():
        out.print(_components(report))
    if written is None:
        out.print(report.toml())
    for name, file in files.items():
        if file is not None:
            out.print(f"{'figure' if name == 'plot' else 'parameters that fit'}: {file}")


def _verdicts(report: RealismReport) -> Table:
    rows = []
    for one in report.instruments:
        low, high = one.verdict.interval
        by = ", ".join(f"{name} ({value:.2f})" for name, value in one.telling())
        parts = " (parts of a recording)" if one.verdict.parts else ""
        count = f"{one.windows[0]}{parts}, {one.windows[1]}"
        rows.append([one.name, f"{one.verdict.auc:.2f} ({low:.2f} – {high:.2f})", count, by])
    title = f"{report.scenario} beside {report.log}: can a classifier tell them apart? 0.5: no, 1: always"
    return tables.table(title, ["instrument", "AUC (95 %)", "windows: real, simulated", "by"], rows)


def _components(report: RealismReport) -> Table:
    rows = []
    for row in report.rows():
        cells = [row["instrument"], row["component"]]
        cells.append(f"{tables.number(row['sd'])} / {tables.number(row['sd_simulated'])} {row['unit']}")
        for name in row:
            if name.startswith("autocorrelation") and not name.endswith("simulated"):
                cells.append(f"{row[name]:.2f} / {row[f'{name}_simulated']:.2f}")
        rows.append([*cells, "yes" if row["close"] else "no"])
    head = ["instrument", "component", "SD", "autocorrelation at 1 s", "10 s", "60 s", "close"]
    return tables.table("Real / simulated. Close: SD within 20 %, autocorrelations within 0.15", head, rows)


def _write(text: str, path: Path) -> Path:
    with mistakes(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return path
