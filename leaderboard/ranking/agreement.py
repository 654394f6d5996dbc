"""Do two boards put the same rows in the same order? Spearman's rank correlation, track by track.

A board whose order is general gives the order of the generalisation tracks, on which no two runs are alike. The
interval is that of Fisher's z with the variance ``(1 + r^2 / 2) / (n - 3)``; it takes the n rows for a sample of rows.

Source: D. G. Bonett and T. A. Wright, "Sample size requirements for estimating Pearson, Kendall and Spearman
correlations", Psychometrika 65(1), 2000.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking import tables
from simnav.leaderboard.ranking.board import Ranking, TrackRanking

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["LEAST", "RankCorrelation", "correlation_table", "rank_correlations"]

#: With fewer rows in common an order says nothing.
LEAST = 5
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
    """

    track: str
    other: str
    rows: tuple[str, ...]
    value: float
    low: float
    high: float

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
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
            if first.score == second.score and (found_here := _correlation(first, second)) is not None:
                found.append(found_here)
    return found


def _correlation(first: TrackRanking, second: TrackRanking) -> RankCorrelation | None:
    from scipy.stats import spearmanr

    scores, others = ({r.estimator: r.score for r in t.rows if r.ranked} for t in (first, second))
    rows = tuple(name for name in scores if name in others)
    n = len(rows)
    if n < LEAST:
        return None
    value = float(spearmanr([scores[r] for r in rows], [others[r] for r in rows]).statistic)
    if math.isnan(value):  # all rows are equal
        return None
    z = math.atanh(min(max(value, -1.0 + 1e-12), 1.0 - 1e-12))
    half = _NORMAL * math.sqrt((1.0 + 0.5 * value**2) / (n - 3))
    return RankCorrelation(first.track, second.track, rows, value, math.tanh(z - half), math.tanh(z + half))


def correlation_table(found: Sequence[RankCorrelation]) -> Table:
    """A line for each pair of tracks."""
    rows = [[c.track, c.other, len(c.rows), f"{c.value:.2f}", f"{c.low:.2f} to {c.high:.2f}"] for c in found]
    columns = ["track", "other track", "rows in common", "rank correlation", "95 % interval"]
    return tables.table("Do the boards agree?", columns, rows, numeric=columns[2:])
