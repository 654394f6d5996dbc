"""Who wins against whom: the share of the runs in which a row has a smaller error than another one, a cell each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.ranking.wins import wins

from .charts import Chart, columns
from .heatmap import axes
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import ScenarioRanking, TrackRanking

__all__ = ["win_matrix"]


def win_matrix(track: TrackRanking, scenarios: Sequence[ScenarioRanking]) -> Chart | None:
    """The chart of the ranked rows of a track, the best score first; None with fewer than two rows.

    The page gives each cell its link.

    Parameters
    ----------
    track : TrackRanking
        The ranking of the track.
    scenarios : sequence of ScenarioRanking
        The scenarios of the track.
    """
    ordered = [r.estimator for r in sorted(track.rows, key=lambda r: r.score) if r.ranked and math.isfinite(r.score)]
    if len(ordered) < 2:
        return None
    share = wins(ordered, scenarios)
    cells = [
        (row, other, short(100.0 * share[i, k], 3))
        for i, row in enumerate(ordered)
        for k, other in enumerate(ordered)
        if math.isfinite(share[i, k])
    ]  # fmt: skip
    spec = {
        "height": {"step": 14},
        "data": {"name": "cells"},
        "mark": {"type": "rect", "cursor": "pointer"},
        "encoding": {
            **axes("other", ordered, "row", ordered),
            "color": {
                "field": "share", "type": "quantitative",
                "scale": {
                    "interpolate": "rgb", "domain": [0.0, 50.0, 100.0], "range": ["$second", "$grid", "$strong"],
                },
                "legend": {"title": "Runs won [%]", "values": [0, 25, 50, 75, 100]},
            },
            "href": {"field": "page", "type": "nominal"},
            "tooltip": [
                {"field": "row", "title": "Estimator"},
                {"field": "other", "title": "Against"},
                {"field": "share", "title": "Runs won [%]", "format": ".3~g"},
            ],
        },
    }  # fmt: skip
    caption = (
        "Share of the runs in which the estimator of the line has a smaller error than that of the column. Each "
        "scenario counts the same, and equal errors are half a win. Blue: it wins more often than not. A cell compares "
        "the two. To win more often is not to have the smaller mean error, because a few bad runs can outweigh many "
        "good ones."
    )
    data = {"cells": columns(("row", "other", "share"), cells)}
    return Chart("wins", "Runs won", caption, spec, data, wide=True)
