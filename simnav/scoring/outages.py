"""Outages: the error of an estimate at the end of an outage, and the time until it recovers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.labels import FaultLabel
from simnav.recording import Recording
from simnav.scoring.navigation_error import horizontal
from simnav.scoring.registry import Better, ScoringInput, register_score
from simnav.sensors.faults import effect_of
from simnav.timing import TIME_TOLERANCE
from simnav.types import Array

__all__ = ["RECOVERY_THRESHOLD", "Outage", "outage_scores", "outages"]

#: Horizontal error [m] below which an estimate has recovered: the 10 m of IMO A.1046(27).
RECOVERY_THRESHOLD = 10.0


@dataclass(frozen=True)
class Outage:
    """One outage of a run, with the errors of one estimator.

    Attributes
    ----------
    instruments : tuple of str
        Names of the instruments without measurements.
    start, end : float
        Times of the first missing measurement, and of the first measurement after the outage [s]; ``end`` is infinite
        if there is none.
    end_error : float
        Horizontal error at the last epoch before ``end`` [m].
    threshold : float
        Horizontal error below which the estimate has recovered [m].
    recovery_time : float
        Time from ``end`` to the first epoch below the threshold [s]; 0 if the error never exceeded it. If the estimate
        does not recover before the next outage of these instruments or the end of the run, the time until then. NaN if
        there is no measurement after the outage.
    recovered : bool
        Whether the horizontal error fell below the threshold.
    """

    instruments: tuple[str, ...]
    start: float
    end: float
    end_error: float
    threshold: float
    recovery_time: float
    recovered: bool


def outages(error: Array, recording: Recording, *, threshold: float = RECOVERY_THRESHOLD) -> list[Outage]:
    """The outages of a run with the errors of an estimator.

    Parameters
    ----------
    error : (T, 9) array
        Errors from `simnav.scoring.errors`.
    recording : Recording
        The recording of the trial. An outage is an interval in which a fault of kind ``outage`` removed all
        measurements of an instrument. Overlapping intervals of several instruments of one fault are one outage.
    threshold : float
        Horizontal error below which an estimate has recovered [m]. If the error at the beginning of the outage was
        larger, that error is the threshold.

    Returns
    -------
    list of Outage
        In order of time, up to the last epoch of ``error``.
    """
    time, h = recording.data.truth.time[: len(error)], horizontal(error)
    spans = sorted((start, end, f.instruments) for f in recording.faults for start, end in _gaps(f, recording))
    result = []
    for start, end, instruments in spans:
        first, stop = (int(i) for i in np.searchsorted(time, [start - TIME_TOLERANCE, end - TIME_TOLERANCE]))
        if first >= stop:  # after the last epoch, or between two
            continue
        level = max(threshold, float(h[first - 1])) if first > 0 and np.isfinite(h[first - 1]) else threshold
        nexts = [s for s, _, names in spans if s > start and set(names) & set(instruments)]
        limit = min([*nexts, float(time[-1])])
        under = np.flatnonzero(h[stop - 1 :] <= level)
        back = float(time[stop - 1 + under[0]]) if len(under) else np.inf
        wait = max(0.0, min(back, limit) - end) if stop < len(time) else float("nan")
        result.append(Outage(instruments, start, end, float(h[stop - 1]), level, wait, back <= limit + TIME_TOLERANCE))
    return result


def _gaps(fault: FaultLabel, recording: Recording) -> list[tuple[float, float]]:
    """The intervals of an outage: from the first missing measurement to the first measurement after it."""
    if effect_of(fault.kind) != "missing":
        return []
    found: list[tuple[float, float]] = []
    for name in fault.instruments:
        stream = recording.data.aids.get(name)
        if stream is None:
            continue
        # A channel alone is no outage while others are there.
        dropped = np.setdiff1d(stream.dropped, stream.time) if stream.channels else stream.dropped
        lost = dropped[(dropped >= fault.start - TIME_TOLERANCE) & (dropped < fault.end)]
        following, index = np.unique(np.searchsorted(stream.time, lost), return_index=True)
        found += [
            (float(lost[i]), float(stream.time[j]) if j < len(stream) else np.inf)
            for i, j in zip(index, following, strict=True)
        ]
    merged: list[tuple[float, float]] = []
    for start, end in sorted(found):
        if merged and start < merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


def outage_scores(error: Array, recording: Recording, *, threshold: float = RECOVERY_THRESHOLD) -> dict[str, float]:
    """Means over the outages of a run. Recovery is averaged over the outages that ended.

    Returns
    -------
    dict
        ``outage_end_error``, ``outage_end_error_max``, ``recovery_time`` and ``recovered``: keys of
        `simnav.scoring.SCORES`. The values are NaN without outages or without a position.
    """
    scores = dict.fromkeys(("outage_end_error", "outage_end_error_max", "recovery_time", "recovered"), float("nan"))
    known = [o for o in outages(error, recording, threshold=threshold) if np.isfinite(o.end_error)]
    if known:
        scores["outage_end_error"] = float(np.mean([o.end_error for o in known]))
        scores["outage_end_error_max"] = max(o.end_error for o in known)
    ended = [o for o in known if np.isfinite(o.recovery_time)]
    if ended:
        scores["recovery_time"] = float(np.mean([o.recovery_time for o in ended]))
        scores["recovered"] = float(np.mean([o.recovered for o in ended]))
    return scores


def _of_run(scored: ScoringInput) -> dict[str, float]:
    return outage_scores(scored.held_error, scored.recording)


def _register(name: str, title: str, unit: str, better: Better) -> None:
    @register_score(name, title=title, unit=unit, better=better)
    def mean(scored: ScoringInput) -> float:
        return scored.shared(_of_run)[name]


_register("outage_end_error", "Horizontal error at the end of an outage, mean", "m", "lower")
_register("outage_end_error_max", "Horizontal error at the end of an outage, largest", "m", "lower")
_register("recovery_time", "Time from the end of an outage to less than 10 m, mean", "s", "lower")
_register("recovered", "Share of outages recovered from", "-", "higher")
