"""Robustness profiles on the site: the error beside that of the plain row when a datasheet is wrong.

They are stored (`simnav.leaderboard.ranking.stored_robustness`); without a stored profile of the same version of a row
there is neither the figure on its page nor its cell on the board, and without any there is no column.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from simnav.leaderboard.ranking.stored_robustness import Profile, profiles_of, worst_of

from .charts import Chart, Spec, columns
from .columns import Column
from .rounding import short

if TYPE_CHECKING:
    from simnav.leaderboard.ranking.board import TrackRanking

__all__ = ["COLUMN", "cells", "profile_charts"]

COLUMN = Column(
    "datasheet",
    "Wrong datasheet, worst × plain row",
    "Largest error over that of the plain row when the datasheet of one instrument is a third, three times or ten "
    "times the truth; the plain row is told the same. Geometric mean over the seeds, from simnav robustness.",
    "ratio",
)


def cells(track: TrackRanking) -> dict[str, dict[str, Any]]:
    """The cells of `COLUMN` by label; none where no profile of the same version is stored."""
    found = {}
    for row in track.rows:
        worst = worst_of(row.estimator, row.version, track.plain, track.score)
        if worst is not None:
            found[row.estimator] = {
                "value": short(worst.ratio),
                "help": f"{worst.instrument}, datasheet {worst.factor:.3g} times the truth; {_seeds(worst.runs)} of "
                f"{worst.scenario}, beside {worst.plain}",
            }
    return found


def profile_charts(label: str, version: int | None) -> list[Chart]:
    """The figure of the page of an estimator, one for each plain row that it was compared with."""
    return [_chart(p) for p in profiles_of(label, version) if p.plain != label]


def _seeds(runs: int) -> str:
    return f"{runs} seed{'' if runs == 1 else 's'}"


def _chart(profile: Profile) -> Chart:
    points = [(p.instrument, short(p.factor), short(p.ratio), p.failed) for p in profile.points]
    data = {"points": columns(("instrument", "factor", "ratio", "failed"), points)}
    scale = {"type": "log", "nice": False, "padding": 14}
    x = {"field": "factor", "type": "quantitative", "title": "Datasheet over truth", "scale": scale}
    y = {"field": "ratio", "type": "quantitative", "title": f"Error over that of {profile.plain}", "scale": scale}
    colour = {"field": "instrument", "type": "nominal", "legend": {"title": None, "orient": "top"}}
    tip = [
        {"field": "instrument", "title": "Wrong datasheet"},
        {"field": "factor", "title": "Datasheet over truth"},
        {"field": "ratio", "title": f"Error over that of {profile.plain}", "format": ".3~g"},
        {"field": "failed", "title": "Failed runs"},
    ]
    layers: list[Spec] = [
        {
            "data": {"values": [{"one": 1}]},
            "mark": {"type": "rule", "color": "$grey"},
            "encoding": {"y": {"field": "one", "type": "quantitative"}},
        },
        {
            "data": {"name": "points"},
            "mark": {"type": "line", "point": {"filled": True, "size": 45}, "strokeWidth": 1.7},
            "encoding": {"x": x, "y": y, "color": colour, "tooltip": tip},
        },
    ]
    caption = (
        "The figures of one datasheet after the other are multiplied; the true errors stay the same, and "
        f"{profile.plain} is told the same. Geometric mean over {_seeds(profile.runs)} of {profile.scenario}. "
        f"Below 1 the error is smaller than that of {profile.plain}. Command: simnav robustness {profile.estimator}"
    )
    spec = {"height": 260, "layer": layers}
    return Chart(f"datasheets-{profile.plain}", f"Wrong datasheets, beside {profile.plain}", caption, spec, data)
