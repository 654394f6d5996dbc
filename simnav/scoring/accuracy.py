"""Accuracy: root mean square, mean absolute and largest errors, circular error probable, drift.

Radii are empirical quantiles of the horizontal error over the epochs of a run, not multiples of a sigma: CEP50 is its
median, R95 its 95th percentile (the form of requirement in IMO resolutions A.915(22) and A.1046(27), for example 10 m
at 95 % in harbour approaches).

An epoch without a position counts with the last position before it (`simnav.scoring.ScoringInput.held_error`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simnav.geometry.earth import relative_position
from simnav.recording import Recording
from simnav.scoring.registry import ScoringInput, register_score
from simnav.types import Array

__all__ = ["distance_travelled", "rms"]


def rms(x: Array) -> float:
    """Root mean square of the finite values; NaN if there are none.

    Examples
    --------
    >>> rms(np.array([3.0, -3.0, np.nan]))
    3.0
    """
    x = x[np.isfinite(x)]
    return float(np.sqrt(np.mean(x * x))) if len(x) else float("nan")


def _mean_absolute(x: Array) -> float:
    x = x[np.isfinite(x)]
    return float(np.mean(np.abs(x))) if len(x) else float("nan")


def _largest(x: Array) -> float:
    x = x[np.isfinite(x)]
    return float(np.max(np.abs(x))) if len(x) else float("nan")


def _quantile(x: Array, q: float) -> float:
    x = x[np.isfinite(x)]
    return float(np.quantile(x, q)) if len(x) else float("nan")


def distance_travelled(recording: Recording, epochs: int | None = None) -> float:
    """Horizontal length of the true track up to an epoch [m]; gaps in a reference are bridged by straight lines."""
    states = np.concatenate([recording.initial_truth.position, recording.data.truth.position[:epochs]])
    states = states[np.isfinite(states[:, :2]).all(axis=1)]
    states[:, 2] = np.where(np.isfinite(states[:, 2]), states[:, 2], 0.0)
    steps = relative_position(states[1:], states[:-1])
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


# --- horizontal position ------------------------------------------------------------------------------


@register_score("horizontal_rmse", title="Horizontal RMSE", unit="m", better="lower")
def _horizontal_rmse(scored: ScoringInput) -> float:
    return rms(scored.horizontal)


@register_score("horizontal_mae", title="Mean horizontal error", unit="m", better="lower")
def _horizontal_mae(scored: ScoringInput) -> float:
    return _mean_absolute(scored.horizontal)


@register_score("horizontal_max", title="Largest horizontal error", unit="m", better="lower")
def _horizontal_max(scored: ScoringInput) -> float:
    return _largest(scored.horizontal)


@register_score("cep50", title="CEP50: median horizontal error", unit="m", better="lower")
def _cep50(scored: ScoringInput) -> float:
    return _quantile(scored.horizontal, 0.50)


@register_score("r95", title="R95: 95th percentile of the horizontal error", unit="m", better="lower")
def _r95(scored: ScoringInput) -> float:
    return _quantile(scored.horizontal, 0.95)


# --- component by component ---------------------------------------------------------------------------


def _register_component(
    name: str, title: str, unit: str, columns: tuple[int, ...], measure: Callable[[Array], float]
) -> None:
    """Register a score: a measure of one component of the error, or of the length of two components."""

    @register_score(name, title=title, unit=unit, better="lower")
    def component(scored: ScoringInput) -> float:
        error = scored.held_error
        if len(columns) == 2:
            return measure(np.hypot(error[:, columns[0]], error[:, columns[1]]))
        return measure(error[:, columns[0]])


for _axis, _column in (("north", 0), ("east", 1), ("vertical", 2)):
    _name = _axis.capitalize()
    _register_component(f"{_axis}_rmse", f"{_name} RMSE", "m", (_column,), rms)
    _register_component(f"{_axis}_mae", f"{_name} mean absolute error", "m", (_column,), _mean_absolute)
    _register_component(f"{_axis}_max", f"{_name} largest error", "m", (_column,), _largest)
_register_component("velocity_horizontal_rmse", "Horizontal velocity RMSE", "m/s", (3, 4), rms)
_register_component("velocity_horizontal_mae", "Mean horizontal velocity error", "m/s", (3, 4), _mean_absolute)
for _axis, _column in (("north", 3), ("east", 4), ("vertical", 5)):
    _register_component(f"velocity_{_axis}_rmse", f"{_axis.capitalize()} velocity RMSE", "m/s", (_column,), rms)
_register_component("level_rmse", "Level (roll and pitch) RMSE", "rad", (6, 7), rms)
_register_component("tilt_north_rmse", "Tilt about north RMSE", "rad", (6,), rms)
_register_component("tilt_east_rmse", "Tilt about east RMSE", "rad", (7,), rms)
_register_component("heading_rmse", "Heading RMSE", "rad", (8,), rms)
_register_component("heading_mae", "Mean heading error", "rad", (8,), _mean_absolute)


# --- the end of the run, and how much of it has a position --------------------------------------------


@register_score("final_error", title="Horizontal error at the last epoch", unit="m", better="lower")
def _final_error(scored: ScoringInput) -> float:
    return float(scored.horizontal[-1]) if len(scored.horizontal) else float("nan")


@register_score(
    "drift", title="Horizontal error at the last epoch, of the distance travelled", unit="%", better="lower"
)
def _drift(scored: ScoringInput) -> float:
    distance = distance_travelled(scored.recording, len(scored.error))
    return 100.0 * _final_error(scored) / distance if distance > 0.0 else float("nan")


@register_score("availability", title="Share of all epochs with a horizontal position", unit="-", better="higher")
def _availability(scored: ScoringInput) -> float:
    known = np.isfinite(scored.recording.data.truth.position[:, :2]).all(axis=1)
    estimated = np.isfinite(scored.error[:, :2]).all(axis=1)
    return float(estimated.sum() / known.sum()) if known.any() else float("nan")
