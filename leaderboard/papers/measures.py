"""The quantities that are compared: named scores in the units of the papers, and computing cost."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from simnav.scoring import SCORES

if TYPE_CHECKING:
    from simnav.leaderboard.results.result import Result

__all__ = ["Measure", "measure", "scores_of", "value_of"]


class Measure(NamedTuple):
    """Title, unit as the papers have it, and the factor from SI to it."""

    title: str
    unit: str
    factor: float


_OWN = {
    "position_rmse": Measure("Position RMSE (3-D)", "m", 1.0),
    "update_mean": Measure("Time per epoch", "ms", 1e3),
    "peak_memory": Measure("Peak memory", "MB", 1e-6),
    "east_over_north": Measure("East RMSE over North RMSE", "", 1.0),
    "down_over_horizontal": Measure("Vertical RMSE over the smaller of North and East RMSE", "", 1.0),
}
_NORTH_EAST = ("north_rmse", "east_rmse")
_SCORES = {
    "position_rmse": ("horizontal_rmse", "vertical_rmse"),
    "peak_memory": (),
    "east_over_north": _NORTH_EAST,
    "down_over_horizontal": (*_NORTH_EAST, "vertical_rmse"),
}


def measure(name: str) -> Measure:
    """The measure of a name.

    Raises
    ------
    KeyError
        If there is no such measure.
    """
    if name in _OWN:
        return _OWN[name]
    info = SCORES[name]
    unit, factor = ("deg", math.degrees(1.0)) if info.unit == "rad" else (info.unit, 1.0)
    return Measure(info.title, unit, factor)


def scores_of(name: str) -> tuple[str, ...]:
    """The scores of a result that a measure is made of (`simnav.scoring.SCORES`).

    >>> scores_of("position_rmse"), scores_of("peak_memory")
    (('horizontal_rmse', 'vertical_rmse'), ())
    """
    return _SCORES.get(name, (name,))


def value_of(result: Result, name: str) -> float:
    """A measure of a result, in its unit; NaN if it does not apply."""
    s = result.scores
    if name == "position_rmse":
        value = math.hypot(s.get("horizontal_rmse", math.nan), s.get("vertical_rmse", math.nan))
    elif name == "peak_memory":
        value = float(result.peak_memory)
    elif name in ("east_over_north", "down_over_horizontal"):
        north, east = (s.get(axis, math.nan) for axis in _NORTH_EAST)
        top, bottom = (
            (east, north) if name == "east_over_north" else (s.get("vertical_rmse", math.nan), min(north, east))
        )
        value = top / bottom if bottom > 0.0 else math.nan
    else:
        value = s.get(name, math.nan)
    return value * measure(name).factor
