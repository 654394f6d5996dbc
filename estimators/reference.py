"""The error of the oracle on a scenario over many runs, and tests of the oracle.

The errors of the rows are divided by the error of the oracle. So this figure must not depend on the few runs of a
campaign, and the oracle must be correct: its covariance must agree with its errors (a mean normalised estimation error
squared of 1 per degree of freedom), and its error with the Cramer-Rao bound of its model.

The covariance of an oracle is the bound of its run: both are linearised about the truth, and do not depend on the
errors (`simnav.estimators.bound`; a test compares the two). So one pass over a run gives error, bound and consistency,
and, with a smoother after the oracle, those of smoothed output, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from simnav.estimator import make
from simnav.estimators.rows.oracles import OracleRts
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.scenario import Scenario
from simnav.scoring import errors
from simnav.scoring.consistency import nees
from simnav.scoring.navigation_error import smoothed_errors
from simnav.simulation.simulator import simulate
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import Array

__all__ = ["OracleRun", "ReferenceFigure", "oracle_run"]

_HORIZONTAL = (0, 1)


@dataclass(frozen=True)
class OracleRun:
    """Error, bound and consistency of the oracle on one run.

    Attributes
    ----------
    seed : int
        Seed of the run.
    rms, smoothed_rms : float
        Root of the mean over the epochs of the squared horizontal error, in real time and smoothed [m].
    bound, smoothed_bound : float
        Cramer-Rao bound of the same figures [m].
    nees, smoothed_nees : float
        Mean normalised estimation error squared of the horizontal position, divided by the degrees of freedom.
    """

    seed: int
    rms: float
    bound: float
    nees: float
    smoothed_rms: float
    smoothed_bound: float
    smoothed_nees: float


def oracle_run(scenario: Scenario, seed: int) -> OracleRun:
    """Run the oracle and its smoother once.

    Parameters
    ----------
    scenario : Scenario
        A simulated scenario, not a recorded one.
    seed : int
        Seed of the run.

    Raises
    ------
    SpecError
        If the scenario is a recorded one, or the oracle fails.
    """
    if scenario.recorded:
        raise SpecError(f"{scenario.id} is a recorded run; its noise is not known, and so it has no reference figure")
    recording = simulate(scenario, seed)
    row = make("oracle-rts")  # the row of the board, which uses late readings at their time of validity
    trial = run_trial(row, recording)
    if trial.status != "ok" or trial.covariance is None:
        raise SpecError(f"{scenario.id}, seed {seed}: the oracle ended with {trial.status}: {trial.reason}")
    real_time = _summary(errors(trial, recording), trial.covariance)
    after = smoothed_errors(trial, recording)
    assert after is not None, "it has a smoother"
    assert isinstance(row, OracleRts)
    assert isinstance(row.solver, OracleEstimator)
    assert row.solver.smoother is not None
    smoothed = _summary(after, row.solver.smoother.smoothed_covariance)
    return OracleRun(seed, *real_time, *smoothed)


def _summary(error: Array, covariance: Array) -> tuple[float, float, float]:
    """RMS, bound and NEES of a run."""
    square = np.sum(error[:, _HORIZONTAL] ** 2, axis=1)
    variance = covariance[:, 0, 0] + covariance[:, 1, 1]
    consistency = nees(error, covariance, _HORIZONTAL)[0] / len(_HORIZONTAL)
    return sqrt(float(np.mean(square))), sqrt(float(np.mean(variance))), float(np.mean(consistency))


@dataclass(frozen=True)
class ReferenceFigure:
    """Error, bound and consistency of the oracle on a scenario, in real time or smoothed.

    Attributes
    ----------
    scenario : str
        Id of the scenario.
    runs : int
        Number of runs of the figure.
    horizontal_rms : float
        Root of the mean over runs and epochs of the squared horizontal error [m].
    bound : float
        Cramer-Rao bound of the same figure on the same runs [m].
    ratio, ratio_standard_error : float
        Root of the mean over runs of (error / bound) squared, with the bound of each run, and its standard error. So
        runs with large errors do not dominate.
    nees, nees_standard_error : float
        Mean normalised estimation error squared of the horizontal position, divided by the degrees of freedom, and its
        standard error.
    """

    scenario: str
    runs: int
    horizontal_rms: float
    bound: float
    ratio: float
    ratio_standard_error: float
    nees: float
    nees_standard_error: float

    @classmethod
    def of(cls, scenario: str, runs: Sequence[OracleRun], smoothed: bool = False) -> ReferenceFigure:
        """The figure of at least two runs; ValueError with fewer."""
        if len(runs) < 2:
            raise ValueError(f"a reference figure needs at least two runs, not {len(runs)}")
        prefix = "smoothed_" if smoothed else ""
        rms, bound, consistency = (
            np.array([getattr(r, prefix + name) for r in runs]) for name in ("rms", "bound", "nees")
        )
        square = (rms / bound) ** 2
        ratio = sqrt(float(np.mean(square)))
        return cls(
            scenario, len(runs), sqrt(float(np.mean(rms**2))), sqrt(float(np.mean(bound**2))),
            ratio, _standard_error(square) / (2.0 * ratio), float(np.mean(consistency)), _standard_error(consistency),
        )  # fmt: skip


def _standard_error(values: Array) -> float:
    return float(np.std(values, ddof=1)) / sqrt(len(values))
