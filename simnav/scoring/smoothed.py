"""Accuracy of the smoothed trajectory, for estimators that give one."""

from __future__ import annotations

import numpy as np

from simnav.scoring.accuracy import rms
from simnav.scoring.navigation_error import horizontal
from simnav.scoring.registry import ScoringInput, register_score

__all__: list[str] = []

_NAN = float("nan")


@register_score("smoothed_horizontal_rmse", title="Horizontal RMSE, smoothed", unit="m", better="lower")
def _horizontal_rmse(scored: ScoringInput) -> float:
    error = scored.smoothed_error
    return _NAN if error is None else rms(horizontal(error))


def _register_component(name: str, title: str, unit: str, column: int) -> None:
    @register_score(name, title=title, unit=unit, better="lower")
    def rmse(scored: ScoringInput) -> float:
        error = scored.smoothed_error
        return _NAN if error is None else rms(error[:, column])


_register_component("smoothed_north_rmse", "North RMSE, smoothed", "m", 0)
_register_component("smoothed_east_rmse", "East RMSE, smoothed", "m", 1)


@register_score("smoothed_horizontal_max", title="Largest horizontal error, smoothed", unit="m", better="lower")
def _horizontal_max(scored: ScoringInput) -> float:
    if scored.smoothed_error is None:
        return _NAN
    h = horizontal(scored.smoothed_error)
    return float(np.nanmax(h)) if np.isfinite(h).any() else _NAN


_register_component("smoothed_vertical_rmse", "Vertical RMSE, smoothed", "m", 2)
_register_component("smoothed_heading_rmse", "Heading RMSE, smoothed", "rad", 8)
