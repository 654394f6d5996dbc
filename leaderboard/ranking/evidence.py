"""Which runs count: every row of a board is judged on the same seeds.

A row that stops early could stop when it is lucky, and a row with other seeds has easier or harder runs than its
rivals. So the seeds of a scenario are those that at least half of its rows have run (`common_seeds`). A row that lacks
one of them is *incomplete*: it has a score, and no rank. What a row has run beside them does not count.

References say nothing of this, because they are told the truth, and neither do variants of one row beyond the first
few (`simnav.leaderboard.ranking.variants`): nobody can decide the seeds of the others with many copies.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["common_seeds", "lacking", "notes_by_seed"]


def common_seeds(seeds: Sequence[Collection[int]]) -> list[int]:
    """The seeds that at least half of the rows have run.

    Parameters
    ----------
    seeds : sequence of collection of int
        The seeds of each row.

    Examples
    --------
    >>> common_seeds([{0, 1, 2}, {0, 1, 2, 3}, {0}])
    [0, 1, 2]
    """
    there = Counter(seed for row in seeds for seed in set(row))
    return sorted(seed for seed, count in there.items() if 2 * count >= len(seeds))


def lacking(runs: Mapping[str, tuple[int, int]]) -> str:
    """Why a row is incomplete, in one sentence; empty where it is complete.

    Parameters
    ----------
    runs : mapping of str to (int, int)
        Scenario -> seeds that the row has run, and seeds that the track asks.

    Examples
    --------
    >>> lacking({"one-v1": (10, 30), "two-v1": (10, 30), "three-v1": (30, 30)})
    'it has run 10 of 30 seeds of one-v1, and lacks seeds of 1 scenario more'
    >>> lacking({"one-v1": (0, 30), "two-v1": (30, 30)})
    'it has not run one-v1'
    """
    short = [(name, have, asked) for name, (have, asked) in runs.items() if have < asked]
    if not short:
        return ""
    name, have, asked = short[0]
    first = f"it has run {have} of {asked} seeds of {name}" if have else f"it has not run {name}"
    others = len(short) - 1
    return first + (f", and lacks seeds of {others} scenario{'s' if others > 1 else ''} more" if others else "")


def notes_by_seed(results: Sequence[Result]) -> dict[int, str]:
    """The note of the recording of each seed, as most rows have it: one row cannot change what a run was."""
    found: dict[int, Counter[str]] = {}
    for result in results:
        found.setdefault(result.seed, Counter())[result.note] += 1
    return {seed: _most(notes) for seed, notes in found.items()}


def _most(counted: Counter[Any]) -> Any:
    most = max(counted.values())
    return min(item for item, count in counted.items() if count == most)
