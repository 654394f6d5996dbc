"""``simnav evaluate``: estimators beside the baselines on the same seeds."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.given import scenarios_of
from simnav.leaderboard.ranking.failures import failure_table
from simnav.leaderboard.ranking.ranking_table import ranking_tables
from simnav.leaderboard.ranking.standing import standing_table
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
    if len(report.scenarios) > 1:
        out.print(*ranking_tables(report.ranking, report.estimators))
    for stand in report.standings:
        out.print(standing_table(stand))
    out.print(*failure_table(report.results))
    plain = {s: t.plain for t in report.ranking.tracks for s in t.scenarios}
    out.print(*(stand.verdict(plain.get(stand.scenario, "")) for stand in report.standings))
    for label in report.estimators:
        own = [r for r in report.results if r.estimator == label]
        if own and all(r.status == "unsuitable" for r in own):
            raise RequestError(f"{label} does not suit {', '.join(sorted(report.scenarios))}: {own[0].reason}")
        if any(r.tried and r.status != "ok" for r in own):
            out.code = FAILED
