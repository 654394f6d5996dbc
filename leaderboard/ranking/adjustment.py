"""Scores of rows that have run fewer seeds than others, adjusted for how hard the missing seeds are.

Some seeds are harder than others, for every row. So the mean over the first ten seeds does not compare with the mean
over thirty. The tests between rows are paired by seed and need no adjustment; the score, which is one figure a row,
does.

A row that lacks seeds is compared with the rows that have all of them. The difficulty of a seed is the median over
those rows of the logarithm of the ratio to the reference figure. The mean difficulty of all seeds less that of the
seeds of the row is added to each of its logarithms. This is the adjusted mean of an analysis of variance with rows and
seeds as its two factors (Searle, Speed and Milliken, *Population marginal means in the linear model*, The American
Statistician 1980), with a median in place of a mean, so that one row alone does not decide it.

The addend does not depend on the runs of the row itself. So a run that gets worse, or fails, still never improves the
score of its row.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["adjustments"]


def adjustments(
    figures: Mapping[str, tuple[Sequence[Hashable], NDArray[np.float64]]], others: Sequence[str] = ()
) -> dict[str, float]:
    """What is to be added to the logarithms of each row.

    Parameters
    ----------
    figures : mapping of str to tuple of a sequence and an (n,) array
        Row -> its seeds (or recordings), and the logarithms of its ratios there.
    others : sequence of str, optional
        Rows that are adjusted, and do not say how hard a seed is: references, which know what the others must estimate.

    Returns
    -------
    dict of str to float
        By row. Zero for rows that have all seeds that a row has, and for rows without a seed that such a row has.

    Examples
    --------
    The second seed is harder by 2. Row ``b`` has not run it, and gets half of that.

    >>> adjustments({"a": ([0, 1], np.array([1.0, 3.0])), "b": ([0], np.array([1.5]))})
    {'a': 0.0, 'b': 1.0}
    """
    most = max((len(units) for n, (units, _) in figures.items() if n not in others), default=0)
    complete = [(units, logs) for n, (units, logs) in figures.items() if n not in others and len(units) == most]
    if not most:
        return dict.fromkeys(figures, 0.0)
    seeds = list(complete[0][0])
    rows = [dict(zip(units, logs.tolist(), strict=True)) for units, logs in complete]
    difficulty = {s: float(np.median([row[s] for row in rows if s in row])) for s in seeds}
    mean = float(np.mean(list(difficulty.values())))
    found = {}
    for name, (units, _) in figures.items():
        there = [difficulty[s] for s in units if s in difficulty]
        found[name] = mean - float(np.mean(there)) if 0 < len(there) < len(seeds) else 0.0
    return found
