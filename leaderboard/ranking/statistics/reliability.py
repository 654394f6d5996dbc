"""Whether the rows of a board can be ordered at all."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .intervals import codes

__all__ = ["FEWEST_ROWS", "NEAR", "RELIABLE", "reliability", "unorderable"]

#: Fewer rows than this are no ranking.
FEWEST_ROWS = 5
#: Scores whose ratio is within this of 1 are the same for any purpose.
NEAR = 0.01
#: Least split-half reliability of an order.
RELIABLE = 0.5

_SPLITS = 100


def unorderable(
    values: ArrayLike, strata: Sequence[Hashable] | None = None, clusters: Sequence[Hashable] | None = None
) -> str:
    """Why the rows of a board cannot be ordered, in a few words; empty where they can.

    Parameters
    ----------
    values : (u, n) array_like
        Logarithms of the errors of n rows in u runs; NaN where a row has no run.
    strata, clusters : sequence of u, optional
        The scenario of each run, and its independent unit. Default: one scenario, and each run a unit.

    Examples
    --------
    >>> unorderable([[0.0, 1.0], [0.1, 1.1]])
    'there are fewer than five rows'
    """
    x: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    if x.shape[1] < FEWEST_ROWS:
        return "there are fewer than five rows"
    weights = _weights(len(x), strata)
    means = np.sort(_means(x, weights))
    within = np.searchsorted(means, means + math.log1p(NEAR), side="right") - np.arange(len(means))
    if 2 * int(within.max()) > len(means):
        return f"{int(within.max())} of {len(means)} rows are within 1 % of each other"
    found = reliability(x, strata, clusters)
    if not found >= RELIABLE:  # also if it is not known
        return f"the order in one half of the runs says little about the other half (reliability {found:.2f})"
    return ""


def reliability(
    values: ArrayLike, strata: Sequence[Hashable] | None = None, clusters: Sequence[Hashable] | None = None
) -> float:
    """Split-half reliability of the order of the rows.

    The units are split into two halves at random, many times. The rank correlation r of the scores from the two halves
    is averaged, and the formula of Spearman and Brown, 2 r / (1 + r), gives the reliability of the whole.

    Parameters
    ----------
    values, strata, clusters
        As for `unorderable`.

    Returns
    -------
    float
        1 where both halves always give the same order, about 0 where the order is chance; NaN with fewer than two units
        or rows.

    Examples
    --------
    >>> reliability([[0.0, 1.0, 2.0]] * 6)
    1.0
    """
    x: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    cluster = codes(range(len(x)) if clusters is None else clusters)
    count = int(cluster.max()) + 1 if len(x) else 0
    if count < 2 or x.shape[1] < 2:
        return math.nan
    weights = _weights(len(x), strata)
    rng = np.random.default_rng(count)
    found = []
    for _ in range(_SPLITS):
        first = np.isin(cluster, rng.permutation(count)[: count // 2])
        one, other = _means(x, np.where(first, weights, 0.0)), _means(x, np.where(first, 0.0, weights))
        if np.isfinite(one).all() and np.isfinite(other).all():
            found.append(_rank_correlation(one, other))
    if not found:
        return math.nan
    r = float(np.mean(found))
    return 2.0 * r / (1.0 + r) if r > -1.0 else -1.0


def _weights(runs: int, strata: Sequence[Hashable] | None) -> NDArray[np.float64]:
    """(u,) the weight of each run, such that each scenario counts the same."""
    stratum = codes([0] * runs if strata is None else strata)
    return np.asarray(1.0 / np.bincount(stratum)[stratum])


def _means(x: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) weighted means over the runs that each row has; NaN without any."""
    there = np.isfinite(x)
    total = there.T @ weights
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((np.where(there, x, 0.0).T @ weights) / total)


def _rank_correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Spearman's; equal values have the mean of their ranks, and an order without any difference says nothing (0)."""
    x, y = _ranks(a) - 0.5 * (len(a) + 1), _ranks(b) - 0.5 * (len(b) + 1)
    size = math.sqrt(float(x @ x) * float(y @ y))
    return float(x @ y) / size if size > 0.0 else 0.0


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) ranks from 1; equal values have the mean of theirs.

    >>> _ranks(np.array([3.0, 1.0, 3.0])).tolist()
    [2.5, 1.0, 2.5]
    """
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(count) - 0.5 * (count - 1))[place.ravel()])
