"""Thinned errors, tracks and diagnostics of a trial, for plots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simnav.geometry.earth import relative_position
from simnav.recording import Recording
from simnav.scoring.integrity import protection_levels
from simnav.scoring.navigation_error import errors, horizontal
from simnav.trial import Trial
from simnav.types import Array

__all__ = ["DIAGNOSTICS", "series"]

#: Diagnostics of single instruments that are kept, as ``NAME.INSTRUMENT``: length of the innovation, normalised
#: innovation squared, length of the residual after the adjustment in sigmas, weight.
DIAGNOSTICS: tuple[str, ...] = ("innovation", "nis", "residual", "weight")


def series(trial: Trial, recording: Recording, *, points: int = 500, bins: int = 100) -> dict[str, Array]:
    """Errors over time, tracks and diagnostics of a trial, thinned. The last epoch is always included.

    Parameters
    ----------
    trial : Trial
        The estimates with their diagnostics.
    recording : Recording
        The recording of the trial.
    points : int
        Largest number of epochs k.
    bins : int
        Largest number b of equal parts of the run. Diagnostics are averaged over each part, because an instrument may
        have measurements at few epochs only.

    Returns
    -------
    dict of str to array
        All (k,), NaN where unknown, unless another shape is given:

        - ``time`` [s]
        - ``horizontal``, ``vertical`` (down), ``north``, ``east``: errors [m]
        - ``velocity``: length of the horizontal velocity error [m/s]; ``heading``: error [rad]
        - ``three_sigma``: three times the semi-major axis of the stated horizontal error ellipse [m]
        - ``estimate_north``, ``estimate_east``, ``estimate_down``, ``truth_north``, ``truth_east``, ``truth_down``:
          tracks relative to the true start [m]
        - ``quantiles`` (101,): 0th to 100th percentile of the horizontal error over all epochs [m]
        - ``protection_level`` [m]: only if the estimator has this diagnostic
        - ``innovation.NAME`` (unit of the instrument), ``nis.NAME``, ``residual.NAME`` (sigma), ``weight.NAME``: all
          (b,), for the instruments for which the estimator has them; ``diagnostics_time`` (b,): middle of the bins [s]
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
    if "protection_level" in trial.diagnostics:
        result["protection_level"] = protection_levels(trial)[keep]
    return result | _diagnostics(trial, bins)


def _diagnostics(trial: Trial, bins: int) -> dict[str, Array]:
    """Means of the diagnostics of single instruments over equal numbers of epochs; NaN without a value."""
    kept = {
        name: np.asarray(values, dtype=np.float64)
        for name, values in trial.diagnostics.items()
        if name.partition(".")[0] in DIAGNOSTICS and "." in name and np.ndim(values) == 1
    }
    if not kept or not len(trial):
        return {}
    edges = np.unique(np.linspace(0, len(trial), min(bins, len(trial)) + 1).round().astype(np.int64))
    starts = edges[:-1]
    found = {"diagnostics_time": 0.5 * (trial.time[starts] + trial.time[edges[1:] - 1])}
    for name, values in kept.items():
        known = np.isfinite(values)
        count = np.add.reduceat(known.astype(np.int64), starts)
        total = np.add.reduceat(np.where(known, values, 0.0), starts)
        found[name] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return found


def _three_sigma(trial: Trial, keep: NDArray[np.int64]) -> Array:
    """Three times the semi-major axis of the horizontal error ellipse [m]."""
    if trial.covariance is None:
        return np.full(len(keep), np.nan)
    p = trial.covariance[keep]
    mean, half = 0.5 * (p[:, 0, 0] + p[:, 1, 1]), 0.5 * (p[:, 0, 0] - p[:, 1, 1])
    return np.asarray(3.0 * np.sqrt(mean + np.hypot(half, p[:, 0, 1])))
