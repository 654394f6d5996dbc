"""``simnav run``: estimators once over one scenario."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.arguments import require_folder, scenario_of
from simnav.leaderboard.figures.stanford import stanford_diagrams
from simnav.leaderboard.figures.style import save_as
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.running import run
from simnav.scoring.ending import ending

from .commands import RunCommand
from .console import FAILED, USER, Output
from .options import absolute, require_figure

__all__ = ["show"]


def show(out: Output, request: RunCommand) -> None:
    """Run estimators once over one scenario and score them."""
    if request.plot_lags is not None and request.lags is None:
        raise RequestError(
            "--plot-lags draws the error against the delay of the output: give delays, like --lags 1/5/10"
        )
    figures = (("--plot", request.plot), ("--plot-lags", request.plot_lags), ("--stanford", request.stanford))
    for option, path in figures:
        require_figure(option, path)
    if request.animate is not None and request.animate.suffix.lower() != ".gif":
        raise RequestError(f"--animate {request.animate}: the file should end in .gif")
    for option, path in (*figures, ("--animate", request.animate)):
        if path is not None:
            require_folder(f"{option} {path}", path)
    chosen = scenario_of(request.scenario)
    with out.progress(f"{chosen.id}, seed {request.seed}") as progress:
        report = run.of(replace(request, scenario=chosen, progress=progress))
    drawn = None
    if request.plot is not None and any(len(e.trial) for e in report.estimators):
        drawn = save_as(report.plot(), absolute(request.plot))
    moving = None
    if request.animate is not None and any(len(e.trial) for e in report.estimators):
        moving = report.animate(absolute(request.animate))
    delays = None
    if request.plot_lags is not None and any("_lag_" in name for e in report.estimators for name in e.scores):
        delays = save_as(report.plot_lags(), absolute(request.plot_lags))
    diagrams = {} if request.stanford is None else report.stanford(request.alert_limit)
    shown = None
    if request.stanford is not None and diagrams:
        title = f"{report.recording.scenario}, seed {request.seed}: alert limit {request.alert_limit:g} m"
        shown = save_as(stanford_diagrams(diagrams, title=title), absolute(request.stanford))
    elif request.stanford is not None:
        out.remark("no Stanford diagram: no estimator gave a covariance or a protection level")
    document = {**report.to_dict(), "plot": None if drawn is None else str(drawn)}
    if request.animate is not None:
        document["animate"] = None if moving is None else str(moving)
    if request.plot_lags is not None:
        document["plot_lags"] = None if delays is None else str(delays)
    if request.stanford is not None:
        integrity = {label: diagram.to_dict() for label, diagram in diagrams.items()}
        document |= {"stanford": integrity, "stanford_plot": None if shown is None else str(shown)}
    out.document(document)
    out.print(*report.shown())
    for e in report.estimators:
        if e.status != "ok":
            out.remark(f"{e.estimator}: {e.status}: {e.reason}")
        unseen = [f"{name} ({kind})" for name, kind in report.unseen(e).items()]
        if unseen:
            left = "it out" if len(unseen) == 1 else "them out"
            out.remark(f"{e.estimator} shows no innovation of {', '.join(unseen)}: most likely it leaves {left}")
    doubtful = [e.estimator for e in report.estimators if ending(e.status, e.scores) == "inconsistent"]
    if doubtful:
        out.remark(f"{', '.join(doubtful)}: the self-test says that the measurements contradict the estimate")
    if drawn is not None:
        out.print(f"figure: {drawn}")
    if moving is not None:
        out.print(f"moving picture: {moving}")
    if delays is not None:
        out.print(f"error against delay: {delays}")
    if shown is not None:
        out.print(f"Stanford diagrams: {shown}")
    if any(e.failed for e in report.estimators):
        out.code = FAILED
    elif all(e.status == "unsuitable" for e in report.estimators):
        out.code = USER
