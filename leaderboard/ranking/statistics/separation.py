"""Which rows of a board can be told apart: one simultaneous test of all pairs, by a studentised bootstrap.

Given are figures (logarithms of errors) of n rows in the same runs. Two rows are equally good if the mean of their
difference is zero, whatever the distribution of the difference is. Real differences are skewed: a row is slightly
better in most runs, and much worse in a few. A test that takes the distribution for symmetric, such as sign flips,
separates such equal rows far too often.

- **Bootstrap.** Clusters are drawn with replacement, and the difference of each pair, less its mean, is divided by its
  standard error in each draw: the studentised bootstrap (Hall, *The bootstrap and Edgeworth expansion*, Springer 1992).
- **One cluster a seed.** Runs of one seed in several scenarios share random streams, and runs over one recording share
  the recording. They are one cluster: all of them are drawn together, in all pairs of rows.
- **All pairs at once.** The statistic of a pair is divided by the 99 % quantile of its own draws, so that two rows
  that scatter do not hide the difference of two steady ones (Beran, *Balanced simultaneous confidence sets*, Journal
  of the American Statistical Association 1988). The p-value of a pair is the share of the draws in which the largest
  statistic of any pair that is not more extreme reaches the pair's own: the step-down procedure with maxima (Romano
  and Wolf, *Exact and approximate stepdown methods for multiple hypothesis testing*, Journal of the American
  Statistical Association 2005).
- **One more unlucky run.** No test of a few runs can see a rare bad run that has not happened yet. But the other rows
  of the board show how far out such a run is. So a difference has to hold also if the better row has one more run that
  is as unlucky, for its scatter, as one in four times as many runs of all rows (`unlucky_excess`). A row that scatters
  less than three quarters of the rows is taken to scatter as these do: its bad run may not have happened yet.
- **Relevance.** A difference of less than `RELEVANT` is none, so that rounding does not rank rows.
- **Rank intervals** follow from the pairs: a row's best possible rank is 1 plus the number of rows that are separated
  from it and better (Mogstad, Romano, Shaikh and Wilhelm, *Inference for ranks with applications to mobility across
  neighborhoods and academic achievement across countries*, Review of Economic Studies 2024).
- **The set that may be best** is found by elimination: as long as the rows that are left are not equally good, the one
  that is the worst of any pair goes (Hansen, Lunde and Nason, *The model confidence set*, Econometrica 2011).

``docs/statistics.md`` has what was measured: how often equal rows are separated, with the differences of real rows.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .intervals import FEWEST, codes

__all__ = ["RELEVANT", "Separation", "separate", "smallest_p_value", "unlucky_excess"]

Array = NDArray[np.float64]

#: Family-wise error rate: probability that any two equal rows of a board are separated.
ALPHA = 0.05
#: Draws of the bootstrap.
DRAWS = 2000
#: Differences of a smaller share are none.
RELEVANT = 0.001

_UNLUCKY = 0.25  # how many runs of a row, in all its runs, are as bad as the one that is added
#: The scatter that a row has at least, as a quantile of that of all rows. A test of all pairs finds the luckiest row,
#: whose scatter says least, so that its rows are taken for rather scattered ones; for one row alone it is the median.
_OF_ONE, _OF_ALL = 0.5, 0.75
_TINY = 1e-12  # of the largest difference: what is smaller is rounding
_LEAST_VARIANCE = 0.01  # of a draw, as a share of the variance of the sample
_FEWEST_VISIBLE = 2.0  # clusters that the scatter of a pair has to come from, to count for the others
_USUAL, _LEAST_USUAL = 0.99, 2.5  # quantile of the statistic of a pair; that of a normal one is 2.58
_CLEAR = np.float32(1e9)  # statistic of a difference without any scatter


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
    return 1.0 if clusters < 1 else max(0.5 ** (clusters - 1), 1.0 / (DRAWS + 1))


def separate(
    values: ArrayLike,
    strata: Sequence[Hashable] | None = None,
    clusters: Sequence[Hashable] | None = None,
    level: float = ALPHA,
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
    level : float
        Probability that any two equal rows are separated, and that the best row is not in the set that may be best.

    Returns
    -------
    Separation

    Examples
    --------
    >>> values = np.array([[0.0, 0.01 * (k % 3 - 1), 2.0 + 0.1 * (k % 4)] for k in range(12)])
    >>> found = separate(values)
    >>> found.rank_low.tolist(), found.rank_high.tolist(), found.may_be_best.tolist()
    ([1, 1, 3], [2, 2, 3], [True, True, False])
    """
    x: Array = np.asarray(values, dtype=np.float64)
    u, n = x.shape
    stratum = codes([0] * u if strata is None else strata)
    cluster = codes(range(u) if clusters is None else clusters)
    count = int(cluster.max()) + 1 if u else 0
    first, second = np.triu_indices(n, 1)
    if count < FEWEST or not len(first):
        return _conclude(np.ones((n, n)), np.zeros((n, n)), np.ones(n, dtype=bool), count, level)
    observed, drawn = _statistics(x, stratum, cluster, count, first, second)

    p = np.ones((n, n))
    p[first, second] = p[second, first] = _step_down(observed, drawn)
    sign = np.zeros((n, n))
    sign[first, second], sign[second, first] = np.sign(observed), -np.sign(observed)
    best = _confidence_set(n, observed, drawn, first, second, level)
    return _conclude(np.maximum(p, smallest_p_value(count)), sign, best, count, level)


@lru_cache(maxsize=8)
def _weights(clusters: int) -> NDArray[np.float32]:
    """(B, K) how often each cluster is in each draw, divided by their number."""
    drawn = np.random.default_rng(clusters).multinomial(clusters, np.full(clusters, 1.0 / clusters), DRAWS)
    return np.asarray(drawn / clusters, dtype=np.float32)


def unlucky_excess(
    values: ArrayLike, strata: Sequence[Hashable] | None = None, clusters: Sequence[Hashable] | None = None
) -> Array:
    """By how much an unlucky run of each row is worse than its others.

    The excess of a row in a cluster is its figure less its mean, and less the median excess of all rows, because a hard
    run is hard for all. Divided by the row's scatter, the excesses of all rows are pooled. An unlucky run has the one
    that n / 4 of them reach, times the scatter of the row, or of the median row where that is larger.

    Parameters
    ----------
    values : (u, n) array_like
        Figures of n rows in u runs, which all rows have.
    strata, clusters : sequence of u, optional
        As for `separate`.

    Returns
    -------
    (n,) array

    Examples
    --------
    >>> x = np.zeros((5, 4))
    >>> x[2, 3] = 1.0
    >>> unlucky_excess(x).round(3).tolist()
    [0.0, 0.0, 0.0, 0.8]
    """
    x: Array = np.asarray(values, dtype=np.float64)
    stratum = codes([0] * len(x) if strata is None else strata)
    cluster = codes(range(len(x)) if clusters is None else clusters)
    return _excess(_shares(x, stratum, cluster), _OF_ONE)


def _excess(shares: Array, quantile: float) -> Array:
    """`unlucky_excess`, given the figures of the clusters (K, n), and the quantile of the least scatter."""
    count, rows = shares.shape
    if count < 2 or not rows:
        return np.zeros(rows)
    excess = shares - shares.mean(axis=0)
    excess -= np.median(excess, axis=1, keepdims=True)
    scatter = np.sqrt(np.sum(excess**2, axis=0) / (count - 1))
    reached = min(max(round(_UNLUCKY * rows), 1), shares.size - 1)
    far = np.sort(excess / np.maximum(scatter, 1e-300), axis=None)[-reached]
    return np.asarray(max(float(far), 0.0) * np.maximum(scatter, np.sqrt(np.quantile(scatter**2, quantile))))


def _statistics(
    x: Array,
    stratum: NDArray[np.int64],
    cluster: NDArray[np.int64],
    count: int,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Signed statistics (P,) of the pairs as they are, and their sizes (P, B) in each draw.

    Rows that have the same runs are treated together, so that the draws are one product of matrices.
    """
    present = np.isfinite(x)
    patterns, pattern = np.unique(present, axis=1, return_inverse=True)
    pattern = pattern.ravel()
    observed = np.zeros(len(first), dtype=np.float32)
    sizes = np.zeros((len(first), DRAWS), dtype=np.float32)
    low, high = np.minimum(pattern[first], pattern[second]), np.maximum(pattern[first], pattern[second])
    for g, h in sorted(set(zip(low.tolist(), high.tolist(), strict=True))):
        here = np.flatnonzero((low == g) & (high == h))
        rows = np.flatnonzero((pattern == g) | (pattern == h))
        common = patterns[:, g] & patterns[:, h]
        shares = _shares(x[np.ix_(common, rows)], stratum[common], cluster[common])
        if len(shares) < FEWEST:
            continue
        i, j = np.searchsorted(rows, first[here]), np.searchsorted(rows, second[here])
        excess = _excess(shares, _OF_ALL)
        observed[here], sizes[here] = _studentised(shares[:, i] - shares[:, j], excess[i], excess[j])
    return observed, sizes


def _studentised(difference: Array, first: Array, second: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Statistics (P,) of differences (K, P) of pairs in K clusters, and their sizes (P, B) in each draw.

    ``first`` and ``second`` (P,) are the excesses of an unlucky run of the two rows. A pair whose scatter comes from
    one cluster alone says nothing of the distribution: it is not in the draws, and its own unlucky run is at least as
    bad as that cluster.
    """
    count = len(difference)
    mean = difference.mean(axis=0)
    residual = difference - mean
    square = np.sum(residual**2, axis=0)
    still = square <= (_TINY * max(float(np.abs(difference).max()), 1e-300)) ** 2 * count
    with np.errstate(invalid="ignore", divide="ignore"):
        visible = np.where(still, 0.0, square**2 / np.sum(residual**4, axis=0)) >= _FEWEST_VISIBLE
    unlucky = np.where(mean < 0.0, first, second)  # lower is better
    unlucky = np.where(visible, unlucky, np.maximum(unlucky, np.abs(residual).max(axis=0)))
    # How far a mean is from zero, less what is not relevant; with and without the unlucky run of the better row.
    distance = np.maximum(np.abs(mean) - np.log1p(RELEVANT), 0.0)
    statistic = np.minimum(
        _ratio(distance, square, count),
        _ratio(
            np.maximum((count * distance - unlucky) / (count + 1), 0.0),
            square + (distance + unlucky) ** 2 * count / (count + 1),
            count + 1,
        ),
    )
    used = np.where(still, 0.0, residual).astype(np.float32)
    weights = _weights(count)
    means = weights @ used
    variance = np.maximum(weights @ used**2 - means**2, _LEAST_VARIANCE * used.var(axis=0))
    with np.errstate(invalid="ignore", divide="ignore"):
        sizes = np.where(still, 0.0, np.abs(means) * np.sqrt((count - 1) / variance)).T
    usual = np.maximum(np.quantile(sizes, _USUAL, axis=1), _LEAST_USUAL)
    observed = np.asarray(np.sign(mean) * statistic / usual, dtype=np.float32)
    return observed, np.asarray(np.where(visible[:, None], sizes / usual[:, None], 0.0), dtype=np.float32)


def _ratio(distance: Array, square: Array, count: int) -> Array:
    """A mean over its standard error, given the sum of squares of the residuals."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = distance * np.sqrt(count * (count - 1) / square)
    return np.where(distance > 0.0, np.minimum(found, _CLEAR), 0.0)


def _shares(x: Array, stratum: NDArray[np.int64], cluster: NDArray[np.int64]) -> Array:
    """(K, n) figures of the clusters whose mean is the mean over the strata of each row's mean.

    What all rows have in common is left out.
    """
    found, cluster = np.unique(cluster, return_inverse=True)
    runs = np.bincount(stratum)
    weight = len(found) / (np.count_nonzero(runs) * runs[stratum])
    shares = np.zeros((len(found), x.shape[1]))
    if len(found):
        np.add.at(shares, cluster.ravel(), weight[:, None] * (x - x.mean(axis=1, keepdims=True)))
    return shares


def _reached(drawn: NDArray[np.float32], size: np.float32) -> float:
    """Share of the draws (B,), and of what was observed, that reach a size."""
    return float((1 + np.count_nonzero(drawn >= size * np.float32(1.0 - 1e-5))) / (len(drawn) + 1))


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
    n: int,
    observed: NDArray[np.float32],
    drawn: NDArray[np.float32],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    level: float,
) -> NDArray[np.bool_]:
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
        if value > level:
            break
        inside[row] = False
    return inside


def _conclude(p: Array, sign: Array, best: NDArray[np.bool_], clusters: int, level: float) -> Separation:
    better = (p <= level) & (sign < 0.0)  # lower is better
    n = len(p)
    return Separation(p, better, 1 + better.sum(axis=0), n - better.sum(axis=1), best, clusters)
