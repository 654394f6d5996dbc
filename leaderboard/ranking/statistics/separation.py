"""Which rows of a board can be told apart: one simultaneous test of all pairs, with sign flips.

Given are figures (logarithms of errors) of n rows in the same runs. If two rows are equally good, the sign of their
difference in a run is as likely plus as minus. So the signs are flipped at random, and it is seen how large the
differences between rows become by chance alone.

- **One sign a cluster.** Runs of one seed in several scenarios share random streams, and runs over one recording share
  the recording. They are one *cluster*: all its differences are flipped together, in all pairs of rows.
- **Statistic of a pair.** The mean over the scenarios of the mean difference, over the root of the sum of squares of
  the clusters' contributions. Flips do not change the denominator, so that this is as good as Student's t.
- **All pairs at once.** The p-value of a pair is the share of the flips in which the largest statistic of any pair
  that is not more extreme reaches the pair's own: the free step-down procedure with maxima of Westfall and Young
  (*Resampling-based multiple testing*, Wiley 1993). The probability that any two equal rows are separated is at most
  5 %, whatever the other rows are, if differences are distributed symmetrically.
- **Rank intervals** follow from the pairs: a row's best possible rank is 1 plus the number of rows that are separated
  from it and better (Mogstad, Romano, Shaikh and Wilhelm, *Inference for ranks with applications to mobility across
  neighborhoods and academic achievement across countries*, Review of Economic Studies 2024).
- **The set that may be best** is found by elimination: as long as the rows that are left are not equally good, the one
  that is the worst of any pair goes (Hansen, Lunde and Nason, *The model confidence set*, Econometrica 2011).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simnav.leaderboard.ranking.statistics.intervals import codes

__all__ = ["Separation", "separate", "smallest_p_value", "tiers"]

Array = NDArray[np.float64]

#: Family-wise error rate: probability that any two equal rows of a board are separated.
ALPHA = 0.05
#: Flips of a test; of up to `_FEW` clusters all are tried.
FLIPS, _FEW = 2000, 11

_TINY = 1e-12  # of the largest difference: what is smaller is rounding


@dataclass(frozen=True, eq=False)
class Separation:
    """Which of n rows can be told apart.

    Attributes
    ----------
    p_values : (n, n) array
        Adjusted for all pairs; symmetric, 1 on the diagonal.
    better : (n, n) bool array
        ``better[i, j]``: row i is better than row j, and the two are separated.
    rank_low, rank_high : (n,) int array
        Ends of the rank intervals, from 1. All n intervals together hold with 95 % probability.
    may_be_best : (n,) bool array
        The rows of the model confidence set: it holds the best row with 95 % probability.
    clusters : int
        Independent units that the test had.
    """

    p_values: Array
    better: NDArray[np.bool_]
    rank_low: NDArray[np.int64]
    rank_high: NDArray[np.int64]
    may_be_best: NDArray[np.bool_]
    clusters: int

    @property
    def any(self) -> bool:
        """Whether any two rows are separated."""
        return bool(self.better.any())


def smallest_p_value(clusters: int) -> float:
    """The smallest p-value that so many clusters can give: that of a difference of one sign in all of them.

    >>> smallest_p_value(5), smallest_p_value(6)
    (0.0625, 0.03125)
    """
    return 1.0 if clusters < 1 else 0.5 ** (clusters - 1) if clusters <= _FEW else 1.0 / FLIPS


def separate(
    values: ArrayLike,
    strata: Sequence[Hashable] | None = None,
    clusters: Sequence[Hashable] | None = None,
) -> Separation:
    """Test all pairs of rows at once.

    Parameters
    ----------
    values : (u, n) array_like
        Figures of n rows in u runs, lower is better; NaN where a row has no run. Two rows are compared over the runs
        that both have.
    strata : sequence of u, optional
        The scenario of each run; each counts the same. Default: all are of one.
    clusters : sequence of u, optional
        The independent unit that each run belongs to: its seed or recording. Default: each run is one.

    Returns
    -------
    Separation

    Examples
    --------
    >>> values = np.array([[0.0, 0.01, 2.0 + 0.1 * k] for k in range(10)])
    >>> found = separate(values)
    >>> found.rank_low.tolist(), found.rank_high.tolist(), found.may_be_best.tolist()
    ([1, 2, 3], [1, 2, 3], [True, False, False])
    """
    x: Array = np.asarray(values, dtype=np.float64)
    u, n = x.shape
    stratum = codes([0] * u if strata is None else strata)
    cluster = codes(range(u) if clusters is None else clusters)
    count = int(cluster.max()) + 1 if u else 0
    first, second = np.triu_indices(n, 1)
    if not count or not len(first):
        return _conclude(np.ones((n, n)), np.zeros((n, n)), np.ones(n, dtype=bool), count)
    signs = _signs(count)
    observed, drawn = _statistics(x, stratum, cluster, count, signs, first, second)

    p = np.ones((n, n))
    p[first, second] = p[second, first] = _step_down(observed, drawn)
    sign = np.zeros((n, n))
    sign[first, second], sign[second, first] = np.sign(observed), -np.sign(observed)
    best = _confidence_set(n, observed, drawn, first, second)
    return _conclude(p, sign, best, count)


@lru_cache(maxsize=8)
def _signs(clusters: int) -> NDArray[np.float32]:
    """(B, clusters) signs; the first row changes nothing. One sign is free, for only sizes count."""
    if clusters <= _FEW:
        bits = np.arange(2 ** (clusters - 1))[:, None] >> np.arange(clusters) & 1
    else:
        bits = np.random.default_rng(clusters).integers(0, 2, (FLIPS, clusters), dtype=np.int8)
        bits[0] = 0
    return np.asarray(1 - 2 * bits, dtype=np.float32)


def _statistics(
    x: Array, stratum: NDArray[np.int64], cluster: NDArray[np.int64], count: int, signs: NDArray[np.float32],
    first: NDArray[np.int64], second: NDArray[np.int64],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:  # fmt: skip
    """Signed statistics (P,) of the pairs as they are, and their sizes (P, B) in each flip.

    Rows that have the same runs are treated together, so that the flips are one product of matrices.
    """
    present = np.isfinite(x)
    patterns, pattern = np.unique(present, axis=1, return_inverse=True)
    pattern = pattern.ravel()
    observed = np.zeros(len(first), dtype=np.float32)
    sizes = np.zeros((len(first), len(signs)), dtype=np.float32)
    low, high = np.minimum(pattern[first], pattern[second]), np.maximum(pattern[first], pattern[second])
    for g, h in sorted(set(zip(low.tolist(), high.tolist(), strict=True))):
        here = np.flatnonzero((low == g) & (high == h))
        rows = np.flatnonzero((pattern == g) | (pattern == h))
        common = patterns[:, g] & patterns[:, h]
        if not common.any():
            continue
        shares = _shares(x[np.ix_(common, rows)], stratum[common], cluster[common], count)
        i, j = np.searchsorted(rows, first[here]), np.searchsorted(rows, second[here])
        difference = shares[:, i] - shares[:, j]  # (K, pairs)
        norm = np.sqrt(np.sum(difference**2, axis=0))
        flat = norm <= _TINY * max(float(np.abs(shares).max()), 1e-300)
        norm[flat] = np.inf
        drawn = shares.T.astype(np.float32) @ signs.T  # (rows, B)
        statistic = (drawn[i] - drawn[j]) * (1.0 / norm).astype(np.float32)[:, None]
        observed[here] = statistic[:, 0]
        sizes[here] = np.abs(statistic, out=statistic)
    return observed, sizes


def _shares(x: Array, stratum: NDArray[np.int64], cluster: NDArray[np.int64], count: int) -> Array:
    """(K, n) what each cluster contributes to the mean over the strata of each row's mean, up to a constant for all."""
    runs = np.bincount(stratum)
    weight = 1.0 / (np.count_nonzero(runs) * runs[stratum])
    shares = np.zeros((count, x.shape[1]))
    np.add.at(shares, cluster, weight[:, None] * (x - x.mean(axis=1, keepdims=True)))
    return shares


def _reached(drawn: NDArray[np.float32], size: np.float32) -> float:
    """Share of the flips (B,) that reach a size."""
    return float(np.count_nonzero(drawn >= size * np.float32(1.0 - 1e-5)) / len(drawn))


def _step_down(observed: NDArray[np.float32], drawn: NDArray[np.float32]) -> Array:
    """Adjusted p-values (P,): the largest pair against the maximum over all, the next against that of the rest, ..."""
    size = np.abs(observed)
    p = np.ones(len(size))
    most = np.zeros(drawn.shape[1], dtype=np.float32)
    ascending = np.argsort(size, kind="stable")
    for pair in ascending:
        np.maximum(most, drawn[pair], out=most)
        if size[pair] > 0.0:
            p[pair] = _reached(most, size[pair])
    p[ascending] = np.maximum.accumulate(p[ascending][::-1])[::-1]
    return p


def _confidence_set(
    n: int, observed: NDArray[np.float32], drawn: NDArray[np.float32], first: NDArray[np.int64],
    second: NDArray[np.int64],
) -> NDArray[np.bool_]:  # fmt: skip
    """Which rows may be the best: the worst of the most different pair goes while the rest are not equally good."""
    gone: list[int] = []  # in which order they would go, if all did
    steps: list[np.float32] = []
    inside = np.ones(n, dtype=bool)
    for pair in np.argsort(-np.abs(observed), kind="stable"):
        if inside[first[pair]] and inside[second[pair]]:
            worse = int(first[pair] if observed[pair] > 0.0 else second[pair])
            gone.append(worse)
            steps.append(np.abs(observed[pair]))
            inside[worse] = False
    # The maximum over the pairs that are left at each step, from the last step back: each pair is looked at once.
    step_of = np.full(n, len(gone))
    step_of[gone] = np.arange(len(gone))
    leaves = np.minimum(step_of[first], step_of[second])
    most = np.zeros(drawn.shape[1], dtype=np.float32)
    p = np.ones(len(gone))
    for step in range(len(gone) - 1, -1, -1):
        np.maximum(most, drawn[leaves == step].max(axis=0), out=most)
        if steps[step] > 0.0:
            p[step] = _reached(most, steps[step])
    inside[:] = True
    for row, value in zip(gone, p, strict=True):
        if value > ALPHA:
            break
        inside[row] = False
    return inside


def _conclude(p: Array, sign: Array, best: NDArray[np.bool_], clusters: int) -> Separation:
    better = (p <= ALPHA) & (sign < 0.0)  # lower is better
    n = len(p)
    return Separation(p, better, 1 + better.sum(axis=0), n - better.sum(axis=1), best, clusters)


def tiers(order: Sequence[int], better: NDArray[np.bool_]) -> list[int]:
    """Bands of rows, in order of score, that hold together what is not separated.

    A tier ends before the first row that is separated from, and worse than, any row of the tier.

    Parameters
    ----------
    order : sequence of int
        The rows, the best score first.
    better : (n, n) bool array
        Significant differences, as in `Separation`.

    Returns
    -------
    list of int
        The tier of each row, from 1, in the order given.

    Examples
    --------
    >>> tiers([1, 0], np.array([[False, False], [True, False]]))
    [1, 2]
    """
    found: list[int] = []
    members: list[int] = []
    tier = 1
    for row in order:
        if any(better[other, row] for other in members):
            tier += 1
            members = []
        members.append(row)
        found.append(tier)
    return found
