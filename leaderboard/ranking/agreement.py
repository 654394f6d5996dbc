"""Do two boards put the same rows in the same order? Spearman's rank correlation, track by track.

A board whose order is general gives the order of the generalisation tracks, on which no two runs are alike. Good rows
are easily told from bad ones on any board, so the correlation within the leading rows is reported, too. The interval
is that of Fisher's z with the variance ``(1 + r^2 / 2) / (n - 3)``; it takes the n rows for a sample of rows.

Source: D. G. Bonett and T. A. Wright, "Sample size requirements for estimating Pearson, Kendall and Spearman
correlations", Psychometrika 65(1), 2000.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from . import tables
from .board import Ranking, TrackRanking

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["LEADING", "LEAST", "RankCorrelation", "correlation_table", "rank_correlation", "rank_correlations"]

#: With fewer rows in common an order says nothing.
LEAST = 5
#: Rows of the first board that count as leading.
LEADING = 20
_NORMAL = 1.959964  # 97.5 % quantile


@dataclass(frozen=True)
class RankCorrelation:
    """The agreement of two tracks.

    Attributes
    ----------
    track, other : str
        Name of the track on the first board, and on the second.
    rows : tuple of str
        Ranked on both, in the order of the first.
    value, low, high : float
        Spearman's correlation of their scores, with a 95 % interval.
    leading : int
        How many of these rows are among the first `LEADING` of the first board.
    leading_value, leading_low, leading_high : float
        The correlation within those; NaN with fewer than `LEAST`.
    """

    track: str
    other: str
    rows: tuple[str, ...]
    value: float
    low: float
    high: float
    leading: int = 0
    leading_value: float = math.nan
    leading_low: float = math.nan
    leading_high: float = math.nan

    def to_dict(self) -> dict[str, Any]:
        """The fields as values that JSON can hold."""
        return asdict(self)


def rank_correlations(board: Ranking, other: Ranking) -> list[RankCorrelation]:
    """The correlation of every track of one board with every track of another that is ranked by the same score.

    Parameters
    ----------
    board, other : Ranking
        They may be the same: then each two of its tracks are compared once.

    Returns
    -------
    list of RankCorrelation
        Correlations of the tracks that have at least `LEAST` rows in common.
    """
    same = board is other
    found = []
    for k, first in enumerate(board.tracks):
        for second in other.tracks[k + 1 :] if same else other.tracks:
            if first.score == second.score and (found_here := rank_correlation(first, second)) is not None:
                found.append(found_here)
    return found


def rank_correlation(first: TrackRanking, second: TrackRanking) -> RankCorrelation | None:
    """The correlation of two tracks; None with fewer than `LEAST` ranked rows in common, or where all are equal."""
    scores, others = ({r.estimator: r.score for r in t.rows if r.ranked} for t in (first, second))
    rows = tuple(name for name in scores if name in others)
    leaders = set(sorted(scores, key=lambda name: scores[name])[:LEADING])
    leading = [name for name in rows if name in leaders]
    value, low, high = _spearman([scores[r] for r in rows], [others[r] for r in rows])
    if math.isnan(value):  # too few rows, or all are equal
        return None
    within = _spearman([scores[r] for r in leading], [others[r] for r in leading])
    return RankCorrelation(first.track, second.track, rows, value, low, high, len(leading), *within)


def _spearman(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    """The rank correlation and its interval; NaN with fewer than `LEAST` rows, or where all are equal."""
    if len(a) < LEAST or len(set(a)) < 2 or len(set(b)) < 2:
        return math.nan, math.nan, math.nan
    from scipy.stats import spearmanr

    value = float(spearmanr(a, b).statistic)
    z = math.atanh(min(max(value, -1.0 + 1e-12), 1.0 - 1e-12))
    half = _NORMAL * math.sqrt((1.0 + 0.5 * value**2) / (len(a) - 3))
    return value, math.tanh(z - half), math.tanh(z + half)


def correlation_table(found: Sequence[RankCorrelation]) -> Table:
    """A line for each pair of tracks."""
    rows = [
        [c.track, c.other, len(c.rows), f"{c.value:.2f}", f"{c.low:.2f} to {c.high:.2f}", *_within(c)] for c in found
    ]
    columns = ["track", "other track", "rows in common", "rank correlation", "95 % interval", "leading rows",
               "within these", "95 % interval of these"]  # fmt: skip
    return tables.table("Do the boards agree?", columns, rows, numeric=columns[2:])


def _within(c: RankCorrelation) -> list[str]:
    if math.isnan(c.leading_value):
        return [str(c.leading), tables.MISSING, tables.MISSING]
    return [str(c.leading), f"{c.leading_value:.2f}", f"{c.leading_low:.2f} to {c.leading_high:.2f}"]
