"""``simnav tune``: choose parameters of an estimator on training families."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.cli.console import session
from simnav.leaderboard.cli.options import Debug, FirstSeed, Json, Set, absolute, parameters
from simnav.leaderboard.ranking import tables

if TYPE_CHECKING:
    from rich.table import Table

    from simnav.leaderboard.tuning.tuning import Method, Tuning

__all__ = ["command"]

_METHODS: dict[str, Method] = {"differential-evolution": "differential-evolution", "nelder-mead": "nelder-mead"}


def command(
    estimator: Annotated[str, typer.Argument(metavar="ESTIMATOR", help="A name, or a file like my_filter.py.")],
    family: Annotated[
        list[str] | None,
        typer.Option(
            "--family", "-f", help="Training families, separated by commas. Default: training-voyages,training-clean."
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH",
            help="A parameter and its bounds; :log or :integer may follow. Default: those of the stored tuning.",
        ),
    ] = None,
    runs: Annotated[int, typer.Option("--runs", "-n", min=2, help="Voyages of each family for the search.")] = 20,
    unseen: Annotated[int, typer.Option(min=2, help="Voyages of each family for the comparison.")] = 20,
    evaluations: Annotated[int, typer.Option(min=2, help="Evaluations of the objective.")] = 40,
    method: Annotated[str, typer.Option(help="differential-evolution or nelder-mead.")] = "differential-evolution",
    seed: FirstSeed = 0,
    search_seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    set_: Set = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the chosen values to this file.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write a figure of the search: .png, .svg or .pdf.")] = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Choose parameters of an estimator on training families, never on ranked scenarios."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface
        from simnav.leaderboard.results.errors import RequestError

        if method not in _METHODS:
            raise RequestError(f"--method {method}: it should be one of {', '.join(_METHODS)}")
        if plot is not None and plot.suffix not in (".png", ".svg", ".pdf"):
            raise RequestError(f"--plot {plot}: the file should end in .png, .svg or .pdf")
        with out.progress(f"tuning {estimator}") as progress:
            found = interface.tune(
                (estimator, parameters(set_)) if set_ else estimator,
                ",".join(family) if family else ("training-voyages", "training-clean"),
                ",".join(vary) if vary else None,
                runs=runs, unseen=unseen, seed=seed, evaluations=evaluations, method=_METHODS[method],
                search_seed=search_seed, progress=progress,
            )  # fmt: skip
        written = None if output is None else found.write(absolute(output))
        drawn = None
        if plot is not None:
            from simnav.leaderboard.figures.style import save_as

            drawn = save_as(found.plot(), absolute(plot))
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
