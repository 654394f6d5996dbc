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
    return {"position_rmse": ("horizontal_rmse", "vertical_rmse"), "peak_memory": ()}.get(name, (name,))


def value_of(result: Result, name: str) -> float:
    """A measure of a result, in its unit; NaN if it does not apply."""
    s = result.scores
    if name == "position_rmse":
        value = math.hypot(s.get("horizontal_rmse", math.nan), s.get("vertical_rmse", math.nan))
    elif name == "peak_memory":
        value = float(result.peak_memory)
    else:
        value = s.get(name, math.nan)
    return value * measure(name).factor
