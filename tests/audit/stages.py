"""The whole procedure of a board in stages: how often it errs, and how often it finds a row that is better.

Boards are drawn from the standard result, as in `tests.audit.statistics`: the figures of real rows, made equally good,
keep their scatter and their skewness; seeds are drawn with replacement, up to 300. Nothing is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
from scipy.special import ndtri

from simnav.leaderboard.ranking.statistics import STAGES, separate_in_stages, share
from simnav.leaderboard.ranking.troubles import trouble_of
from simnav.scenario.catalogue import headers
from tests.audit.statistics import real_errors

__all__ = ["boards", "parts", "rows"]

ROWS, BOARDS = 40, 60
TRACKS = ("aided-ins", "no-imu", "generalisation")
GAINS = (0.05, 0.1, 0.2)


def _groups(track: str) -> list[list[int]]:
    """The scenarios of each kind of trouble, as places in `real_errors`."""
    names = sorted(h.id for h in headers() if h.track == track)[: len(real_errors(track))]
    kinds = [trouble_of(name) for name in names]
    return [[k for k, kind in enumerate(kinds) if kind == one] for one in dict.fromkeys(kinds)]


def boards(track: str, *, gain: float = 0.0, worse: float = 0.0, number: int = BOARDS, seed: int = 0) -> dict[str, int]:
    """How boards of one kind of trouble end.

    Parameters
    ----------
    track : str
        Track of the standard result; a kind of trouble is drawn for each board.
    gain : float
        By which share the first row is better than all others.
    worse : float
        By which share the second half of the rows is worse than the first.

    Returns
    -------
    dict
        Boards on which two equal rows were separated or a best row was excluded (``wrong``), on which the first row
        alone may be the best (``found``), and on which it is told from the median of the others (``told``).
    """
    every, groups = real_errors(track), _groups(track)
    rng = np.random.default_rng(seed)
    ends = {"wrong": 0, "found": 0, "told": 0}
    for _ in range(number):
        some = every[groups[int(rng.integers(len(groups)))]]
        some = some[:, :, rng.choice(every.shape[2], min(ROWS, every.shape[2]), replace=False)]
        some = some - some.mean(axis=(0, 1))
        n = some.shape[2]
        some[:, :, 0] += math.log1p(-gain)
        some[:, :, n // 2 :] += math.log1p(worse)
        drawn = some[:, rng.integers(0, some.shape[1], STAGES[-1].seeds)]
        scenarios, seeds = drawn.shape[:2]
        found = separate_in_stages(
            drawn.reshape(-1, n),
            np.repeat(np.arange(scenarios), seeds).tolist(),
            np.tile(np.arange(seeds), scenarios).tolist(),
        ).separation
        level = np.zeros(n, dtype=int)
        level[0] -= gain > 0.0
        level[n // 2 :] += worse > 0.0
        equal = level[:, None] == level[None, :]
        ends["wrong"] += bool((found.better & equal).any() or not found.may_be_best[level == level.min()].all())
        ends["found"] += bool(found.may_be_best[0] and found.may_be_best.sum() == 1)
        ends["told"] += bool(2 * np.count_nonzero(found.better[0]) >= n - 1)
    return ends


def needed(track: str, gain: float, power: float = 0.8) -> dict[str, float]:
    """Seeds that a row needs to be told from each of `ROWS` - 1 others, by kind of trouble.

    The test is the best that there can be: normal errors, one-sided, and only pairs with the better row, at
    5 % in all. The scatter is that of the difference of two real rows, the median of all pairs.
    """
    every = real_errors(track)
    reach = float(ndtri(1.0 - 0.05 / (ROWS - 1)) + ndtri(power))
    found = {}
    for group in _groups(track):
        errors = every[group].mean(axis=0)
        first, second = np.triu_indices(errors.shape[1], 1)
        scatter = float(np.median((errors[:, first] - errors[:, second]).std(axis=0, ddof=1)))
        kind = trouble_of(sorted(h.id for h in headers() if h.track == track)[group[0]])
        found[kind] = (reach * scatter / math.log1p(-gain)) ** 2
    return found


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured, by name."""
    found: dict[str, Callable[[], Any]] = {}
    for track in TRACKS:
        found[f"{track}-equal"] = partial(boards, track, number=2 * BOARDS)
        found[f"{track}-worse"] = partial(boards, track, worse=0.2)
        found |= {f"{track}-{gain:g}": partial(boards, track, gain=gain) for gain in GAINS}
        found[f"{track}-needed"] = partial(needed, track, 0.1)
    return found


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What is measured, its figure, what is promised, and whether that is kept."""
    for track in TRACKS:
        for part, number, title in (
            ("equal", 2 * BOARDS, "equal rows"),
            ("worse", BOARDS, "half of the rows 20 % worse"),
        ):
            wrong = share(found[f"{track}-{part}"]["wrong"], number)
            figure = f"{100.0 * wrong.value:.1f} % [{100.0 * wrong.low:.1f}, {100.0 * wrong.high:.1f}]"
            yield f"{track}, {title}: an error at any look", figure, "at most 5 %", wrong.low <= 0.05
        for gain in GAINS:
            one = found[f"{track}-{gain:g}"]
            figure = (
                f"{100.0 * one['found'] / BOARDS:.0f} %, told from half of them {100.0 * one['told'] / BOARDS:.0f} %"
            )
            yield f"{track}, one row {100.0 * gain:.0f} % better: alone in the set", figure, "", True
        seeds = ", ".join(f"{title} {n:.0f}" for title, n in found[f"{track}-needed"].items())
        yield f"{track}, seeds that the best possible test needs for 10 %", seeds, "", True
