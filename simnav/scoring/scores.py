"""All scores of a trial."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from simnav.recording import Recording
from simnav.scoring.registry import SCORES, Score, ScoringInput, names_of_families
from simnav.trial import Trial
from simnav.types import Array

__all__ = ["ScoreWarning", "score"]


class ScoreWarning(RuntimeWarning):
    """A score could not be computed and is NaN."""


def score(trial: Trial, recording: Recording, names: Iterable[str] | None = None) -> dict[str, float]:
    """The scores of a trial.

    Parameters
    ----------
    trial : Trial
        The estimates. A failed trial is scored over its estimates before the failure; a ranking must consider its
        status.
    recording : Recording
        The recording of the trial.
    names : iterable of str, optional
        Names of scores, keys of `SCORES`; by default all, and those of the trial's lags (`simnav.scoring.lagged`).

    Returns
    -------
    dict of str to float
        Values by name, in the order of `SCORES` or of ``names``; NaN if a score does not apply, never infinite.

    Raises
    ------
    ValueError
        If the trial was not run on this recording.
    KeyError
        If there is no score of such a name.

    Warns
    -----
    ScoreWarning
        If the function of a score raises or returns an infinite value. The score is then NaN; others are not affected.
    """
    scored = _SharedInput(trial, recording)
    chosen = dict(SCORES) if names is None else {name: SCORES[name] for name in names}
    if names is None:
        chosen |= {name: SCORES[name] for name in names_of_families(trial)}
    return {name: _value(one, scored) for name, one in chosen.items()}


class _SharedInput(ScoringInput):
    """The input that all scores of a trial share: none of them can write into its arrays, or into the trial's."""

    def __init__(self, trial: Trial, recording: Recording):
        arrays: dict[str, Any] = {n: _read_only(v) for n, v in vars(trial).items() if isinstance(v, np.ndarray)}
        super().__init__(replace(trial, **arrays), recording)
        self.error = _read_only(self.error)

    @cached_property
    def held_error(self) -> Array:
        return _read_only(super().held_error)

    @cached_property
    def horizontal(self) -> Array:
        return _read_only(super().horizontal)

    @cached_property
    def smoothed_error(self) -> Array | None:
        found = super().smoothed_error
        return None if found is None else _read_only(found)


def _read_only(array: Array) -> Array:
    """A view that nobody can write into."""
    view = array.view()
    view.flags.writeable = False
    return view


def _value(one: Score, scored: ScoringInput) -> float:
    try:
        value = float(one(scored))
        if not math.isinf(value):
            return value
        problem = "it is infinite"
    except (Exception, SystemExit) as error:
        problem = f"{type(error).__name__}: {error}"
    estimator, scenario = scored.trial.estimator, scored.recording.scenario
    warnings.warn(f"score {one.name!r} of {estimator} on {scenario} is left out: {problem}", ScoreWarning, stacklevel=3)
    return float("nan")
