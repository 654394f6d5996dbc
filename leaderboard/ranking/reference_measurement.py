"""Measure the reference figures of scenarios, and store them: what ``simnav standard reference`` does.

A simulated scenario has the error of ``oracle`` in real time and of ``oracle-rts`` for smoothed output. A recorded one
has no oracle, because nobody knows the true noise of its instruments: its figure is the error of a plain filter.
"""

from __future__ import annotations

import json
import math
import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import requests
from simnav.leaderboard.results import store

from . import reference
from .board import Reference
from .oracle_runs import OracleRuns

if TYPE_CHECKING:
    from simnav.scenario import Scenario

__all__ = ["measure", "save"]

#: Seeds of a scenario that are run before the next scenario has its turn.
_TURN = 10


def measure(
    scenarios: Sequence[Scenario],
    runs: int,
    folder: str | os.PathLike[str],
    *,
    workers: int = 2,
    progress: Callable[[int, int, str], None] | None = None,
    found: Callable[[Mapping[str, Mapping[str, Reference]]], None] | None = None,
) -> dict[str, dict[str, Reference]]:
    """Run the references over many seeds.

    Parameters
    ----------
    scenarios : sequence of Scenario
        Those whose reference figures are wanted.
    runs : int
        Seeds a scenario, at most 1000. Of a recorded one each recording is taken once.
    folder : path
        Folder of the runs. Started again, the measurement continues where it stopped.
    workers : int
        Number of processes.
    progress : callable, optional
        Called with the runs of the oracle that are done, how many there will be, and a note.
    found : callable, optional
        Called with the figures so far, after every `_TURN` runs of a scenario.

    Returns
    -------
    dict of str to dict
        Scenario -> score -> figure; a scenario without a completed run is missing.

    Raises
    ------
    SpecError
        Where the oracle fails on a run.
    RequestError
        If a file in the folder is damaged.
    """
    simulated = [OracleRuns(s, folder) for s in scenarios if s.log is None]
    figures: dict[str, dict[str, Reference]] = {}
    total = runs * len(simulated)
    for first in range(0, runs, _TURN):
        for oracle in simulated:
            seeds = _seeds(oracle.scenario)[first : min(first + _TURN, runs)]
            for _ in oracle.measure(seeds, workers):
                if progress is not None:
                    progress(sum(len(o.runs) for o in simulated), total, oracle.scenario.id)
            figures[oracle.scenario.id] = _figures(oracle)
            if found is not None:
                found(figures)
    return {**figures, **_recorded([s for s in scenarios if s.log is not None], runs, folder, workers)}


def _seeds(scenario: Scenario) -> range:
    """The seeds of a scenario's figure: others in each, because the same seed gives the same noise in all of them."""
    first = 1_000_000 + 1000 * (zlib.crc32(scenario.id.encode()) % 100_000)
    return range(first, first + 1000)


def _figures(oracle: OracleRuns) -> dict[str, Reference]:
    from simnav.estimators.reference import ReferenceFigure

    runs = [oracle.runs[seed] for seed in sorted(oracle.runs)]
    made = {}
    for score, name in reference.ORACLES.items():
        smoothed = score.startswith("smoothed")
        figure = reference.figure([r.smoothed_rms if smoothed else r.rms for r in runs], name, stored=True)
        if figure is None:
            continue
        if len(runs) > 1:
            f = ReferenceFigure.of(oracle.scenario.id, runs, smoothed)
            figure = replace(
                figure, to_bound=f.ratio, to_bound_error=f.ratio_standard_error,
                nees=f.nees, nees_error=f.nees_standard_error,
            )  # fmt: skip
        made[score] = replace(figure, content=oracle.scenario.content_hash())
    return made


def _recorded(scenarios: Sequence[Scenario], runs: int, folder: str | os.PathLike[str], workers: int) -> dict[str, Any]:
    """Figures of recorded scenarios: the error of a plain filter, each recording once."""
    if not scenarios:
        return {}
    run_campaign(scenarios, requests(list(reference.PLAIN)), range(runs), folder, workers=workers)
    results = store.load(folder, series=False, scores=tuple(reference.ORACLES))
    found: dict[str, dict[str, Reference]] = {}
    for s in scenarios:
        mine = [r for r in results if r.scenario == s.id and r.status == "ok"]
        for score in reference.ORACLES:
            for name in reference.PLAIN:
                errors = {r.note: r.scores.get(score, math.nan) for r in mine if r.estimator == name}
                made = reference.figure(errors.values(), name, stored=True)
                if made is not None:
                    found.setdefault(s.id, {})[score] = replace(made, content=s.content_hash())
                    break
    return found


def save(figures: Mapping[str, Mapping[str, Reference]], path: Path = reference.FILE) -> None:
    """Add figures to a file; those of other scenarios in it stay.

    Raises
    ------
    RequestError
        If the file is there and is none of reference figures.
    StoreError
        If it cannot be written.
    """
    merged = {**reference.stored(path), **figures}
    content = {
        "format": reference.FORMAT,
        "figures": {
            scenario: {score: reference.entry(r) for score, r in sorted(scores.items())}
            for scenario, scores in sorted(merged.items())
        },
    }
    with store.atomic(path) as file:
        file.write(json.dumps(content, indent=1).encode() + b"\n")
    reference.stored.cache_clear()
