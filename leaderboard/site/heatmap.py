"""The map of a track: the error of each row beside the plain row's on each scenario, a cell each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from simnav.leaderboard.figures.ratio_map import ENDS
from simnav.leaderboard.ranking.beside_plain import beside_plain

from .charts import Chart, Spec, columns
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import TrackRanking, TrackRow

    from .content import ScenarioEntry

__all__ = ["axes", "heatmap"]


def axes(x: str, order: Sequence[str], y: str, lines: Sequence[str]) -> Spec:
    """The encoding of the places of cells: names above the columns and before the lines, in the given order."""
    above = {"orient": "top", "labelAngle": -45, "labelLimit": 150, "labelOverlap": False}
    return {
        "x": {"field": x, "type": "nominal", "title": None, "sort": list(order), "axis": above},
        "y": {"field": y, "type": "nominal", "title": None, "sort": list(lines), "axis": {"labelOverlap": False}},
    }


def heatmap(track: TrackRanking, rows: Sequence[TrackRow], scenarios: Mapping[str, ScenarioEntry]) -> Chart | None:
    """The map of the ranked rows of a track, the best score on top; None without a plain row or a second scenario.

    Parameters
    ----------
    track : TrackRanking
        The ranking of the track.
    rows : sequence of TrackRow
        The rows that are shown.
    scenarios : mapping
        Scenarios by versioned id.
    """
    ordered = sorted(rows, key=lambda r: r.score)
    found = beside_plain(track, ordered)
    if not found or len(track.scenarios) < 2 or len(rows) < 2:
        return None
    cells = [(row, scenarios[s].name, short(ratio)) for row, s, ratio in found]
    names = [scenarios[s].name for s in track.scenarios]
    data = {
        "cells": columns(("row", "scenario", "ratio"), cells),
        "scenarios": columns(
            ("name", "title", "page"), ((e.name, e.title, e.page) for e in map(scenarios.__getitem__, track.scenarios))
        ),
    }
    ratio = f"× {track.plain}"
    spec = {
        "height": {"step": 14},
        "data": {"name": "cells"},
        "transform": [
            {
                "lookup": "scenario",
                "from": {"data": {"name": "scenarios"}, "key": "name", "fields": ["title", "page"]},
            },
            {"calculate": f"clamp(datum.ratio, {1.0 / ENDS}, {ENDS})", "as": "shown"},
        ],
        "mark": {"type": "rect", "cursor": "pointer"},
        "encoding": {
            **axes("scenario", names, "row", [r.estimator for r in ordered]),
            "color": {
                "field": "shown",
                "type": "quantitative",
                "scale": {
                    "type": "log",
                    "interpolate": "rgb",
                    "domain": [1.0 / ENDS, 1.0, ENDS],
                    "range": ["$strong", "$grid", "$second"],
                },
                "legend": {"title": f"Error {ratio}", "values": [1.0 / ENDS, 0.5, 1.0, 2.0, ENDS], "format": "~g"},
            },
            "href": {"field": "page", "type": "nominal"},
            "tooltip": [
                {"field": "row", "title": "Estimator"},
                {"field": "title", "title": "Scenario"},
                {"field": "ratio", "title": f"Error {ratio}", "format": ".3~g"},
            ],
        },
    }
    caption = (
        f"Geometric mean over the seeds of the error over that of {track.plain} on the same run. Blue: smaller errors; "
        "orange: larger ones. A cell leads to the page of its scenario."
    )
    return Chart(f"{track.track}-map", "Who is better where", caption, spec, data, wide=True)
