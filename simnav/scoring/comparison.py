"""Two estimators on the same seeds: paired differences, their interval and a test."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from simnav.types import Array

__all__ = ["Comparison", "compare", "paired_test"]


@dataclass(frozen=True)
class Comparison:
    """How estimator a compares with estimator b, run by run.

    Attributes
    ----------
    pairs : int
        Runs that both have.
    mean, median : float
        Of the differences a - b, or of the log ratios ln(a / b).
    low, high : float
        95 % bootstrap interval of the mean; NaN with fewer than two pairs.
    better : float
        Share of pairs in which a is below b (ties count half).
    p_value : float
        Two-sided, of `paired_test`.
    logarithmic : bool
        Whether these are log ratios.
    """

    pairs: int
    mean: float
    median: float
    low: float
    high: float
    better: float
    p_value: float
    logarithmic: bool

    @property
    def ratio(self) -> float:
        """Geometric mean of a / b; NaN for plain differences."""
        return float(np.exp(self.mean)) if self.logarithmic else float("nan")


def compare(
    a: Mapping[Hashable, float],
    b: Mapping[Hashable, float],
    *,
    logarithmic: bool = True,
    test: Literal["wilcoxon", "sign"] = "wilcoxon",
    resamples: int = 2000,
) -> Comparison:
    """Compare a score of two estimators, paired by seed.

    Parameters
    ----------
    a, b : mapping of seed to float
        The score by seed (or by any key of a run). Only runs that both have are compared; infinity stands for a failed
        run, NaN for one to leave out.
    logarithmic : bool
        Compare log ratios, the scale on which errors of runs are comparable; the scores must be positive.
    test : str
        As in `paired_test`.
    resamples : int
        Of the bootstrap.

    Returns
    -------
    Comparison

    Raises
    ------
    ValueError
        If no run is common to both, or a score is not positive where log ratios are asked.

    Examples
    --------
    >>> c = compare({1: 2.0, 2: 4.0, 3: 6.0}, {1: 1.0, 2: 2.0, 3: 3.0})
    >>> c.pairs, round(c.ratio, 6)
    (3, 2.0)
    """
    keys = sorted((k for k in a if k in b and not (np.isnan(a[k]) or np.isnan(b[k]))), key=repr)
    if not keys:
        raise ValueError("the two estimators have no run in common")
    x, y = np.array([a[k] for k in keys]), np.array([b[k] for k in keys])
    if logarithmic:
        if min(x.min(), y.min()) <= 0.0:
            raise ValueError("log ratios need positive scores; use logarithmic=False")
        x, y = np.log(x), np.log(y)
    both = np.isinf(x) & (x == y)  # both failed: no difference
    d = np.where(both, 0.0, np.where(both, 0.0, x) - np.where(both, 0.0, y))
    low = high = float("nan")
    if len(d) > 1:
        rng = np.random.default_rng(0)
        means = d[rng.integers(0, len(d), (resamples, len(d)))].mean(axis=1) if np.isfinite(d).all() else None
        if means is not None:
            low, high = (float(q) for q in np.quantile(means, [0.025, 0.975]))
    with np.errstate(invalid="ignore"):  # failures on both sides: the mean of +inf and -inf is unknown
        mean = float(np.mean(d))
    return Comparison(
        pairs=len(d),
        mean=mean,
        median=float(np.median(d)),
        low=low,
        high=high,
        better=float(np.mean((d < 0) + 0.5 * (d == 0))),
        p_value=paired_test(d, method=test),
        logarithmic=logarithmic,
    )


def paired_test(differences: ArrayLike, *, method: Literal["wilcoxon", "sign"] = "wilcoxon") -> float:
    """Two-sided p-value that paired differences are centred at zero.

    Parameters
    ----------
    differences : (n,) array_like
        Infinite ones rank above all finite ones. Zeros are split between the signs (Wilcoxon, after Pratt's ranking
        of zeros: "zsplit") or left out (sign test).
    method : str
        ``wilcoxon``: the signed-rank test, exact for small samples; ``sign``: the binomial sign test, which assumes
        no symmetry.

    Returns
    -------
    float
        1 where there is nothing to tell apart (no differences, or all zero).
    """
    from scipy import stats

    d: Array = np.asarray(differences, dtype=np.float64).ravel()
    if len(d) == 0 or not d.any():
        return 1.0
    if method == "sign":
        signs = d[d != 0.0] > 0.0
        return float(stats.binomtest(int(signs.sum()), len(signs)).pvalue)
    finite = np.abs(d[np.isfinite(d)])
    worst = 2.0 * finite.max(initial=0.5)
    d = np.clip(d, -worst, worst)  # only ranks matter
    return float(stats.wilcoxon(d, zero_method="zsplit").pvalue)
