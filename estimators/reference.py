"""The fixed reference figure of a scenario: the error of the oracle over many runs, and whether the oracle is right.

The errors of the rows are compared with it, so it must not depend on the few runs of a campaign, and the oracle behind
it must be right: its covariance true (a mean normalised error squared of 1 by degree of freedom), and its error that of
the Cramer-Rao bound of its model.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import sqrt

import numpy as np

from simnav.estimators.adaptations.truth import TrueNoise
from simnav.estimators.bound import bound
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.scenario import Scenario
from simnav.scoring import errors
from simnav.scoring.consistency import nees
from simnav.simulator import simulate
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import Array

__all__ = ["ReferenceFigure", "reference_figure"]

_HORIZONTAL = (0, 1)


@dataclass(frozen=True)
class ReferenceFigure:
    """What the oracle makes of a scenario.

    Attributes
    ----------
    scenario : str
        Its id.
    runs : int
    horizontal_rms : float
        Root of the mean over runs and epochs of the squared horizontal error [m].
    standard_error : float
        Of ``horizontal_rms`` [m].
    bound : float
        Posterior Cramer-Rao bound of the same figure [m] (`simnav.estimators.bound`).
    nees, nees_standard_error : float
        Mean normalised estimation error squared of the horizontal position, by degree of freedom.
    """

    scenario: str
    runs: int
    horizontal_rms: float
    standard_error: float
    bound: float
    nees: float
    nees_standard_error: float

    @property
    def ratio(self) -> float:
        """``horizontal_rms`` over ``bound``."""
        return self.horizontal_rms / self.bound

    @property
    def ratio_standard_error(self) -> float:
        """Standard error of `ratio`; the bound counts as exact."""
        return self.standard_error / self.bound


def reference_figure(scenario: Scenario, seeds: Iterable[int], bound_runs: int = 12) -> ReferenceFigure:
    """The reference figure of a simulated scenario.

    Parameters
    ----------
    scenario : Scenario
    seeds : iterable of int
        Of the runs; 200 give a standard error of one to two per cent.
    bound_runs : int
        Runs, the first ones, over which the bound is averaged. It hardly depends on the run, unless a scenario draws
        its magnitudes by seed: then take all.

    Returns
    -------
    ReferenceFigure

    Raises
    ------
    SpecError
        On a recorded scenario, or where the oracle fails on a run.
    ValueError
        With fewer than two seeds.

    Examples
    --------
    >>> from simnav.scenario import load
    >>> voyage = load("open-sea").model_copy(update={"duration": 20.0})
    >>> found = reference_figure(voyage, range(4))
    >>> found.runs, 0.3 < found.ratio < 3.0
    (4, True)
    """
    seeds = [*seeds]
    if len(seeds) < 2:
        raise ValueError(f"a reference figure needs at least two runs, not {len(seeds)}")
    if scenario.recorded:
        raise SpecError(f"{scenario.id} is a recorded run; its noise is not known, and so it has no reference figure")
    squares, consistency = np.empty(len(seeds)), np.empty(len(seeds))
    for k, seed in enumerate(seeds):
        recording = simulate(scenario, seed)
        trial = run_trial(OracleEstimator(TrueNoise()), recording)
        if trial.status != "ok" or trial.covariance is None:
            raise SpecError(f"{scenario.id}, seed {seed}: the oracle ended with {trial.status}: {trial.reason}")
        error: Array = errors(trial, recording)
        squares[k] = np.mean(np.sum(error[:, _HORIZONTAL] ** 2, axis=1))
        consistency[k] = np.mean(nees(error, trial.covariance, _HORIZONTAL)[0]) / len(_HORIZONTAL)
    rms = sqrt(float(np.mean(squares)))
    return ReferenceFigure(
        scenario.id, len(seeds), rms, _standard_error(squares) / (2.0 * rms),
        bound(scenario, seeds[:bound_runs]).horizontal_rms, float(np.mean(consistency)), _standard_error(consistency),
    )  # fmt: skip


def _standard_error(values: Array) -> float:
    return float(np.std(values, ddof=1)) / sqrt(len(values))
