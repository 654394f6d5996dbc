"""``simnav evaluate``: estimators beside the baselines on the same seeds."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.arguments import scenarios_of
from simnav.leaderboard.ranking.failures import failure_table
from simnav.leaderboard.requests import EvaluateRequest
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.running import evaluate

from .console import FAILED, Output
from .options import campaign_progress

__all__ = ["show"]


def show(out: Output, request: EvaluateRequest) -> None:
    """Compare estimators with the baselines on the same seeds."""
    request = replace(request, scenarios=scenarios_of(request.scenarios, note=out.remark))
    with out.progress("starting") as bar:
        report = evaluate.of(replace(request, progress=campaign_progress(bar)))
    out.document(report.to_dict())
    out.print(*report.shown(), *failure_table(report.results), *report.verdicts)
    for label in report.estimators:
        own = [r for r in report.results if r.estimator == label]
        if own and all(r.status == "unsuitable" for r in own):
            raise RequestError(f"{label} cannot run on {', '.join(sorted(report.scenarios))}: {own[0].reason}")
        if any(r.tried and r.status != "ok" for r in own):
            out.code = FAILED
