"""Accuracy: root mean square, mean absolute and largest errors, circular error probable, drift.

Radii are empirical quantiles of the horizontal error over the epochs of a run, not multiples of a sigma: CEP50 is its
median, R95 its 95th percentile (the form of requirement in IMO resolutions A.915(22) and A.1046(27), for example 10 m
at 95 % in harbour approaches).
"""

from __future__ import annotations

import numpy as np

from simnav.earth import relative_position
from simnav.recording import Recording
from simnav.scoring.navigation_error import horizontal
from simnav.types import Array

__all__ = ["accuracy", "distance_travelled", "rms"]


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


def accuracy(error: Array, recording: Recording) -> dict[str, float]:
    """Accuracy scores of a run.

    Parameters
    ----------
    error : (T, 9) array
        From `simnav.scoring.errors`; T may be less than the recording's epochs.
    recording : Recording

    Returns
    -------
    dict
        Keys and units as in `simnav.scoring.SCORES`; NaN for what was not estimated.
    """
    h = horizontal(error)
    final = float(h[-1]) if len(h) else float("nan")
    distance = distance_travelled(recording, len(error))
    scores = {
        "horizontal_rmse": rms(h),
        "horizontal_mae": _mean_absolute(h),
        "horizontal_max": _largest(h),
        "cep50": _quantile(h, 0.50),
        "r95": _quantile(h, 0.95),
    }
    for name, column in (("north", 0), ("east", 1), ("vertical", 2)):
        scores[f"{name}_rmse"] = rms(error[:, column])
        scores[f"{name}_mae"] = _mean_absolute(error[:, column])
        scores[f"{name}_max"] = _largest(error[:, column])
    speed = np.hypot(error[:, 3], error[:, 4])
    scores["velocity_horizontal_rmse"], scores["velocity_horizontal_mae"] = rms(speed), _mean_absolute(speed)
    for name, column in (("velocity_north", 3), ("velocity_east", 4), ("velocity_vertical", 5)):
        scores[f"{name}_rmse"] = rms(error[:, column])
    scores["level_rmse"] = rms(np.hypot(error[:, 6], error[:, 7]))
    scores["tilt_north_rmse"], scores["tilt_east_rmse"] = rms(error[:, 6]), rms(error[:, 7])
    scores["heading_rmse"], scores["heading_mae"] = rms(error[:, 8]), _mean_absolute(error[:, 8])
    scores["final_error"] = final
    scores["drift"] = 100.0 * final / distance if distance > 0.0 else float("nan")
    known = np.isfinite(recording.data.truth.position[:, :2]).all(axis=1)
    scores["availability"] = float(np.isfinite(h).sum() / known.sum()) if known.any() else float("nan")
    return scores
