"""More seeds where they decide: a board is looked at after 30, 100 and 300 seeds, each time with a share of the 5 %.

All rows have 30 seeds. The rows that may be the best then have 100, and those that may be the best after these have
300. A row that was excluded stays excluded, whatever seeds it has more. Each look is the test of all pairs
(`simnav.leaderboard.ranking.statistics.separation`) of the rows that are left, on the seeds that all of them have, at
its own level. The levels add up to 5 %, so that the whole procedure errs in at most 5 %: two equal rows are separated,
or the best row is excluded. Two rows are separated if one of the looks separates them.

No more seeds are run where fewer than two rows are left, or where all that are left are within `ALIKE` of the first.
``python -m tests.audit stages`` measures the error and the power of the whole procedure.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .intervals import codes
from .separation import Separation, separate

__all__ = ["ALIKE", "FIRST", "STAGES", "Stage", "Staged", "separate_in_stages"]


@dataclass(frozen=True)
class Stage:
    """A look at a board.

    Attributes
    ----------
    seeds : int
        Number of seeds, the first ones.
    level : float
        Probability of an error of this look.
    """

    seeds: int
    level: float


#: The looks, fixed beforehand.
STAGES = (Stage(30, 0.02), Stage(100, 0.015), Stage(300, 0.015))
#: Seeds that all rows have.
FIRST = STAGES[0].seeds
#: Scores whose ratio to the first is within this of 1 are not worth more seeds.
ALIKE = 0.01


@dataclass(frozen=True, eq=False)
class Staged:
    """What all looks together say.

    Attributes
    ----------
    separation : Separation
        Of all rows; the p-value of a pair is that of its last look.
    wanted : int
        Number of seeds that the rows that may be the best should have next; 0 where no more are to be run.
    """

    separation: Separation
    wanted: int


def separate_in_stages(
    values: ArrayLike, strata: Sequence[Hashable], clusters: Sequence[int], stages: Sequence[Stage] = STAGES
) -> Staged:
    """Test all pairs of rows, look by look.

    Parameters
    ----------
    values : (u, n) array_like
        Figures of n rows in u runs, lower is better; NaN where a row has no run.
    strata : sequence of u
        The scenario of each run.
    clusters : sequence of u
        The seed of each run. A look takes the smallest ones.
    stages : sequence of Stage
        The looks.

    Returns
    -------
    Staged

    Examples
    --------
    The third row is excluded after 30 seeds. The others have 100.

    >>> values = np.array([[0.0, 0.2, 2.0 + 0.1 * (k % 4)] for k in range(100)])
    >>> values[:, 1] += 0.5 * (np.arange(100) % 3 - 1)
    >>> values[30:, 2] = np.nan
    >>> found = separate_in_stages(values, ["one"] * 100, range(100))
    >>> found.separation.may_be_best.tolist(), found.separation.rank_low.tolist(), found.wanted
    ([True, False, False], [1, 2, 3], 0)
    """
    x: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    n = x.shape[1]
    stratum = codes(strata)
    known, place = np.unique(np.asarray(clusters, dtype=np.int64), return_inverse=True)
    left, p, better = np.arange(n), np.ones((n, n)), np.zeros((n, n), dtype=bool)
    count, wanted = 0, 0
    for stage in stages:
        inside, seeds = place < stage.seeds, min(stage.seeds, len(known))
        if count and (seeds == count or not _whole(x[np.ix_(inside, left)], stratum[inside], place[inside], stratum)):
            wanted = stage.seeds
            break
        some = x[np.ix_(inside, left)]
        found = separate(some, stratum[inside].tolist(), place[inside].tolist(), stage.level)
        pairs = np.ix_(left, left)
        p[pairs], better[pairs] = found.p_values, better[pairs] | found.better
        count = count or seeds
        left = left[found.may_be_best]
        if len(left) < 2 or _alike(x[np.ix_(inside, left)], stratum[inside]):
            break
        count = seeds
    first = min(FIRST, len(known))
    best = np.isin(np.arange(n), left)
    ranks = 1 + better.sum(axis=0), n - better.sum(axis=1)
    return Staged(Separation(p, better, *ranks, best, first), wanted)


def _whole(
    x: NDArray[np.float64], stratum: NDArray[np.int64], place: NDArray[np.int64], every: NDArray[np.int64]
) -> bool:
    """Whether all rows have all seeds of all scenarios."""
    seeds = len(np.unique(place))
    runs = np.bincount(stratum, minlength=int(every.max()) + 1)
    return bool(np.isfinite(x).all() and (runs == seeds).all())


def _alike(x: NDArray[np.float64], stratum: NDArray[np.int64]) -> bool:
    """Whether no row is further from the first than `ALIKE`."""
    weight = 1.0 / np.bincount(stratum)[stratum]
    means = weight @ x / weight.sum()
    return bool(means.max() - means.min() < np.log1p(ALIKE))
