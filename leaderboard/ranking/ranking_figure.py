"""The ranking of a track as a figure."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.plots import Dot, dots
from simnav.leaderboard.figures.style import Style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .rows import TrackRow, TrackTable

__all__ = ["ranking_figure"]


def ranking_figure(track: TrackTable, most: int | None = None) -> Figure:
    """Score of every estimator of a track with its interval; what is not ranked is grey, and references are hollow.

    Parameters
    ----------
    track : TrackTable
        The ranking that is drawn.
    most : int, optional
        Ranked rows that are drawn, the best first; what is not ranked is left out then, but for references.
    """
    best = [r for r in track.rows if r.ranked][:most]
    rows = track.rows if most is None else [*best, *(r for r in track.rows if r.reference)]
    style = Style([r.estimator for r in rows], [r.estimator for r in rows if not r.ranked])
    points = [
        Dot(r.estimator, r.score, r.low, r.high, hollow=r.reference, note=_note(r))
        for r in rows
        if math.isfinite(r.score)
    ]
    axis = "Error, as a multiple of the reference figure" if track.relative else "Error [m]"
    known = any(math.isfinite(p.low) for p in points)
    return dots(points, style, label=axis, title=track.title + (", 95 % interval" if known else ""))


def _note(row: TrackRow) -> str:
    words: list[str] = [] if row.ranked else [row.standing]
    words += [f"{row.failed} failed"] if row.failed else []
    return f"({', '.join(words)})" if words else ""
