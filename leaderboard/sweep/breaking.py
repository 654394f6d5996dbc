"""The breaking point: the value of a dial at which the error of an estimator passes a threshold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simnav.leaderboard.ranking.statistics import Interval

__all__ = ["BreakingPoint", "breaking_point", "crossing", "goes_down"]

Array = NDArray[np.float64]

#: Resamples of the seeds for the interval of a breaking point.
_RESAMPLES = 400


@dataclass(frozen=True)
class BreakingPoint:
    """Where an estimator breaks.

    Attributes
    ----------
    estimator : str
        Label of the estimator.
    criterion : str
        ``twice-clean``: its median error passes twice that at the clean value; ``limit``: it passes the limit.
    threshold : float
        In the unit of the score.
    value : Interval
        Of the dial, with its 95 % interval over the seeds, from the end that is nearer to the clean value. Infinite
        where the error stays below the threshold up to the last value of the sweep: it breaks beyond, or not at all.
    at : float or None
        Value of the second dial of a map.
    """

    estimator: str
    criterion: str
    threshold: float
    value: Interval
    at: float | None = None


def crossing(dial: Array, error: Array, threshold: float) -> float:
    """Where a curve first passes a threshold, by linear interpolation between its points; infinite where it does not.

    Parameters
    ----------
    dial, error : (n,) array
        Ascending values, and the error at each; infinite errors are failures.
    threshold : float
        Error that is passed.

    Examples
    --------
    >>> crossing(np.array([0.0, 1.0, 2.0]), np.array([1.0, 1.5, 3.5]), 2.5)
    1.5
    """
    above = np.flatnonzero(error > threshold)
    if not len(above):
        return math.inf
    k = int(above[0])
    if k == 0 or not np.isfinite(error[k]):
        return float(dial[k])
    share = (threshold - error[k - 1]) / (error[k] - error[k - 1])
    return float(dial[k - 1] + share * (dial[k] - dial[k - 1]))


def goes_down(dial: Sequence[float], clean: int) -> bool:
    """Whether the breaking point is searched downwards: the clean value, given by its number, is the highest."""
    return len(dial) > 1 and clean == len(dial) - 1


def breaking_point(
    estimator: str,
    dial: Sequence[float],
    errors: Array,
    limit: float | None,
    *,
    clean: int = 0,
    at: float | None = None,
) -> BreakingPoint:
    """The breaking point of one estimator.

    Parameters
    ----------
    estimator : str
        Label of the estimator.
    dial : sequence of float
        Values, ascending.
    errors : (runs, n) array
        Error of each seed at each value; infinite where a run failed.
    limit : float, optional
        Limit of the error. Default: twice the median error at the clean value.
    clean : int
        Number of the clean value; the search goes up from it, or down where it is the highest.
    at : float, optional
        Value of the second dial.
    """
    x, y = np.asarray(dial, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    down = goes_down(dial, clean)
    x, y = (-x[::-1], y[:, ::-1]) if down else (x[clean:], y[:, clean:])

    def found(rows: Array) -> tuple[float, float]:
        middle = np.median(rows, axis=0)
        threshold = 2.0 * float(middle[0]) if limit is None else limit
        return crossing(x, middle, threshold), threshold

    def of_dial(value: float) -> float:
        return -value if down and math.isfinite(value) else value

    criterion = "twice-clean" if limit is None else "limit"
    if not len(y):
        return BreakingPoint(estimator, criterion, math.nan if limit is None else limit, Interval(math.nan), at)
    value, threshold = found(y)
    low, high, n = math.nan, math.nan, len(y)
    if n >= 3:
        draws = np.random.default_rng(0).integers(0, n, (_RESAMPLES, n))
        values = [found(y[rows])[0] for rows in draws]
        low, high = np.quantile(values, (0.025, 0.975), method="nearest").tolist()  # some may be infinite
    interval = Interval(of_dial(value), of_dial(low), of_dial(high), n)
    return BreakingPoint(estimator, criterion, threshold, interval, at)
