"""``simnav run``: estimators once over one scenario."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simnav.leaderboard.cli.console import FAILED, USER, session
from simnav.leaderboard.cli.options import Debug, Estimators, Json, ScenarioName, Seed, Set, absolute, parameters
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.single_run import RunReport

__all__ = ["command"]


def command(
    scenario: ScenarioName,
    estimator: Estimators = None,
    seed: Seed = 0,
    plot: Annotated[Path | None, typer.Option(help="Write a figure: .png, .svg or .pdf.")] = None,
    stanford: Annotated[
        Path | None, typer.Option(help="Write Stanford diagrams, error beside protection level: .png, .svg or .pdf.")
    ] = None,
    alert_limit: Annotated[
        float,
        typer.Option(min=0.01, help="Alert limit of the Stanford diagrams in metres; IMO A.915(22): 25, in ports 2.5."),
    ] = 25.0,
    set_: Set = None,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Run estimators once over one scenario and score them."""
    with session(json, debug) as out:
        from simnav.leaderboard import interface

        for option, path in (("--plot", plot), ("--stanford", stanford)):
            if path is not None and path.suffix not in (".png", ".svg", ".pdf"):
                raise RequestError(f"{option} {path}: the file should end in .png, .svg or .pdf")
            if path is not None and not path.expanduser().resolve().parent.is_dir():
                raise RequestError(f"{option} {path}: there is no folder {path.parent}")
        chosen = interface.scenario_of(scenario)
        with out.progress(f"{chosen.id}, seed {seed}") as progress:
            report = interface.run(chosen, estimator, seed=seed, parameters=parameters(set_), progress=progress)
        drawn = None
        if plot is not None and any(len(e.trial) for e in report.estimators):
            from simnav.leaderboard.figures.style import save_as

            drawn = save_as(report.plot(), absolute(plot))
        diagrams = {} if stanford is None else report.stanford(alert_limit)
        shown = None
        if stanford is not None and diagrams:
            from simnav.leaderboard.figures.stanford import stanford_diagrams
            from simnav.leaderboard.figures.style import save_as

            title = f"{report.recording.scenario}, seed {seed}: alert limit {alert_limit:g} m"
            shown = save_as(stanford_diagrams(diagrams, title=title), absolute(stanford))
        elif stanford is not None:
            out.remark("no Stanford diagram: no estimator gave a covariance or a protection level")
        document = {**report.to_dict(), "plot": None if drawn is None else str(drawn)}
        if stanford is not None:
            integrity = {label: diagram.to_dict() for label, diagram in diagrams.items()}
            document |= {"stanford": integrity, "stanford_plot": None if shown is None else str(shown)}
        out.document(document)
        out.print(_table(report))
        for e in report.estimators:
            if e.status != "ok":
                out.remark(f"{e.estimator}: {e.status}: {e.reason}")
            unseen = [f"{name} ({kind})" for name, kind in report.unseen(e).items()]
            if unseen:
                left = "it out" if len(unseen) == 1 else "them out"
                out.remark(f"{e.estimator} shows no innovation of {', '.join(unseen)}: most likely it leaves {left}")
        if drawn is not None:
            out.print(f"figure: {drawn}")
        if shown is not None:
            out.print(f"Stanford diagrams: {shown}")
        if any(e.trial.failed for e in report.estimators):
            out.code = FAILED
        elif all(e.status == "unsuitable" for e in report.estimators):
            out.code = USER


def _table(report: RunReport) -> tables.Fitted:
    """Scores of the estimators, the best horizontal RMSE first."""
    from simnav.scoring.consistency import ending

    def order(k: int) -> tuple[bool, float]:
        value = report.estimators[k].scores.get("horizontal_rmse", math.inf)
        return report.estimators[k].status != "ok", value if math.isfinite(value) else math.inf

    ordered = [report.estimators[k] for k in sorted(range(len(report.estimators)), key=order)]
    plain = ("horizontal_rmse", "r95", "horizontal_max", "vertical_rmse", "velocity_horizontal_rmse")
    cells = [
        [e.estimator + (" *" if e.reference else ""), ending(e.status, e.scores),
         *(tables.number(e.scores.get(s)) for s in plain),
         tables.number(math.degrees(e.scores.get("heading_rmse", math.nan))),
         tables.number(e.scores.get("nees_horizontal")), tables.percent(e.scores.get("coverage_95")),
         tables.duration(e.scores.get("update_median"))]
        for e in ordered
    ]  # fmt: skip
    columns = ["estimator", "status", "horizontal RMSE [m]", "R95 [m]", "max [m]", "vertical RMSE [m]",
               "velocity RMSE [m/s]", "heading RMSE [deg]", "NEES/dof", "95 % coverage", "per epoch"]  # fmt: skip
    recording = report.recording
    note = f"; {recording.note}" if recording.note else ""
    reference = [i for i, e in enumerate(ordered) if e.reference]
    return tables.Fitted(
        f"{recording.scenario}, seed {recording.seed}, {tables.duration(recording.duration)}{note}",
        columns,
        cells,
        [
            "estimator",
            "horizontal RMSE [m]",
            "status",
            "R95 [m]",
            "NEES/dof",
            "max [m]",
            "heading RMSE [deg]",
            "per epoch",
        ],
        numeric=columns[2:],
        dim=reference,
        caption="* reference: it is told the truth" if reference else None,
    )
