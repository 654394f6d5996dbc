"""``simnav tune-noise``: noise figures for the datasheets of a log."""

from __future__ import annotations

from simnav.leaderboard.given import scenario_of
from simnav.leaderboard.ranking import tables
from simnav.leaderboard.requests import TuneNoiseRequest
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.log.alignment import align
from simnav.log.noise_figures import noise_figures

from .console import Output

__all__ = ["show"]


def show(out: Output, request: TuneNoiseRequest) -> None:
    """Propose noise figures for the datasheets of a log."""
    scenario = scenario_of(request.scenario)
    if scenario.log is None:
        raise RequestError(f"{scenario.id} has no [log]: it is simulated, and its datasheets are what it says")
    with mistakes(ValueError, OSError):
        found = noise_figures(scenario, align(scenario, request.seed), request.seed)
    out.document({"scenario": scenario.id, "figures": [vars(f) for f in found]})
    rows = [
        [f.key, ", ".join(f"{v:.3g}" for v in f.value), ", ".join(f"{v:.3g}" for v in f.now), f.basis] for f in found
    ]
    out.print(tables.table(f"noise figures for {scenario.id}", ["key", "the log says", "now", "from"], rows))
