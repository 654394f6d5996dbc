"""``simnav run``: estimators once over one scenario."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.stanford import stanford_diagrams
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.given import scenario_of
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.running import run
from simnav.scoring.consistency import ending
from simnav.scoring.lagged import seconds_of

from .commands import RunCommand
from .console import FAILED, USER, Output
from .options import absolute, require_figure

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.single_run import RunReport

__all__ = ["show"]


def show(out: Output, request: RunCommand) -> None:
    """Run estimators once over one scenario and score them."""
    for option, path in (("--plot", request.plot), ("--stanford", request.stanford)):
        require_figure(option, path)
        if path is not None and not absolute(path).parent.is_dir():
            raise RequestError(f"{option} {path}: there is no folder {path.parent}")
    chosen = scenario_of(request.scenario)
    with out.progress(f"{chosen.id}, seed {request.seed}") as progress:
        report = run.of(replace(request, scenario=chosen, progress=progress))
    drawn = None
    if request.plot is not None and any(len(e.trial) for e in report.estimators):
        drawn = save_as(report.plot(), absolute(request.plot))
    diagrams = {} if request.stanford is None else report.stanford(request.alert_limit)
    shown = None
    if request.stanford is not None and diagrams:
        title = f"{report.recording.scenario}, seed {request.seed}: alert limit {request.alert_limit:g} m"
        shown = save_as(stanford_diagrams(diagrams, title=title), absolute(request.stanford))
    elif request.stanford is not None:
        out.remark("no Stanford diagram: no estimator gave a covariance or a protection level")
    document = {**report.to_dict(), "plot": None if drawn is None else str(drawn)}
    if request.stanford is not None:
        integrity = {label: diagram.to_dict() for label, diagram in diagrams.items()}
        document |= {"stanford": integrity, "stanford_plot": None if shown is None else str(shown)}
    out.document(document)
    out.print(_table(report))
    if any("_lag_" in name for e in report.estimators for name in e.scores):
        out.print(_late(report))
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


def _late(report: RunReport) -> tables.Fitted:
    """Horizontal RMSE against the delay of the output: a row an estimator, a column a lag."""
    base = "horizontal_rmse"
    names = {n for e in report.estimators for n in e.scores if n.startswith(f"{base}_lag_")}
    lags = sorted(names, key=lambda name: seconds_of(name.rpartition("_")[2]))
    columns = ["estimator", "newest", *(f"{seconds_of(n.rpartition('_')[2]):g} s late" for n in lags)]
    cells = [[e.estimator, *(tables.number(e.scores.get(s)) for s in (base, *lags))] for e in report.estimators]
    return tables.Fitted("Horizontal RMSE [m] of an output that is late", columns, cells, columns, numeric=columns[1:])


def _table(report: RunReport) -> tables.Fitted:
    """Scores of the estimators, the best horizontal RMSE first."""

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
