"""Scores: numbers that describe the quality of a trial.

- `errors`: estimate minus truth, by component and epoch.
- `score`: the named scores of a run; `SCORES` holds title, unit and direction of each.
- `series`: thinned errors and tracks, for plots.
- `stanford`: errors and protection levels, for Stanford diagrams.
- `register_score`: registers a function as a score, of simnav or of a third party.

Modules: ``registry``; the scores themselves in ``accuracy``, ``outages``, ``consistency``, ``ending``, ``integrity``,
``detection``, ``noise_estimation``, ``smoothed`` and ``cost``, registered by ``standard``; ``verdict`` on a covariance;
``navigation_error``, ``scores``, ``plot_series``; ``trajectory_errors`` as programs for odometry report them.
"""

from __future__ import annotations

from simnav.scoring import standard  # imported first, because it decides the order of the scores
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
