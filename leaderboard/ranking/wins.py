"""How often a row has a smaller error than another one on the same run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simnav.types import Array

    from .board import ScenarioRanking

__all__ = ["wins"]

_EQUAL = 1e-9  # relative: two rows that differ by less have the same error


def wins(rows: Sequence[str], scenarios: Sequence[ScenarioRanking]) -> Array:
    """The share of the runs that each row wins against each other one.

    Each scenario that two rows have in common counts the same. Two equal errors, or two failures, are half a win for
    both.

    Parameters
    ----------
    rows : sequence of str
        Labels of n rows.
    scenarios : sequence of ScenarioRanking
        The scenarios whose runs are counted.

    Returns
    -------
    (n, n) array
        In line i and column k the share of the runs in which row i has a smaller error than row k; NaN on the diagonal
        and where two rows have no run in common.
    """
    n = len(rows)
    total, count = np.zeros((n, n)), np.zeros((n, n))
    for scenario in scenarios:
        ratios = {row.estimator: row.ratios for row in scenario.rows}
        runs = sorted({run for name in rows for run in ratios.get(name, ())})
        error = np.array([[ratios.get(name, {}).get(run, np.nan) for run in runs] for name in rows])
        first, second = error[:, None], error[None]
        equal = np.abs(first - second) <= _EQUAL * np.minimum(np.abs(first), np.abs(second))
        equal |= np.isinf(first) & np.isinf(second)
        both = ~(np.isnan(first) | np.isnan(second))
        won = np.where(equal, 0.5, np.where(first < second, 1.0, 0.0)) * both
        shared = both.sum(axis=2)
        total += won.sum(axis=2) / np.maximum(shared, 1)
        count += shared > 0
    with np.errstate(invalid="ignore"):
        share: Array = total / np.where(count > 0, count, np.nan)
    np.fill_diagonal(share, np.nan)
    return share
