"""Cost: wall time of an update.

The first update is left out if there are others, because it may load compiled code.
"""

from __future__ import annotations

import numpy as np

from simnav.scoring.registry import ScoringInput, register_score
from simnav.types import Array

__all__: list[str] = []


def _seconds(scored: ScoringInput) -> Array:
    seconds = scored.trial.update_seconds
    return seconds[1:] if len(seconds) > 1 else seconds


@register_score("update_median", title="Time per epoch, median", unit="s", better="lower")
def _median(scored: ScoringInput) -> float:
    seconds = _seconds(scored)
    return float(np.median(seconds)) if len(seconds) else float("nan")


@register_score("update_mean", title="Time per epoch, mean", unit="s", better="lower")
def _mean(scored: ScoringInput) -> float:
    seconds = _seconds(scored)
    return float(np.mean(seconds)) if len(seconds) else float("nan")


@register_score("update_p95", title="Time per epoch, 95th percentile", unit="s", better="lower")
def _p95(scored: ScoringInput) -> float:
    seconds = _seconds(scored)
    return float(np.quantile(seconds, 0.95)) if len(seconds) else float("nan")
