"""Accuracy against honesty: the error of each row beside how often its 95 % region holds the truth under faults."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from .charts import Chart, Spec, columns, front_colour, front_names
from .labels import shifts
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import TrackRanking

__all__ = ["HONEST", "honesty"]

#: Coverage that an honest covariance has [%].
HONEST = 95.0
_HEIGHT = 320.0  # [pixels]


def honesty(
    track: TrackRanking,
    title: str,
    most: float,
    front: Callable[[Sequence[tuple[float, float]]], list[bool]],
) -> Chart | None:
    """The chart of a track; None where fewer than two rows have a coverage under faults.

    References are drawn, too, as open points: an oracle shows what a filter could reach that knew of the faults.

    Parameters
    ----------
    track : TrackRanking
        The ranking of the track.
    title : str
        Title of the score.
    most : float
        Largest score that is drawn; others are left out.
    front : callable
        Marks the points of a Pareto front, of pairs that are to be small.
    """
    found = [
        r for r in track.rows
        if (r.ranked or r.reference) and 0.0 < r.score <= most and math.isfinite(r.faulty.coverage)
    ]  # fmt: skip
    ranked = [r for r in found if r.ranked]
    if len(ranked) < 2:
        return None
    best = dict(zip(
        (r.estimator for r in ranked),
        front([(r.score, abs(HONEST - 100.0 * r.faulty.coverage)) for r in ranked]),
        strict=True,
    ))  # fmt: skip
    named = [best.get(r.estimator, r.reference) for r in found]
    rows = [
        (r.estimator, short(r.score), short(100.0 * r.faulty.coverage), r.reference, shown)
        for r, shown in zip(found, named, strict=True)
    ]
    places = shifts(
        [r.estimator for r in found], [r.score for r in found], [r.faulty.coverage for r in found], named, _HEIGHT,
        log=(True, False),
    )  # fmt: skip
    data = {"rows": {**columns(("row", "error", "covered", "reference", "front"), rows), **places}}
    error = f"Score ({title})"
    covered = "Epochs under faults inside the 95 % region [%]"
    x: Spec = {
        "field": "error", "type": "quantitative", "title": error,
        "scale": {"type": "log", "nice": False, "padding": 14},
    }  # fmt: skip
    y: Spec = {
        "field": "covered", "type": "quantitative", "title": covered,
        "scale": {"zero": False, "nice": False, "padding": 26},
    }  # fmt: skip
    tip = [
        {"field": "row", "title": "Estimator"},
        {"field": "error", "title": error, "format": ".3~g"},
        {"field": "covered", "title": covered, "format": ".3~g"},
    ]
    points = {"encoding": {"x": x, "y": y, "color": front_colour(), "tooltip": tip}}
    layers: list[Spec] = [
        {
            "data": {"values": [{"honest": HONEST}]},
            "mark": {"type": "rule", "color": "$grey", "strokeDash": [4, 3]},
            "encoding": {"y": {"field": "honest", "type": "quantitative"}},
        },
        {
            **points,
            "transform": [{"filter": "!datum.reference"}],
            "mark": {"type": "point", "filled": True, "size": 60, "clip": True},
        },
        {
            **points,
            "transform": [{"filter": "datum.reference"}],
            "mark": {"type": "point", "filled": False, "size": 60, "clip": True},
        },
        front_names({"x": x, "y": y}),
    ]
    caption = (
        "From the first fault of a run on. An estimator at the left is accurate, and one on the dashed line has a "
        "covariance that agrees with its errors. Points in the other colour: no other estimator is both more accurate "
        "and nearer to the line. Open points are told of the faults and are not ranked."
    )
    spec = {"height": _HEIGHT, "data": {"name": "rows"}, "layer": layers}
    return Chart(f"{track.track}-honesty", "Accuracy against honesty", caption, spec, data)
