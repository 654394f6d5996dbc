"""Thinned errors and tracks of a trial: what plots are made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.recording import Recording
from simnav.scoring.navigation_error import errors, horizontal
from simnav.trial import Trial
from simnav.types import Array

__all__ = ["series"]


def series(trial: Trial, recording: Recording, *, points: int = 500) -> dict[str, Array]:
    """Errors over time and tracks of a trial, thinned to every so many epochs; the last epoch is always in.

    Parameters
    ----------
    trial : Trial
    recording : Recording
        The one that it was run on.
    points : int
        Largest number of epochs k.

    Returns
    -------
    dict of str to array
        All (k,), NaN where unknown, but ``quantiles``:

        - ``time`` [s]
        - ``horizontal``, ``vertical`` (down), ``north``, ``east``: errors [m]
        - ``velocity``: length of the horizontal velocity error [m/s]; ``heading``: error [rad]
        - ``three_sigma``: three times the semi-major axis of the stated horizontal error ellipse [m]
        - ``estimate_north``, ``estimate_east``, ``estimate_down``, ``truth_north``, ``truth_east``, ``truth_down``:
          tracks relative to the true start [m]
        - ``quantiles`` (101,): 0th to 100th percentile of the horizontal error over all epochs [m]
    """
    error = errors(trial, recording)
    n = len(trial)
    keep: NDArray[np.int64] = np.unique(np.linspace(0, max(n - 1, 0), min(points, n)).round().astype(np.int64))
    e = error[keep]
    start = np.where(np.isfinite(recording.initial_truth.position[0]), recording.initial_truth.position[0], 0.0)
    truth = relative_position(recording.data.truth.position[keep], start)
    estimate = relative_position(trial.position[keep], start)
    estimate = np.where(trial.estimated[keep, :3], estimate, np.nan)
    h = horizontal(error)
    h = h[np.isfinite(h)]
    result = {
        "time": trial.time[keep],
        "horizontal": horizontal(e),
        "vertical": e[:, 2],
        "north": e[:, 0],
        "east": e[:, 1],
        "velocity": np.hypot(e[:, 3], e[:, 4]),
        "heading": e[:, 8],
        "three_sigma": _three_sigma(trial, keep),
        "quantiles": np.quantile(h, np.linspace(0.0, 1.0, 101)) if len(h) else np.full(101, np.nan),
    }
    for j, axis in enumerate(("north", "east", "down")):
        result[f"truth_{axis}"] = truth[:, j]
        result[f"estimate_{axis}"] = estimate[:, j]
    return result


def _three_sigma(trial: Trial, keep: NDArray[np.int64]) -> Array:
    """Three times the semi-major axis of the horizontal error ellipse [m]."""
    if trial.covariance is None:
        return np.full(len(keep), np.nan)
    p = trial.covariance[keep]
    mean, half = 0.5 * (p[:, 0, 0] + p[:, 1, 1]), 0.5 * (p[:, 0, 0] - p[:, 1, 1])
    return np.asarray(3.0 * np.sqrt(mean + np.hypot(half, p[:, 0, 1])))
