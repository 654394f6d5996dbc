"""Figures of one row over its runs, with their intervals.

The score
    The geometric mean over the runs of the ratio of the error to a fixed reference figure; each scenario counts the
    same. A failed run has the ratio `FAILURE`, and no run has more. All runs count, and each counts with a weight above
    zero: so a run that gets worse, or fails, never improves the score. (A median or a trimmed mean would not notice.)
    The geometric mean is the mean on the scale on which errors of navigation are spread, the logarithmic one.

Its interval
    Student's, on the logarithmic scale, for the errors of the runs that were completed; the share of failed runs is
    taken as it was observed, and has an interval of its own (`share`). Runs of one seed in several scenarios share
    random streams. So the seed is the independent unit: the contributions of a seed are added before they are compared
    with those of the other seeds (a cluster-robust variance: Cameron and Miller, *A practitioner's guide to
    cluster-robust inference*, Journal of Human Resources 2015), and the degrees of freedom are those of Welch and
    Satterthwaite, at most the number of seeds less one. Errors are skewed, and a rare bad run may not have happened
    yet. So the upper end is at least that of Student's interval with one more run that is unlucky (``excess``).

There are no intervals of fewer than `FEWEST` runs, and none of a score of fewer than `FEWEST_SEEDS`.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "FAILURE",
    "FEWEST",
    "FEWEST_SEEDS",
    "Interval",
    "codes",
    "mean",
    "mean_ratio",
    "median",
    "score",
    "share",
    "weighted_quantile",
]

Array = NDArray[np.float64]

#: Probability of all intervals.
LEVEL = 0.95
#: Fewest runs of which an interval is given. Of five, the smallest and the largest hold the median in 93.75 % only.
FEWEST = 6
#: Fewest seeds of which the interval of a score is given: with fewer it would hold the truth in less than 93 %.
FEWEST_SEEDS = 10
#: Ratio to the reference figure that stands for a failed run, and that no run exceeds.
FAILURE = 1000.0


@dataclass(frozen=True)
class Interval:
    """A figure with its 95 % interval.

    Attributes
    ----------
    value, low, high : float
        NaN where there is none.
    runs : int
        How many runs it is of.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    runs: int = 0


def score(
    values: ArrayLike,
    strata: Sequence[Hashable] | None = None,
    clusters: Sequence[Hashable] | None = None,
    failed: ArrayLike | None = None,
    excess: float = 0.0,
) -> Interval:
    """Geometric mean of ratios, in which each stratum counts the same, with its interval.

    Parameters
    ----------
    values : (n,) array_like
        Natural logarithms of the ratios; those of failed runs are not looked at.
    strata : sequence of n, optional
        The scenario of each run. Default: one.
    clusters : sequence of n, optional
        The independent unit of each run, its seed or recording. Default: each run is one.
    failed : (n,) bool array_like, optional
        The runs that count as `FAILURE`. Default: none.
    excess : float
        By how much an unlucky seed is worse than others, as a logarithm: from
        `simnav.leaderboard.ranking.statistics.separation.unlucky_excess` for all rows of a board.

    Returns
    -------
    Interval
        As ratios. Without an interval where a stratum has fewer than `FEWEST_SEEDS` runs, or one run that did not fail.

    Examples
    --------
    Of three runs with the ratios 1, 10 and a failure, the score is the cube root of 10 000.

    >>> round(score([0.0, math.log(10.0), 0.0], failed=[False, False, True]).value ** 3)
    10000
    """
    x: Array = np.asarray(values, dtype=np.float64)
    n = len(x)
    if not n:
        return Interval(math.nan)
    cap = math.log(FAILURE)
    bad = np.zeros(n, dtype=bool) if failed is None else np.asarray(failed, dtype=bool)
    x = np.where(bad, cap, np.minimum(x, cap))
    stratum = codes([0] * n if strata is None else strata)
    cluster = codes(range(n) if clusters is None else clusters)
    runs = np.bincount(stratum).astype(np.float64)
    value = float(np.mean(np.bincount(stratum, x) / runs))
    good = np.bincount(stratum[~bad], minlength=len(runs)).astype(np.float64)
    result = Interval(math.exp(value), runs=n)
    if runs.min() < FEWEST_SEEDS or (good == 1.0).any():
        return result
    centre = np.bincount(stratum[~bad], x[~bad], len(runs)) / np.maximum(good, 1.0)
    inside, seeds = stratum[~bad], cluster[~bad]
    # Residuals of a mean of m are short by the root of (m - 1) / m.
    residual = (x[~bad] - centre[inside]) * np.sqrt(good[inside] / (good[inside] - 1.0)) / (len(runs) * runs[inside])
    by_cluster = np.bincount(seeds, residual)
    variance = float(np.sum(by_cluster**2))
    parts = np.bincount(inside, residual**2, len(runs))
    if not variance > 0.0:
        return Interval(math.exp(value), math.exp(value), math.exp(value), n)
    known = parts > 0.0
    freedom = parts.sum() ** 2 / np.sum(parts[known] ** 2 / (good[known] - 1.0))
    from scipy.special import stdtrit

    count = len(np.unique(seeds))
    student = float(stdtrit(min(freedom, count - 1.0), 0.5 * (1.0 + LEVEL)))
    reach = student * math.sqrt(variance)
    # One more seed, with the figure of the others and the excess: the mean, and its variance.
    shift = excess / (count + 1)
    wider = (variance * (count - 1) + excess**2 / (count + 1)) / (count + 1)
    high = max(value + reach, value + shift + student * math.sqrt(wider))
    return Interval(math.exp(value), math.exp(value - reach), math.exp(min(high, 700.0)), n)


def codes(items: Iterable[Hashable]) -> NDArray[np.int64]:
    """A number from 0 on for each item, the same for equal ones, in the order in which they come first."""
    known: dict[Hashable, int] = {}
    return np.array([known.setdefault(item, len(known)) for item in items], dtype=np.int64)


def share(count: int, runs: int) -> Interval:
    """A share of runs, for example of those that failed, with the exact interval of Clopper and Pearson (1934).

    Parameters
    ----------
    count, runs : int
        Number of runs with the property, and number of all runs.

    Examples
    --------
    >>> s = share(0, 10)
    >>> s.value, s.low, round(s.high, 3)
    (0.0, 0.0, 0.308)
    """
    if runs < 1:
        return Interval(math.nan)
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - LEVEL)
    low = float(betaincinv(count, runs - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, runs - count, 1.0 - tail)) if count < runs else 1.0
    return Interval(count / runs, low, high, runs)


def median(values: Iterable[float]) -> Interval:
    """Median with the interval between order statistics; NaN is left out.

    The interval is interpolated between the two pairs of order statistics whose exact probabilities enclose 95 % (T. P.
    Hettmansperger and S. J. Sheather, *Confidence intervals based on interpolated order statistics*, Statistics &
    Probability Letters 4, 1986). It makes no assumption on the distribution.

    Examples
    --------
    >>> median([2.0, 2.0, 2.0]).low, median([2.0] * 6)
    (nan, Interval(value=2.0, low=2.0, high=2.0, runs=6))
    """
    x = np.asarray(values if isinstance(values, np.ndarray) else list(values), dtype=np.float64)
    x = np.sort(x[~np.isnan(x)])
    n = len(x)
    if not n:
        return Interval(math.nan)
    value = float(0.5 * (x[(n - 1) // 2] + x[n // 2]))
    if n < FEWEST or not np.isfinite(x).all():
        return Interval(value, runs=n)
    k, part = _order(n)
    low = (1.0 - part) * x[k - 1] + part * x[k]
    high = (1.0 - part) * x[n - k] + part * x[n - k - 1]
    return Interval(value, float(low), float(high), n)


def _order(n: int) -> tuple[int, float]:
    """The rank k whose interval [x_k, x_(n-k+1)] holds the median in 95 % or more, and how far to go to the next."""
    from scipy.special import bdtr

    k = 1
    while k + 1 <= n // 2 and 1.0 - 2.0 * bdtr(k, n, 0.5) >= LEVEL:
        k += 1
    outer, inner = 1.0 - 2.0 * bdtr(k - 1, n, 0.5), 1.0 - 2.0 * bdtr(k, n, 0.5)
    step = (outer - LEVEL) / (outer - inner)
    return k, float((n - k) * step / (k + (n - 2 * k) * step))


def mean(values: Iterable[float]) -> Interval:
    """Mean and Student's interval, from two runs on; values that are not finite are left out.

    Examples
    --------
    Student's t with 2 degrees of freedom is 4.303; the standard error of 1, 2, 3 is 1 / sqrt(3).

    >>> i = mean([1.0, 2.0, 3.0])
    >>> i.value, round(i.high - 2.0, 3) == round(4.3027 / 3**0.5, 3)
    (2.0, True)
    """
    x = np.array([v for v in values if math.isfinite(v)], dtype=np.float64)
    if not len(x):
        return Interval(math.nan)
    value = float(x.mean())
    if len(x) < 2:
        return Interval(value, runs=len(x))
    from scipy.special import stdtrit

    half = float(stdtrit(len(x) - 1.0, 0.5 + 0.5 * LEVEL)) * float(x.std(ddof=1)) / math.sqrt(len(x))
    return Interval(value, value - half, value + half, len(x))


def mean_ratio(a: Mapping[int, float], b: Mapping[int, float]) -> Interval:
    """Geometric mean of a / b over the seeds that both have, with its interval; only positive scores have ratios.

    Examples
    --------
    >>> mean_ratio({0: 2.0, 1: 8.0}, {0: 1.0, 1: 1.0, 2: 5.0}).value
    4.0
    """
    seeds = [s for s in a if s in b and a[s] > 0.0 and b[s] > 0.0]
    logs = mean(math.log(a[s] / b[s]) for s in seeds)
    return Interval(math.exp(logs.value), math.exp(logs.low), math.exp(logs.high), logs.runs)


def weighted_quantile(values: ArrayLike, weights: ArrayLike, q: float) -> float:
    """The smallest of the values that, with all below it, has at least the share q of the weight; NaN without any.

    Examples
    --------
    >>> weighted_quantile([1.0, 2.0, 3.0], [1.0, 1.0, 2.0], 0.5)
    2.0
    """
    x, w = np.asarray(values, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    if not len(x):
        return math.nan
    order = np.argsort(x, kind="stable")
    reached = np.cumsum(w[order]) / w.sum()
    return float(x[order][min(int(np.searchsorted(reached, q - 1e-12)), len(x) - 1)])
