"""Rows that are another row in real time, and only smooth beside: they are ranked by what they smooth."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from simnav.estimator import EstimatorError
from simnav.estimator.registry import registered

from .tracks import SMOOTHED

if TYPE_CHECKING:
    from .runs import Runs

__all__ = ["real_time_twin"]


def real_time_twin(label: str, score: str, boards: Collection[Mapping[str, Runs]]) -> str:
    """The row that an estimator is in real time: as it declares, and as the results agree in every run.

    Parameters
    ----------
    label : str
        Of the estimator. Only a registered name declares anything; with other parameters a label is none.
    score : str
        The score that is ranked.
    boards : collection of mapping
        Runs by estimator on each scenario.

    Returns
    -------
    str
        Empty where there is none.
    """
    if score == SMOOTHED or not any(SMOOTHED in r.scores for by in boards if label in by for r in by[label].good):
        return ""
    try:
        twin = registered(label).real_time_as
    except EstimatorError:
        return ""
    shared = 0
    for by in boards:
        if label not in by:
            continue
        if twin not in by:
            return ""
        theirs = {r.seed: r for r in by[twin].tried}
        for r in by[label].tried:
            other = theirs.get(r.seed)
            if other is None:
                return ""
            mine, its = r.scores.get(score, math.nan), other.scores.get(score, math.nan)
            if r.status != other.status or not (mine == its or (math.isnan(mine) and math.isnan(its))):
                return ""
            shared += 1
    return twin if shared else ""
