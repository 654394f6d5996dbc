"""All scores of a trial."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable

from simnav.recording import Recording
from simnav.scoring.registry import SCORES, Score, ScoringInput
from simnav.trial import Trial

__all__ = ["ScoreWarning", "score"]


class ScoreWarning(RuntimeWarning):
    """A score that could not be computed, and is NaN."""


def score(trial: Trial, recording: Recording, names: Iterable[str] | None = None) -> dict[str, float]:
    """The scores of a trial.

    Parameters
    ----------
    trial : Trial
        A failed trial is scored over its estimates so far; a ranking must consider its status.
    recording : Recording
        The one that it was run on.
    names : iterable of str, optional
        Keys of `SCORES`; default: all.

    Returns
    -------
    dict of str to float
        By name, in the order of `SCORES` or as asked; NaN where a score does not apply, never infinite.

    Raises
    ------
    ValueError
        If the trial was not run on this recording.
    KeyError
        If there is no score of such a name.

    Warns
    -----
    ScoreWarning
        Of a score that raises or is infinite: it is NaN, and the others stand.
    """
    given = ScoringInput(trial, recording)
    chosen = dict(SCORES) if names is None else {name: SCORES[name] for name in names}
    return {name: _value(one, given) for name, one in chosen.items()}


def _value(one: Score, given: ScoringInput) -> float:
    try:
        value = float(one(given))
        if not math.isinf(value):
            return value
        problem = "it is infinite"
    except Exception as error:
        problem = f"{type(error).__name__}: {error}"
    estimator, scenario = given.trial.estimator, given.recording.scenario
    warnings.warn(f"score {one.name!r} of {estimator} on {scenario} is left out: {problem}", ScoreWarning, stacklevel=3)
    return float("nan")
