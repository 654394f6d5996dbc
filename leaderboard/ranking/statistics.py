"""All intervals and tests: figures of a few runs, how sure they are, and who can be told from whom.

Intervals are of 95 % and come as `Interval`:

- `median`: with a bootstrap interval; what tables show of one estimator.
- `mean`, `mean_ratio`: with Student's interval; what is compared with figures of papers.
- `interquartile_mean`: robust like the median, far less noisy with few runs (Agarwal et al., *Deep reinforcement
  learning at the edge of the statistical precipice*, NeurIPS 2021); what is ranked. `bootstrap_means` resamples it
  within each stratum (scenario), and `interval` reads the percentiles of any bootstrap distribution.

Tests are paired by run:

- `paired_test`: on one scenario, by signed ranks; `compare`: the same with the ratio of two scores (`simnav.scoring`).
- `stratified_test`: over several scenarios that count the same, by sign flips (E. J. G. Pitman 1937).
- `holm`: p-values adjusted for many tests (Holm, *A simple sequentially rejective multiple test procedure*, 1979).
- `tiers`: who cannot be told from the best, who not from the best of the rest, and so on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simnav.scoring import compare, paired_test

__all__ = [
    "RESAMPLES",
    "Interval",
    "Place",
    "bootstrap_means",
    "compare",
    "holm",
    "interquartile_mean",
    "interval",
    "mean",
    "mean_ratio",
    "median",
    "paired_test",
    "stratified_test",
    "tiers",
]

Array = NDArray[np.float64]

#: Probability of all intervals.
LEVEL = 0.95
#: Bootstrap resamples: of the ranking, of a median.
RESAMPLES, _MEDIAN_RESAMPLES = 2000, 1000
#: Sign flips of a test; of up to `_FEW` differences all are tried.
_FLIPS, _FEW = 20_000, 12


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


def median(values: Iterable[float]) -> Interval:
    """Median and its percentile-bootstrap interval, from three runs on; NaN is left out.

    >>> median([2.0, 2.0, 2.0])
    Interval(value=2.0, low=2.0, high=2.0, runs=3)
    """
    x = np.asarray([v for v in values if not math.isnan(v)], dtype=np.float64)
    if not len(x):
        return Interval(math.nan)
    value = float(np.median(x))
    if len(x) < 3 or not np.isfinite(x).all():
        return Interval(value, runs=len(x))
    draws = np.random.default_rng(0).integers(0, len(x), (_MEDIAN_RESAMPLES, len(x)))
    return Interval(value, *interval(np.median(x[draws], axis=1)), len(x))


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
    from scipy.stats import t

    half = float(t.ppf(0.5 + 0.5 * LEVEL, len(x) - 1)) * float(x.std(ddof=1)) / math.sqrt(len(x))
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


def _weights(n: int) -> Array:
    """Weights of n sorted values in their interquartile mean: how much of [i/n, (i+1)/n] is within [1/4, 3/4]."""
    edges = np.clip(np.arange(n + 1) / n, 0.25, 0.75)
    return np.asarray(2.0 * np.diff(edges))


def interquartile_mean(values: ArrayLike) -> float:
    """Mean of the middle half of the values; one that the quartiles cut counts in part.

    Parameters
    ----------
    values : (n,) array_like
        Finite, at least one.

    Raises
    ------
    ValueError
        If there are none, or one is not finite.

    Examples
    --------
    >>> interquartile_mean([1.0, 2.0, 3.0, 100.0])
    2.5
    """
    x: Array = np.sort(np.asarray(values, dtype=np.float64))
    if x.ndim != 1 or len(x) == 0 or not np.isfinite(x).all():
        raise ValueError("an interquartile mean needs a list of finite values, at least one")
    return float(_weights(len(x)) @ x)


@lru_cache(maxsize=32)
def _sorted_draws(n: int, resamples: int, seed: int) -> tuple[NDArray[np.int32], Array]:
    """Ranks of the values in each resample of n, ascending; only those that the interquartile mean weighs."""
    draws = np.random.default_rng([seed, n]).integers(0, n, (resamples, n), dtype=np.int32)
    draws.sort(axis=1)
    weights = _weights(n)
    used = np.flatnonzero(weights)
    return np.ascontiguousarray(draws[:, used]), weights[used]


def bootstrap_means(strata: Sequence[ArrayLike], *, resamples: int = RESAMPLES, seed: int = 0) -> Array:
    """Bootstrap distribution of the interquartile mean of each stratum, resampled independently.

    Parameters
    ----------
    strata : sequence of (n_s,) array_like
        Finite values, for example of one scenario each.
    resamples : int
        B.
    seed : int
        The same seed gives the same draws, whatever the order of the values.

    Returns
    -------
    (B, len(strata)) array
    """
    columns = []
    for j, values in enumerate(strata):
        x: Array = np.sort(np.asarray(values, dtype=np.float64))
        # Sorting what is drawn is drawing ranks and sorting those: the costly half does not depend on the values.
        ranks, weights = _sorted_draws(len(x), resamples, seed * 1009 + j)
        columns.append(x[ranks] @ weights)
    return np.stack(columns, axis=1)


def interval(distribution: ArrayLike, level: float = LEVEL) -> tuple[float, float]:
    """Percentile interval of a bootstrap distribution.

    Parameters
    ----------
    distribution : (B,) array_like
    level : float
    """
    low, high = np.quantile(np.asarray(distribution), [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    return float(low), float(high)


def holm(p_values: ArrayLike) -> Array:
    """P-values adjusted so that rejecting those below alpha keeps the family-wise error rate at alpha.

    Parameters
    ----------
    p_values : (m,) array_like

    Returns
    -------
    (m,) array
        In the order given.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03, 0.005])
    array([0.03, 0.06, 0.06, 0.02])
    """
    p: Array = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return adjusted


@lru_cache(maxsize=16)
def _signs(n: int) -> NDArray[np.float32]:
    """(B, n) sign flips; the first changes nothing."""
    if n <= _FEW:
        bits = np.arange(2**n)[:, None] >> np.arange(n) & 1
    else:
        bits = np.random.default_rng(n).integers(0, 2, (_FLIPS, n), dtype=np.int8)
        bits[0] = 0
    return np.asarray(1 - 2 * bits, dtype=np.float32)


def stratified_test(strata: Sequence[ArrayLike]) -> float:
    """Two-sided p-value of paired differences in strata that count the same, whatever the number in each.

    The statistic is the mean over the strata of their mean differences, which is what a score that averages scenarios
    compares. If neither side is better, the sign of each difference is anybody's: p is the share of random flips of all
    signs (all of them, if there are few) that lead as far from zero. A signed-rank test of all runs together would ask
    another question: who is better in most runs.

    Parameters
    ----------
    strata : sequence of (n_s,) array_like
        Empty ones do not count.

    Examples
    --------
    >>> stratified_test([[1.0, 2.0, 1.5], [0.2, 0.1, 0.3]])
    0.03125
    """
    arrays: list[Array] = [x for values in strata if len(x := np.asarray(values, dtype=np.float64))]
    if not arrays:
        return 1.0
    shares = np.concatenate([x / len(x) for x in arrays])
    size = np.abs(shares).max()
    if not size > 0.0:
        return 1.0
    statistics = np.abs(_signs(len(shares)) @ (shares / size).astype(np.float32))
    return float(np.mean(statistics >= statistics[0] * (1.0 - 1e-5)))


@dataclass(frozen=True)
class Place:
    """Where an entry stands.

    Attributes
    ----------
    tier : int
        From 1, the best.
    p_value : float or None
        Holm-adjusted, against the best of all; None for the best itself.
    """

    tier: int
    p_value: float | None


def tiers(
    scores: Mapping[str, float], differences: Callable[[str, str], Sequence[ArrayLike]], *, level: float = 0.05
) -> dict[str, Place]:
    """Sort entries into tiers that hold together what cannot be told apart.

    The entry with the lowest score leads the first tier; all others are tested against it, paired and Holm-corrected.
    The tier ends at the first, in order of score, that is significantly worse; that one leads the next tier, and so
    on. So an entry with few or noisy runs never stands above one with a better score that was told apart. Five runs or
    fewer never tell anything apart.

    Parameters
    ----------
    scores : mapping of name to float
        Lower is better; ties go by name.
    differences : callable
        ``differences(a, b)``: the paired differences a - b over the runs that both have, by stratum; empty if there are
        none. One stratum is tested by signed ranks, several by `stratified_test`.
    level : float
        Family-wise error rate of the tests within one tier.

    Returns
    -------
    dict of name to Place
        In order of score, and so of tier.
    """
    left = sorted(scores, key=lambda name: (scores[name], name))
    places: dict[str, Place] = {}
    from_best: dict[str, float] = {}
    tier = 0
    while left:
        tier += 1
        leader, others = left[0], left[1:]
        p = dict(zip(others, holm([_worse(differences(name, leader)) for name in others]).tolist(), strict=True))
        if tier == 1:
            from_best = p
        end = next((i for i, name in enumerate(others) if p[name] < level), len(others))
        for name in [leader, *others[:end]]:
            places[name] = Place(tier, from_best.get(name))
        left = others[end:]
    return places


def _worse(strata: Sequence[ArrayLike]) -> float:
    """Two-sided p-value of paired differences; 1 where they do not point upwards."""
    arrays: list[Array] = [np.asarray(d, dtype=np.float64) for d in strata if len(np.asarray(d))]
    if len(arrays) == 1:
        return paired_test(arrays[0]) if np.median(arrays[0]) >= 0.0 else 1.0
    return stratified_test(arrays) if arrays and np.mean([d.mean() for d in arrays]) > 0.0 else 1.0
