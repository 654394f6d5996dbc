"""The named scores of a run: one table says what they are, one function computes them all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np

from simnav.recording import Recording
from simnav.scoring.accuracy import accuracy, rms
from simnav.scoring.consistency import consistency
from simnav.scoring.cost import cost
from simnav.scoring.detection import detection
from simnav.scoring.navigation_error import errors, horizontal, smoothed_errors
from simnav.scoring.noise_estimation import noise_estimation
from simnav.scoring.outages import outage_scores
from simnav.trial import Trial

__all__ = ["SCORES", "ScoreInfo", "score"]


class ScoreInfo(NamedTuple):
    """What a score is.

    Attributes
    ----------
    title : str
    unit : str
        SI, ``%`` or ``-``.
    better : str
        ``lower``, ``higher``, or ``one`` and ``nominal`` where a value is best (1; 50 % or 95 %).
    """

    title: str
    unit: str
    better: Literal["lower", "higher", "one", "nominal"]


#: Every score, in the order in which tables show them.
SCORES: Mapping[str, ScoreInfo] = {
    "horizontal_rmse": ScoreInfo("Horizontal RMSE", "m", "lower"),
    "horizontal_mae": ScoreInfo("Mean horizontal error", "m", "lower"),
    "horizontal_max": ScoreInfo("Largest horizontal error", "m", "lower"),
    "cep50": ScoreInfo("CEP50: median horizontal error", "m", "lower"),
    "r95": ScoreInfo("R95: 95th percentile of the horizontal error", "m", "lower"),
    "north_rmse": ScoreInfo("North RMSE", "m", "lower"),
    "north_mae": ScoreInfo("North mean absolute error", "m", "lower"),
    "north_max": ScoreInfo("North largest error", "m", "lower"),
    "east_rmse": ScoreInfo("East RMSE", "m", "lower"),
    "east_mae": ScoreInfo("East mean absolute error", "m", "lower"),
    "east_max": ScoreInfo("East largest error", "m", "lower"),
    "vertical_rmse": ScoreInfo("Vertical RMSE", "m", "lower"),
    "vertical_mae": ScoreInfo("Vertical mean absolute error", "m", "lower"),
    "vertical_max": ScoreInfo("Vertical largest error", "m", "lower"),
    "velocity_horizontal_rmse": ScoreInfo("Horizontal velocity RMSE", "m/s", "lower"),
    "velocity_horizontal_mae": ScoreInfo("Mean horizontal velocity error", "m/s", "lower"),
    "velocity_north_rmse": ScoreInfo("North velocity RMSE", "m/s", "lower"),
    "velocity_east_rmse": ScoreInfo("East velocity RMSE", "m/s", "lower"),
    "velocity_vertical_rmse": ScoreInfo("Vertical velocity RMSE", "m/s", "lower"),
    "level_rmse": ScoreInfo("Level (roll and pitch) RMSE", "rad", "lower"),
    "tilt_north_rmse": ScoreInfo("Tilt about north RMSE", "rad", "lower"),
    "tilt_east_rmse": ScoreInfo("Tilt about east RMSE", "rad", "lower"),
    "heading_rmse": ScoreInfo("Heading RMSE", "rad", "lower"),
    "heading_mae": ScoreInfo("Mean heading error", "rad", "lower"),
    "final_error": ScoreInfo("Horizontal error at the last epoch", "m", "lower"),
    "drift": ScoreInfo("Horizontal error at the last epoch, of the distance travelled", "%", "lower"),
    "availability": ScoreInfo("Share of all epochs with a horizontal position", "-", "higher"),
    "outage_end_error": ScoreInfo("Horizontal error at the end of an outage, mean", "m", "lower"),
    "outage_end_error_max": ScoreInfo("Horizontal error at the end of an outage, largest", "m", "lower"),
    "recovery_time": ScoreInfo("Time from the end of an outage to less than 10 m, mean", "s", "lower"),
    "recovered": ScoreInfo("Share of outages recovered from", "-", "higher"),
    "nees_horizontal": ScoreInfo("Mean NEES by degree of freedom, horizontal position", "-", "one"),
    "nees_position": ScoreInfo("Mean NEES by degree of freedom, position", "-", "one"),
    "nees_velocity": ScoreInfo("Mean NEES by degree of freedom, velocity", "-", "one"),
    "nees_attitude": ScoreInfo("Mean NEES by degree of freedom, attitude", "-", "one"),
    "coverage_50": ScoreInfo("Coverage of the 50 % horizontal ellipse", "-", "nominal"),
    "coverage_95": ScoreInfo("Coverage of the 95 % horizontal ellipse", "-", "nominal"),
    "detection_rate": ScoreInfo("Faulty measurements flagged", "-", "higher"),
    "false_alarm_rate": ScoreInfo("Sound measurements flagged", "-", "lower"),
    "sigma_north_rmse": ScoreInfo("Estimated sigma north, RMSE", "m", "lower"),
    "sigma_east_rmse": ScoreInfo("Estimated sigma east, RMSE", "m", "lower"),
    "smoothed_horizontal_rmse": ScoreInfo("Horizontal RMSE, smoothed", "m", "lower"),
    "smoothed_north_rmse": ScoreInfo("North RMSE, smoothed", "m", "lower"),
    "smoothed_east_rmse": ScoreInfo("East RMSE, smoothed", "m", "lower"),
    "smoothed_horizontal_max": ScoreInfo("Largest horizontal error, smoothed", "m", "lower"),
    "smoothed_vertical_rmse": ScoreInfo("Vertical RMSE, smoothed", "m", "lower"),
    "smoothed_heading_rmse": ScoreInfo("Heading RMSE, smoothed", "rad", "lower"),
    "update_median": ScoreInfo("Time per epoch, median", "s", "lower"),
    "update_mean": ScoreInfo("Time per epoch, mean", "s", "lower"),
    "update_p95": ScoreInfo("Time per epoch, 95th percentile", "s", "lower"),
}


def score(trial: Trial, recording: Recording) -> dict[str, float]:
    """All scores of a trial.

    Parameters
    ----------
    trial : Trial
        One that failed is scored over what it produced; whoever ranks must look at its status.
    recording : Recording
        The one that it was run on.

    Returns
    -------
    dict of str to float
        Every key of `SCORES`, in its order; NaN where a score does not apply, never infinite.

    Raises
    ------
    ValueError
        If the trial was not run on this recording.
    """
    error = errors(trial, recording)
    found = accuracy(error, recording)
    found |= outage_scores(error, recording)
    found |= consistency(trial, error)
    found |= detection(trial, recording)
    found |= noise_estimation(trial, recording)
    found |= cost(trial)
    smoothed = smoothed_errors(trial, recording)
    if smoothed is not None:
        h = horizontal(smoothed)
        found["smoothed_horizontal_rmse"] = rms(h)
        found["smoothed_north_rmse"], found["smoothed_east_rmse"] = rms(smoothed[:, 0]), rms(smoothed[:, 1])
        found["smoothed_horizontal_max"] = float(np.nanmax(h)) if np.isfinite(h).any() else np.nan
        found["smoothed_vertical_rmse"] = rms(smoothed[:, 2])
        found["smoothed_heading_rmse"] = rms(smoothed[:, 8])
    return {name: float(found.get(name, np.nan)) for name in SCORES}
