"""``simnav tune``: choose parameters of an estimator on training families."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.running import tune

from .commands import TuneCommand
from .console import Output
from .options import absolute, require_figure

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.tuning.tuning import Tuning

__all__ = ["show"]


def show(out: Output, request: TuneCommand) -> None:
    """Choose parameters of an estimator on training families, never on ranked scenarios."""
    if request.method not in ("differential-evolution", "nelder-mead"):
        raise RequestError(f"--method {request.method}: it should be one of differential-evolution, nelder-mead")
    require_figure("--plot", request.plot)
    if request.parameters:
        request = replace(request, estimator=(str(request.estimator), request.parameters))
    with out.progress(f"tuning {request.estimator}") as progress:
        found = tune.of(replace(request, progress=progress))
    written = None if request.output is None else found.write(absolute(request.output))
    drawn = None if request.plot is None else save_as(found.plot(), absolute(request.plot))
    out.document(found.to_dict() | {"file": None if written is None else str(written)})
    out.print(_table(found))
    chosen = ", ".join(f"{name} {found.present[name]:g} -> {value:g}" for name, value in found.chosen.items())
    out.print(f"chosen: {chosen}" if found.chosen != dict(found.present) else "the present values are the best")
    if found.chosen != dict(found.present) and not found.holds:
        out.print("on the unseen voyages it is no better: keep the present values, or search over more voyages")
    for what, path in (("file", written), ("figure", drawn)):
        if path is not None:
            out.print(f"{what}: {path}")


def _table(found: Tuning) -> Table:
    """Objective and ratios before and after, on the voyages of the search and on unseen ones."""
    first, last = found.seeds
    begin, end = found.unseen_seeds
    rows = []
    for label, figures in (
        (f"before, seeds {first} to {last}", found.before),
        (f"after, seeds {first} to {last}", found.after),
        (f"before, unseen seeds {begin} to {end}", found.unseen_before),
        (f"after, unseen seeds {begin} to {end}", found.unseen_after),
    ):
        ratios = [tables.number(figures.ratio[family]) for family in found.families]
        rows.append([label, f"{figures.objective:.4f}", *ratios, tables.percent(figures.lost), str(figures.failed)])
    families = [family.rpartition("-v")[0] for family in found.families]
    columns = ["voyages", "objective", *families, "over 1.5", "failed"]
    title = f"{found.estimator}: error over the plain filter's, geometric mean"
    return tables.table(title, columns, rows, numeric=columns[1:])
