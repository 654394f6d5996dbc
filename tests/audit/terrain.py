"""Terrain-referenced navigation: the error of `terrain-pmf` beside the bound, and its consistency.

The voyages are those of `tests.cases.over_terrain`. The position is unknown to 50 m at the start; runs count from the
time on at which the soundings fit one place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.estimators.bound import bound_of_run
from simnav.scoring.navigation_error import errors
from simnav.simulation.simulator import ideal
from simnav.source import record
from simnav.trial import run_trial
from tests.cases.over_terrain import over_terrain

#: Runs in each part, parts, length of a run, and from when on it counts [s].
RUNS, PARTS, DURATION, SETTLED = 15, 4, 120.0, 60
#: A run whose mean error is so many times the bound has found another place.
_LOST = 10.0


def _part(first: int) -> list[list[float]]:
    """Of each run: mean square error, mean square of the bound, and NEES of the horizontal position over 2."""
    scenario, found = over_terrain(DURATION), []
    for seed in range(first, first + RUNS):
        recording = record(scenario, seed)
        trial = run_trial(make("terrain-pmf"), recording)
        assert trial.covariance is not None, trial.reason
        error, spread = errors(trial, recording)[SETTLED:, :2], trial.covariance[SETTLED:, :2, :2]
        bound = bound_of_run(ideal(scenario, seed), "clean")[SETTLED:, :2, :2]
        nees = 0.5 * np.einsum("ni,nij,nj->n", error, np.linalg.inv(spread), error)
        squares = np.mean(np.sum(error**2, axis=1)), np.mean(np.trace(bound, axis1=1, axis2=2)), np.mean(nees)
        found.append([float(x) for x in squares])
    return found


def parts() -> Mapping[str, Callable[[], Any]]:
    """What is measured."""
    return {str(k): partial(_part, 7000 + RUNS * k) for k in range(PARTS)}


def rows(found: Mapping[str, Any]) -> Iterator[tuple[str, str, str, bool]]:
    """What was measured, and what is promised."""
    error, bound, nees = np.array([run for part in found.values() for run in part]).T
    lost = error > _LOST**2 * bound
    ratio = float(np.sqrt(error[~lost].mean() / bound[~lost].mean()))
    yield f"`terrain-pmf`: lost runs of {len(error)}", str(int(lost.sum())), "at most 2 %", bool(lost.mean() <= 0.02)
    yield "`terrain-pmf`: error over the bound, the others", f"{ratio:.2f}", "at most 1.3", ratio <= 1.3
    mean = float(nees[~lost].mean())
    yield "`terrain-pmf`: NEES, the others", f"{mean:.2f}", "0.8 to 1.2", 0.8 <= mean <= 1.2
