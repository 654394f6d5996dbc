"""The runs on which a row has a much larger error than the plain EKF, with what was wrong in them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from simnav.leaderboard.ranking.lost_runs import LOSS, beside, lost_recordings

from .columns import Column, column_dicts
from .entries import run_names
from .facts import catalogued
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import Ranking

    from .content import ScenarioEntry

__all__ = ["faults_of", "losses"]

_SHOWN = 25
_COLUMNS = (
    Column("name", "Scenario", "The name leads to the run.", "name", fixed=True),
    Column("run", "Run", "Seed, or recording.", "text"),
    Column("ratio", "× plain EKF", "Error divided by that of the plain EKF in the same run.", "ratio", descending=True),
    Column("score", "× reference", "Error divided by the reference figure of the scenario.", "ratio"),
    Column("wrong", "What was wrong", "Instruments with faults, the kind of each fault, and when it acted.", "words"),
)


def losses(label: str, other: str, ranking: Ranking, scenarios: Mapping[str, ScenarioEntry]) -> dict[str, Any] | None:
    """The runs that a row loses, the largest ratio first; failed runs are counted apart.

    Parameters
    ----------
    label, other : str
        Labels of the row and of the plain one.
    ranking : Ranking
        Ranking of all results.
    scenarios : mapping of str to ScenarioEntry
        Entries of the scenarios, by id.

    Returns
    -------
    dict or None
        ``limit``: the ratio; ``lost``, ``failed``, ``runs``, ``shown``: numbers of runs; ``recorded``: on recorded
        voyages, against the plain row of each; ``table``. None where the two have no run in common.
    """
    found: list[tuple[float, float, str, str]] = []
    failed = runs = 0
    for table in ranking.scenarios:
        names = run_names(table)
        for run, ratio, score in beside(table, label, other):
            runs += 1
            if math.isinf(ratio):
                failed += 1
            elif ratio > LOSS * (1.0 + 1e-9):
                found.append((ratio, score, table.scenario, names.get(run, run)))
    if not runs:
        return None
    found.sort(key=lambda f: -f[0])
    shown = found[:_SHOWN]
    recorded = lost_recordings(label, ranking.scenarios)
    return {
        "limit": LOSS,
        "lost": len(found),
        "failed": failed,
        "runs": runs,
        "shown": len(shown),
        "recorded": {
            "lost": recorded.lost,
            "runs": recorded.runs,
            "scenarios": [{"name": scenarios[s].name, "page": scenarios[s].page} for s in recorded.scenarios],
        },
        "table": {
            "name": "lost",
            "title": f"Runs that {label} loses against {other}",
            "columns": column_dicts(_COLUMNS),
            "rows": [_row(label, scenarios[scenario], ratio, score, run) for ratio, score, scenario, run in shown],
        },
    }


def _row(label: str, scenario: ScenarioEntry, ratio: float, score: float, run: str) -> dict[str, Any]:
    seed = run.isdecimal()  # else it is a recording
    return {
        "name": {
            "text": scenario.name,
            "page": f"{scenario.page}#row={quote(label)}" + (f"&seed={run}" if seed else ""),
        },
        "run": run,
        "ratio": short(ratio),
        "score": short(score),
        "wrong": faults_of(scenario.id, int(run)) if seed else "",
    }


@lru_cache(maxsize=20_000)
def faults_of(identity: str, seed: int) -> str:
    """The faults of a run of the catalogue in words; empty where there are none, or it is not known."""
    scenario = catalogued(identity)
    if scenario is None:
        return ""
    words = []
    for fault in scenario.drawn(seed).faults:
        table = fault.to_toml()
        start, end = table.get("start_s"), table.get("end_s")
        when = f" ({start:.0f} to {end:.0f} s)" if start is not None and end is not None else ""
        channels = f" [{', '.join(fault.channels)}]" if fault.channels else ""
        words.append(f"{', '.join(fault.instruments) or 'all'}{channels}: {fault.kind.replace('_', ' ')}{when}")
    return "; ".join(words)
