"""``simnav log tune-noise``: noise figures for the datasheets of a log."""

from __future__ import annotations

from dataclasses import replace

from simnav.leaderboard.arguments import scenario_of
from simnav.leaderboard.log_requests import TuneNoiseRequest
from simnav.leaderboard.logs import tune_noise
from simnav.leaderboard.ranking import tables

from .console import Output

__all__ = ["show"]


def show(out: Output, request: TuneNoiseRequest) -> None:
    """Propose noise figures for the datasheets of a log."""
    scenario = scenario_of(request.scenario)
    found = tune_noise.of(replace(request, scenario=scenario))
    out.document({"scenario": scenario.id, "figures": [vars(f) for f in found]})
    rows = [
        [f.key, ", ".join(f"{v:.3g}" for v in f.value), ", ".join(f"{v:.3g}" for v in f.now), f.basis] for f in found
    ]
    out.print(tables.table(f"noise figures for {scenario.id}", ["key", "the log says", "now", "from"], rows))
