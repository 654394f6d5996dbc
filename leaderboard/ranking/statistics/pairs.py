"""Two rows on the same runs: the ratio of their errors, its interval and a test."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass

import numpy as np

from .intervals import FAILURE, FEWEST, mean
from .separation import separate

__all__ = ["Comparison", "compare"]


@dataclass(frozen=True)
class Comparison:
    """How row a compares with row b, run by run.

    Attributes
    ----------
    pairs : int
        Runs that both have.
    ratio, low, high : float
        Geometric mean of a / b with its 95 % interval; NaN with fewer than `FEWEST` pairs.
    better : float
        Share of the pairs in which a is below b (ties count half).
    p_value : float
        Two-sided, of the mean log ratio, as `simnav.leaderboard.ranking.statistics.separate` computes it.
    """

    pairs: int
    ratio: float
    low: float
    high: float
    better: float
    p_value: float


def compare(a: Mapping[Hashable, float], b: Mapping[Hashable, float]) -> Comparison:
    """Compare errors of two rows, paired by run.

    Parameters
    ----------
    a, b : mapping of seed to float
        The error by seed (or by any key of an independent run); positive. Only runs that both have are compared.
        Infinity stands for a failed run, NaN for one to leave out. One that failed, while the other did not, has a
        ratio of `FAILURE`, and no pair has more.

    Returns
    -------
    Comparison

    Raises
    ------
    ValueError
        If no run is common to both, or an error is not positive.

    Examples
    --------
    >>> c = compare({1: 2.0, 2: 4.0, 3: 6.0}, {1: 1.0, 2: 2.0, 3: 3.0})
    >>> c.pairs, round(c.ratio, 6)
    (3, 2.0)
    """
    keys = sorted((k for k in a if k in b and not (math.isnan(a[k]) or math.isnan(b[k]))), key=repr)
    if not keys:
        raise ValueError("the two estimators have no run in common")
    x, y = np.array([a[k] for k in keys]), np.array([b[k] for k in keys])
    if min(x.min(), y.min()) <= 0.0:
        raise ValueError("ratios need positive errors")
    cap = math.log(FAILURE)
    both = np.isinf(x) & np.isinf(y)  # both failed: no difference
    d = np.clip(np.log(np.where(both, 1.0, x)) - np.log(np.where(both, 1.0, y)), -cap, cap)
    found = mean(d.tolist())
    low, high = (found.low, found.high) if len(d) >= FEWEST else (math.nan, math.nan)
    return Comparison(
        pairs=len(d),
        ratio=math.exp(found.value),
        low=math.exp(low),
        high=math.exp(high),
        better=float(np.mean((d < 0) + 0.5 * (d == 0))),
        p_value=float(separate(np.column_stack([d, np.zeros(len(d))])).p_values[0, 1]),
    )
