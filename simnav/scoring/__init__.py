"""Scores: what a trial is worth.

- `errors`: estimate minus truth, by component and epoch.
- `score`: the named scores of a run; `SCORES` says what each one is.
- `series`: thinned errors and tracks, for plots.
- `compare`: two estimators on the same seeds.

The rooms: ``navigation_error``, ``accuracy``, ``outages``, ``consistency``, ``detection``, ``noise_estimation``,
``cost``, ``scores``, ``plot_series``, ``comparison``.
"""

from __future__ import annotations

from simnav.scoring.comparison import Comparison, compare, paired_test
from simnav.scoring.consistency import badge, nees, nees_band
from simnav.scoring.navigation_error import errors, smoothed_errors
from simnav.scoring.plot_series import series
from simnav.scoring.scores import SCORES, ScoreInfo, score

__all__ = [
    "SCORES",
    "Comparison",
    "ScoreInfo",
    "badge",
    "compare",
    "errors",
    "nees",
    "nees_band",
    "paired_test",
    "score",
    "series",
    "smoothed_errors",
]
