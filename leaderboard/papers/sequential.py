"""More runs for the rows that are undecided: until each row is decided, or has a largest number of runs.

A row is decided as soon as its 95 % interval lies on one side of the nearer end of its band
(`simnav.leaderboard.papers.comparison`): the interval is then narrower than the margin of the verdict. Each stage
doubles the number of runs, and only for the methods of undecided rows. Everything is kept in a folder of results, so
that the work can be done in parts.

A row is looked at several times (six to nine times up to 200 runs), so a verdict is wrong somewhat more often than the
5 % of a single look.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .paper import Gain, Paper
from .reproduction import Reproduction, fill, find_method, load_results, run

if TYPE_CHECKING:
    from simnav.leaderboard.campaign.campaign import Progress
    from simnav.leaderboard.campaign.request import EstimatorRequest
    from simnav.leaderboard.results.result import Result

__all__ = ["LIMIT", "decide", "undecided"]

#: Largest number of runs of a row: that of the papers with the most runs.
LIMIT = 200


def decide(
    paper: Paper,
    folder: Path,
    *,
    limit: int = LIMIT,
    minutes: float | None = None,
    workers: int = 2,
    progress: Callable[[str, Progress], None] | None = None,
) -> Reproduction:
    """Run a paper's comparison until its rows are decided.

    Parameters
    ----------
    paper : Paper
        The paper.
    folder : Path
        Folder of the results. A later call with the same folder continues there.
    limit : int
        Largest number of runs of a method on a scenario.
    minutes : float, optional
        Time after which no further runs are started; default: no such time.
    workers : int
        Number of processes.
    progress : callable, optional
        Called with the name of the scenario and the campaign's progress.

    Returns
    -------
    Reproduction
        From all runs that are in the folder.
    """
    end = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
    stands_for = {m.name: find_method(m) for m in paper.methods}
    seeds = range(limit)
    block = 2 * workers
    participants = paper.participants()

    def advance(scenario: str, methods: Sequence[str], first: int, last: int) -> bool:
        """Run the seeds from first to last in blocks; False if the time is over."""
        for begin in range(first, last, block):
            if time.monotonic() > end:
                return False
            part = range(begin, min(begin + block, last))
            run(paper, scenario, methods, stands_for, part, folder, workers=workers, progress=progress)
        return True

    start = min(paper.runs, limit)
    in_time = all(advance(scenario, methods, 0, start) for scenario, methods in participants.items())
    found = fill(paper, stands_for, load_results(paper, stands_for, folder, seeds), seeds)
    while in_time and (wanted := undecided(found, limit)):
        for scenario, methods in wanted.items():
            done = min(_count(found.results, paper, scenario, stands_for[m]) for m in methods)
            in_time = in_time and advance(scenario, methods, done, min(limit, 2 * done))
        found = fill(paper, stands_for, load_results(paper, stands_for, folder, seeds), seeds)
    most = max((r.seed + 1 for r in found.results), default=0)
    return fill(paper, stands_for, found.results, range(most))


def undecided(found: Reproduction, limit: int = LIMIT) -> dict[str, list[str]]:
    """Scenario -> methods of undecided rows that have fewer runs than the limit."""
    wanted: dict[str, set[str]] = {}
    for f in found.findings:
        if f.verdict != "undecided":
            continue
        methods = {f.row.method, f.row.than} if isinstance(f.row, Gain) else {f.row.method}
        counts = [_count(found.results, found.paper, f.row.scenario, found.stands_for[m]) for m in methods]
        if min(counts) < limit:
            wanted.setdefault(f.row.scenario, set()).update(methods)
    names = [m.name for m in found.paper.methods]
    return {scenario: sorted(methods, key=names.index) for scenario, methods in wanted.items()}


def _count(results: Sequence[Result], paper: Paper, scenario: str, request: EstimatorRequest | None) -> int:
    """Number of runs of an estimator on a scenario: how many seeds there are from 0 on without a gap."""
    if request is None:
        return 0
    which = (paper.scenario(scenario).id, request.label)
    seeds = {r.seed for r in results if (r.scenario, r.estimator) == which}
    return next(k for k in range(len(seeds) + 1) if k not in seeds)
