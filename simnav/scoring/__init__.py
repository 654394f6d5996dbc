"""Scores: what a trial is worth.

- `errors`: estimate minus truth, by component and epoch.
- `score`: the named scores of a run; `SCORES` says what each one is.
- `series`: thinned errors and tracks, for plots.
- `stanford`: errors beside protection levels.

- `register_score`: makes a function a score; ours and those of others.

The rooms: ``registry``; the scores themselves in ``accuracy``, ``outages``, ``consistency``, ``integrity``,
``detection``, ``noise_estimation``, ``smoothed`` and ``cost``, registered by ``standard``; ``navigation_error``,
``scores``, ``plot_series``.
"""

from __future__ import annotations

from simnav.scoring import standard  # first: it decides the order of the scores
from simnav.scoring.consistency import badge, nees, nees_band
from simnav.scoring.integrity import Stanford, protection_levels, stanford
from simnav.scoring.navigation_error import errors, smoothed_errors
from simnav.scoring.plot_series import series
from simnav.scoring.registry import SCORES, Score, ScoringInput, register_score
from simnav.scoring.scores import ScoreWarning, score

__all__ = [
    "SCORES",
    "Score",
    "ScoreWarning",
    "ScoringInput",
    "Stanford",
    "badge",
    "errors",
    "nees",
    "nees_band",
    "protection_levels",
    "register_score",
    "score",
    "series",
    "smoothed_errors",
    "standard",
    "stanford",
]
