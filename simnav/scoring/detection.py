"""Detection: the measurements that an estimator flagged, against the fault labels of the recording."""

from __future__ import annotations

import numpy as np

from simnav.recording import Recording
from simnav.scoring.registry import ScoringInput, register_score
from simnav.trial import Trial

__all__ = ["DETECTABLE", "detection"]

#: A fault counts as one to be detected where it added more than this many datasheet sigmas to a component.
DETECTABLE = 3.0

_TOLERANCE = 1e-6  # s, between the time of a flag and that of its measurement


def detection(trial: Trial, recording: Recording) -> dict[str, float]:
    """Detection and false-alarm rate of a run.

    Parameters
    ----------
    trial : Trial
        Only measurements up to its last epoch count.
    recording : Recording
        The one that it was run on.

    Returns
    -------
    dict
        ``detection_rate``: of the measurements to which a fault added more than `DETECTABLE` sigmas, the share that was
        flagged. ``false_alarm_rate``: of those that no fault touched, the share that was flagged. Measurements that a
        fault touched less belong to neither. NaN where there are no such measurements, and for an estimator that flags
        nothing at all, since it may not detect faults by design.
    """
    scores = {"detection_rate": float("nan"), "false_alarm_rate": float("nan")}
    if not trial.flagged or not len(trial):
        return scores
    end = float(trial.time[-1]) + _TOLERANCE
    faulty = detected = clean = alarms = 0
    for name, stream in recording.data.aids.items():
        n = int(np.searchsorted(stream.time, end, side="right"))
        time, touched = stream.time[:n], stream.faults[:n] != 0
        flagged = np.zeros(n, dtype=bool)
        for t in (t for instrument, t in trial.flagged if instrument == name):
            i = int(np.searchsorted(time, t - _TOLERANCE))
            if i < n and abs(time[i] - t) <= _TOLERANCE:
                flagged[i] = True
        sigma = recording.instruments[name].sigma
        size = np.abs(stream.fault_error[:n])
        large = touched & (size > DETECTABLE * sigma).any(axis=1)
        faulty += int(large.sum())
        detected += int((large & flagged).sum())
        clean += int((~touched).sum())
        alarms += int((~touched & flagged).sum())
    if faulty:
        scores["detection_rate"] = detected / faulty
    if clean:
        scores["false_alarm_rate"] = alarms / clean
    return scores


def _rates(given: ScoringInput) -> dict[str, float]:
    return detection(given.trial, given.recording)


@register_score("detection_rate", title="Faulty measurements flagged", unit="-", better="higher")
def _detection_rate(given: ScoringInput) -> float:
    return given.shared(_rates)["detection_rate"]


@register_score("false_alarm_rate", title="Sound measurements flagged", unit="-", better="lower")
def _false_alarm_rate(given: ScoringInput) -> float:
    return given.shared(_rates)["false_alarm_rate"]
