"""Detection: the measurements that an estimator flagged, against the fault labels of the recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simnav.recording import Recording
from simnav.scoring.registry import ScoringInput, register_score
from simnav.trial import Trial

__all__ = ["DETECTABLE", "detection"]

#: An estimator should detect a fault if it added more than this many datasheet sigmas to a component.
DETECTABLE = 3.0

_TOLERANCE = 1e-6  # s, between the time of a flag and that of its measurement


def detection(trial: Trial, recording: Recording) -> dict[str, float]:
    """Detection and false-alarm rate of a run.

    Parameters
    ----------
    trial : Trial
        The estimates and flags. Only measurements up to its last epoch count.
    recording : Recording
        The recording of the trial.

    Returns
    -------
    dict
        ``detection_rate``: the flagged share of the measurements to which a fault added more than `DETECTABLE` sigmas.
        ``false_alarm_rate``: the flagged share of the measurements without a fault. Measurements with a smaller fault
        count in neither. Each reading of a channel counts by itself. A rate is NaN if there are no such measurements,
        and for an estimator that flags nothing at all, because it may not detect faults by design.
    """
    scores = {"detection_rate": float("nan"), "false_alarm_rate": float("nan")}
    if not trial.flagged or not len(trial):
        return scores
    end = float(trial.time[-1]) + _TOLERANCE
    faulty = detected = clean = alarms = 0
    for name, stream in recording.data.aids.items():
        if stream.has_clock:  # what is flagged is named by its stamp
            stream = stream.rows(stream.arrivals <= end)
            stream = stream.rows(np.argsort(stream.stamps, kind="stable"))
            stream = replace(stream, time=stream.stamps)
        n = int(np.searchsorted(stream.time, end, side="right"))
        time, touched = stream.time[:n], stream.faults[:n] != 0
        flagged = np.zeros(n, dtype=bool)
        for source, t in trial.flagged:
            instrument, _, channel = source.partition(":")
            if instrument != name:
                continue
            i = int(np.searchsorted(time, t - _TOLERANCE))
            j = int(np.searchsorted(time, t + _TOLERANCE, side="right"))
            if channel in stream.channels:
                flagged[i:j] |= stream.channel[i:j] == stream.channels.index(channel)
            elif not channel:  # with channels, all that the instrument said at that time
                flagged[i : j if stream.channels else min(i + 1, j)] = True
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


def _rates(scored: ScoringInput) -> dict[str, float]:
    return detection(scored.trial, scored.recording)


@register_score("detection_rate", title="Faulty measurements flagged", unit="-", better="higher")
def _detection_rate(scored: ScoringInput) -> float:
    return scored.shared(_rates)["detection_rate"]


@register_score("false_alarm_rate", title="Sound measurements flagged", unit="-", better="lower")
def _false_alarm_rate(scored: ScoringInput) -> float:
    return scored.shared(_rates)["false_alarm_rate"]
