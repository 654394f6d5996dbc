"""Outages: how far an estimate has drifted when an instrument comes back, and how long it takes to recover."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simnav.recording import Recording
from simnav.scoring.navigation_error import horizontal
from simnav.types import Array

__all__ = ["RECOVERY_THRESHOLD", "Outage", "outage_scores", "outages"]

#: Horizontal error [m] below which an estimate has recovered: the 10 m of IMO A.1046(27).
RECOVERY_THRESHOLD = 10.0


@dataclass(frozen=True)
class Outage:
    """One outage, as one estimator came through it.

    Attributes
    ----------
    instruments : tuple of str
    start, end : float
        [s], cut at the end of the run.
    end_error : float
        Horizontal error at the last epoch of the outage [m].
    threshold : float
        That the horizontal error has to come under [m].
    recovery_time : float
        From the end of the outage to the first epoch under the threshold [s]; 0 where the error never left it. Where
        it does not recover before the next outage of a shared instrument or the end of the run, the time until then.
    recovered : bool
    """

    instruments: tuple[str, ...]
    start: float
    end: float
    end_error: float
    threshold: float
    recovery_time: float
    recovered: bool


def outages(error: Array, recording: Recording, *, threshold: float = RECOVERY_THRESHOLD) -> list[Outage]:
    """How an estimator came through each outage of a run.

    Parameters
    ----------
    error : (T, 9) array
        From `simnav.scoring.errors`.
    recording : Recording
        Its fault labels of kind ``outage`` are the outages; those with the same start and end are one.
    threshold : float
        [m]; an estimator that was worse when the outage began has to come back to what it was then.

    Returns
    -------
    list of Outage
        In order of time; outages that begin after the last epoch of ``error`` are left out.
    """
    time, h = recording.data.truth.time[: len(error)], horizontal(error)
    spans: dict[tuple[float, float], tuple[str, ...]] = {}
    for fault in recording.faults:
        if fault.kind == "outage":
            span = (fault.start, fault.end)
            spans[span] = tuple(dict.fromkeys(spans.get(span, ()) + fault.instruments))
    result = []
    for (start, end), instruments in sorted(spans.items()):
        before = int(np.searchsorted(time, start + 1e-6, side="right")) - 1
        last = int(np.searchsorted(time, end + 1e-6, side="right")) - 1
        if last <= before or len(time) == 0:
            continue
        following = [s for (s, _), names in spans.items() if s > end and set(names) & set(instruments)]
        limit = min([*following, float(time[-1])])
        if before >= 0 and np.isfinite(h[before]):
            level = max(threshold, float(h[before]))
        else:
            level = threshold
        after = np.flatnonzero((np.arange(len(h)) >= last) & (time <= limit + 1e-6) & (h <= level))
        recovered = len(after) > 0
        back = float(time[after[0]]) if recovered else limit
        result.append(
            Outage(
                instruments,
                start,
                min(end, float(time[-1])),
                float(h[last]),
                level,
                max(0.0, back - float(time[last])),
                recovered,
            )
        )
    return result


def outage_scores(error: Array, recording: Recording, *, threshold: float = RECOVERY_THRESHOLD) -> dict[str, float]:
    """Means over the outages of a run; NaN without outages or without a position.

    Returns
    -------
    dict
        ``outage_end_error``, ``outage_end_error_max``, ``recovery_time`` and ``recovered``: keys of
        `simnav.scoring.SCORES`.
    """
    known = [o for o in outages(error, recording, threshold=threshold) if np.isfinite(o.end_error)]
    if not known:
        return dict.fromkeys(("outage_end_error", "outage_end_error_max", "recovery_time", "recovered"), float("nan"))
    return {
        "outage_end_error": float(np.mean([o.end_error for o in known])),
        "outage_end_error_max": max(o.end_error for o in known),
        "recovery_time": float(np.mean([o.recovery_time for o in known])),
        "recovered": float(np.mean([o.recovered for o in known])),
    }
