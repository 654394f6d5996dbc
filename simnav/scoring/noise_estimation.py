"""Noise estimation: the measurement noise that an estimator assumes, compared with the true noise.

An adaptive estimator reports the sigma that it uses, epoch by epoch, as the diagnostics ``sigma_north.<instrument>``
and ``sigma_east.<instrument>`` [m]. A recording holds the true standard deviation of the white noise of every
measurement (`simnav.recording.AidStream.sigma`). The score is eq. 21 of G. Mao et al., "Robust GNSS/INS Integrated
Navigation Algorithm Based on Adaptive Factor Graph Optimization", 2025, applied to the standard deviation as in its
Table 2.
"""

from __future__ import annotations

import numpy as np

from simnav.recording import AidStream, Recording
from simnav.scoring.registry import ScoringInput, register_score
from simnav.trial import Trial
from simnav.types import KINDS, Array

__all__ = ["noise_estimation", "sigma_errors"]

_AXES = ("north", "east")
_TOLERANCE = 1e-6  # s; the end of a step and the time of a measurement are equal up to rounding


def noise_estimation(trial: Trial, recording: Recording) -> dict[str, float]:
    """Errors of the noise that an estimator assumes for position fixes.

    Parameters
    ----------
    trial : Trial
        The estimates with their diagnostics.
    recording : Recording
        The recording of the trial.

    Returns
    -------
    dict
        ``sigma_north_rmse``, ``sigma_east_rmse`` [m]: root mean square of estimated minus true sigma over all position
        measurements (GNSS, terrain fixes) up to the trial's last epoch. NaN for an estimator that does not report an
        estimate, and where the true sigma is not known.
    """
    scores = {}
    for axis in _AXES:
        parts = [sigma_errors(trial, stream, axis)[1] for stream in recording.data.aids.values()]
        found = np.concatenate([p[np.isfinite(p)] for p in parts]) if parts else np.empty(0)
        scores[f"sigma_{axis}_rmse"] = float(np.sqrt(np.mean(found * found))) if len(found) else float("nan")
    return scores


def sigma_errors(trial: Trial, stream: AidStream, axis: str, later: int = 0) -> tuple[Array, Array]:
    """Estimated minus true sigma of one component of an instrument, measurement by measurement.

    Parameters
    ----------
    trial : Trial
        The estimates with their diagnostics.
    stream : AidStream
        Measurements of the instrument, with their true sigmas.
    axis : str
        Name of the component, as in ``KINDS[kind].errors``.
    later : int
        Number of steps after a measurement at which the estimate of its noise is read.

    Returns
    -------
    time : (k,) array
        Times of the measurements up to the trial's last epoch [s].
    error : (k,) array
        The diagnostic ``sigma_<axis>.<instrument>`` at the end of the step that holds the measurement, minus the true
        sigma; NaN if one of them is not known. Both arrays are empty if the instrument has no such component or the
        estimator has no such diagnostic.
    """
    estimate = trial.diagnostics.get(f"sigma_{axis}.{stream.name}")
    names = KINDS[stream.kind].errors
    if estimate is None or axis not in names or estimate.ndim != 1 or not len(trial):
        return np.empty(0), np.empty(0)
    epoch = np.searchsorted(trial.time, stream.time - _TOLERANCE) + later
    inside = epoch < len(trial)
    true = stream.sigma[inside, names.index(axis)]
    return stream.time[inside], np.asarray(estimate[epoch[inside]] - true)


def _rmse(scored: ScoringInput) -> dict[str, float]:
    return noise_estimation(scored.trial, scored.recording)


@register_score("sigma_north_rmse", title="Estimated sigma north, RMSE", unit="m", better="lower")
def _sigma_north_rmse(scored: ScoringInput) -> float:
    return scored.shared(_rmse)["sigma_north_rmse"]


@register_score("sigma_east_rmse", title="Estimated sigma east, RMSE", unit="m", better="lower")
def _sigma_east_rmse(scored: ScoringInput) -> float:
    return scored.shared(_rmse)["sigma_east_rmse"]
