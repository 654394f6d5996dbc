"""Measure the reference figures of scenarios, and store them: what ``simnav reference`` does.

A simulated scenario has the error of ``oracle`` in real time and of ``oracle-rts`` for smoothed output. A recorded one
has no oracle, because nobody knows the true noise of its instruments: its figure is the error of a plain filter.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import requests
from simnav.leaderboard.ranking import reference
from simnav.leaderboard.ranking.board import Reference
from simnav.leaderboard.results import store

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.scenario import Scenario

__all__ = ["PLAIN", "measure", "save"]

#: The plain filters whose error is the figure of a recorded scenario: the first that suits it.
PLAIN = ("ekf", "ship-ekf")

#: Digits that a stored figure has.
_DIGITS = 5


def measure(
    scenarios: Sequence[Scenario],
    runs: int,
    folder: str | os.PathLike[str],
    *,
    workers: int = 2,
    progress: Callable[[Progress], None] | None = None,
) -> dict[str, dict[str, Reference]]:
    """Run the references over many seeds.

    Parameters
    ----------
    scenarios : sequence of Scenario
    runs : int
        Seeds a scenario. Of a recorded one each recording is taken once.
    folder : path
        Of the results; started again, it goes on where it was.
    workers : int
    progress : callable, optional
        Called with a `simnav.leaderboard.campaign.campaign.Progress` now and then.

    Returns
    -------
    dict of str to dict
        Scenario -> score -> figure; a scenario without a completed run is missing.
    """
    recorded = [s for s in scenarios if s.log is not None]
    simulated = [s for s in scenarios if s.log is None]
    for chosen, names in ((simulated, tuple(reference.ORACLES.values())), (recorded, PLAIN)):
        if chosen:
            run_campaign(chosen, requests(list(names)), range(runs), folder, workers=workers, progress=progress)
    results = store.load(folder, series=False, scores=tuple(reference.ORACLES))
    found: dict[str, dict[str, Reference]] = {}
    for s in scenarios:
        mine = [r for r in results if r.scenario == s.id and r.status == "ok"]
        for score, oracle in reference.ORACLES.items():
            for name in PLAIN if s.log is not None else (oracle,):
                errors = {r.note if s.log is not None else r.seed: r.scores.get(score, math.nan)
                          for r in mine if r.estimator == name}  # fmt: skip
                made = reference.figure(errors.values(), name, stored=True)
                if made is not None:
                    found.setdefault(s.id, {})[score] = made
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
            scenario: {
                score: {
                    "estimator": r.estimator,
                    "value": float(f"{r.value:.{_DIGITS}g}"),
                    "spread": float(f"{r.spread:.3g}"),
                    "runs": r.runs,
                }
                for score, r in sorted(scores.items())
            }
            for scenario, scores in sorted(merged.items())
        },
    }
    text: Any = json.dumps(content, indent=1)
    with store.atomic(path) as file:
        file.write(text.encode() + b"\n")
    reference.stored.cache_clear()
