"""The error of each row beside the plain row's on each scenario of a track, and its map as a figure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.ratio_map import ratio_map

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .rows import TrackRow, TrackTable

__all__ = ["beside_plain", "map_figure"]


def beside_plain(track: TrackTable, rows: Sequence[TrackRow]) -> list[tuple[str, str, float]]:
    """Estimator, versioned id of the scenario, and ratio of the errors; empty without a plain row.

    Parameters
    ----------
    track : TrackTable
        The ranking of the track.
    rows : sequence of TrackRow
        Rows of it, in the order wanted.
    """
    plain = next((r for r in track.rows if r.estimator == track.plain), None)
    if plain is None:
        return []
    return [
        (row.estimator, s, row.ratios[s] / plain.ratios[s])
        for row in rows
        for s in track.scenarios
        if s in row.ratios and plain.ratios.get(s, 0.0) > 0.0 and math.isfinite(row.ratios[s])
    ]


def map_figure(track: TrackTable, most: int | None = None) -> Figure | None:
    """The map of a track's best rows; None where nothing can be compared.

    Parameters
    ----------
    track : TrackTable
        The ranking that is drawn.
    most : int, optional
        Rows that are drawn, the best first.
    """
    rows = [r for r in track.rows if r.ranked][:most]
    cells = beside_plain(track, rows)
    if not cells:
        return None
    shown = {(row, s.rpartition("-v")[0]): ratio for row, s, ratio in cells}
    return ratio_map(shown, f"Error × {track.plain}", f"{track.title}: error beside {track.plain}'s on the same runs")
