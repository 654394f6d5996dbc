"""Calls that measure what an estimator costs: the time and memory of an epoch, and the multiple of the plain row."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.request import EstimatorRequest, requests, together
from simnav.leaderboard.results.errors import RequestError, mistakes

from .arguments import absolute, require_folder, scenario_of
from .calls import call, whole_number
from .requests import BenchRequest, CostsRequest, ScenarioLike

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.costs import CostReport, MultipleReport
    from simnav.recording import Recording

__all__ = ["bench", "costs"]


@call(BenchRequest)
def bench(request: BenchRequest) -> CostReport:
    """Measure time and memory of an epoch, in this process, together with estimators that come with simnav.

    Returns
    -------
    CostReport
        Figures, or a reason for each estimator that fails or does not suit the scenario.

    Raises
    ------
    ValueError
        If an estimator, parameter or scenario is unknown, or there are too few epochs.
    """
    from simnav.estimator import lacking
    from simnav.leaderboard.ranking.costs import BESIDE, costs_of

    if not request.estimators:
        raise RequestError("no estimator was asked for; name those that should be measured")
    mine = requests(request.estimators, request.parameters)
    beside = together([*mine, *requests(list(BESIDE) if request.against is None else request.against)])[len(mine) :]
    counts = whole_number("epochs", request.epochs), whole_number("rounds", request.rounds, 1)
    multiples, seas = _multiples(mine, request.scenario, request.seed, *counts, request.progress)
    suitable = (s for s in seas if not any(lacking(r.make().needs, s[1].instruments) for r in mine))
    name, recording = next(suitable, seas[0])
    return costs_of(mine, beside, name, recording, *counts, multiples, request.progress)


@call(CostsRequest)
def costs(request: CostsRequest) -> MultipleReport:
    """Measure processor times as multiples of those of the plain row, in this process, each beside the plain row.

    Returns
    -------
    MultipleReport

    Raises
    ------
    ValueError
        If an estimator, parameter or scenario is unknown, there are too few epochs, or the file cannot be written.
    """
    from dataclasses import replace

    from simnav.estimator import find, names
    from simnav.leaderboard.campaign.request import comes_with_simnav
    from simnav.leaderboard.ranking.stored_costs import save
    from simnav.leaderboard.results.provenance import here

    estimators = request.estimators
    if estimators is None:
        estimators = [name for name in names() if comes_with_simnav(find(name))]
    output = request.output
    if output is not None:
        require_folder(f"output = {os.fspath(output)!r}", absolute(output))
    counts = whole_number("epochs", request.epochs), whole_number("rounds", request.rounds, 1)
    measured = here()  # before, for the code may be edited meanwhile
    mine = requests(estimators, request.parameters)
    found, _ = _multiples(mine, request.scenario, request.seed, *counts, request.progress)
    if output is None:
        return found
    with mistakes(OSError):
        return replace(found, file=str(save(found.rows, absolute(output), measured)))


def _multiples(
    mine: Sequence[EstimatorRequest],
    scenario: ScenarioLike | None,
    seed: int,
    epochs: int,
    rounds: int,
    progress: Callable[..., None] | None,
) -> tuple[MultipleReport, list[tuple[str, Recording]]]:
    """The multiples of estimators, and the recordings of the scenarios, by versioned id."""
    from simnav.leaderboard.ranking.cost_measurement import SCENARIOS, multiples_of
    from simnav.leaderboard.ranking.costs import MultipleReport
    from simnav.source import record

    with mistakes():
        for r in mine:
            r.make()  # a mistake in a file's name or in a parameter is no result
    chosen = [scenario_of(s) for s in (SCENARIOS if scenario is None else (scenario,))]
    seas = [(s.id, record(s, seed)) for s in chosen]
    with mistakes(ValueError):
        rows, unmeasured = multiples_of(mine, seas, epochs=epochs, rounds=rounds, progress=progress)
    return MultipleReport(tuple(rows), tuple(unmeasured)), seas
