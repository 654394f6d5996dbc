"""The later stages of a campaign: more seeds for the rows that may still be the best, until all boards are decided."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from simnav.leaderboard.campaign.campaign import Summary
from simnav.leaderboard.results import store
from simnav.scenario import Scenario

from .next_runs import next_runs

__all__ = ["run_further"]


def run_further(
    folder: Path,
    scenarios: Sequence[Scenario],
    estimators: Collection[str],
    run: Callable[[Scenario, Collection[str], int, float | None], Summary],
    end: float | None = None,
    *,
    most: int,
) -> list[Summary]:
    """Run what the results of a folder ask for, stage after stage.

    Parameters
    ----------
    folder : Path
        Folder in which all rows have the seeds of the first stage.
    scenarios : sequence of Scenario
        Scenarios that are looked at in stages.
    estimators : collection of str
        Labels of the rows that may have more seeds; others in the folder are not run.
    run : callable
        Runs some rows, by their labels, on a scenario, with so many seeds, for so many minutes at most.
    end : float, optional
        Time of `time.monotonic` after which no run is started.
    most : int
        Seeds of the last stage that is to be run.

    Returns
    -------
    list of Summary
        One a scenario and stage. The last ones say how many runs are left, if the time was over.
    """
    known = {s.id: s for s in scenarios}
    done: list[Summary] = []
    while True:
        results = (r for r in store.load(folder, series=False) if r.scenario in known and r.estimator in estimators)
        wanted = next_runs(results, {s.id: s.track for s in scenarios}, most=most)
        for each in wanted:
            minutes = None if end is None else max(0.0, (end - time.monotonic()) / 60.0)
            done.append(run(known[each.scenario], each.estimators, each.seeds, minutes))
        if not wanted or any(s.left for s in done[-len(wanted) :]):
            return done
