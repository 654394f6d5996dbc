"""The ranking as a figure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.plots import Dot, Style, dots

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simnav.leaderboard.ranking.ranking import OverallRow

__all__ = ["ranking_figure"]

_AXIS = "Horizontal RMSE, as a multiple of the oracle's"


def ranking_figure(rows: Sequence[OverallRow], style: Style | None = None) -> Figure:
    """Overall score of every estimator with its interval; references are hollow."""
    if style is None:
        style = Style([r.estimator for r in rows], [r.estimator for r in rows if r.reference])
    points = [
        Dot(r.estimator, r.score, r.low, r.high, hollow=r.reference, note=f"({r.failed} failed)" if r.failed else "")
        for r in rows
        if math.isfinite(r.score)
    ]
    return dots(points, style, label=_AXIS, title="Overall, 95 % interval")
