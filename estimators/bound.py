"""The posterior Cramer-Rao bound of a scenario: the best possible accuracy of a real-time estimator, by epoch.

For a state that moves with Phi and Q and is measured with H and R, Jacobians at the truth, the information obeys ::

    J+ = (Phi J^-1 Phi' + Q)^-1 + H' R^-1 H

which is what a Kalman filter's covariance does on inputs without noise. So the oracle's own filter runs over
`simnav.simulation.simulator.ideal`, which gives it the truth as measured, and its covariance is read.

Kinds, and the oracle that each belongs to:

- ``clean``: every measurement that is delivered counts with its noise without faults (``oracle-clairvoyant``)
- ``flags``: each counts with the noise that it really had; one that a gross error hit, a frozen or a missing one does
  not count (``oracle``)
- ``mix``: for those who do not know which measurements a gross error hits. Each counts with the Fisher information of
  the density of its noise, ``J = integral of (p')^2 / p`` (``oracle-mixture``)

Errors that last (multipath, a bias step, a ramp) are states of the model, so that their correlation is in the bound.
Each run has a trajectory, faults and magnitudes of its own. The covariance of the nine navigation errors is that of the
run, and the bound of a scenario is its mean over the runs. (The information averaged over runs, then inverted, is a
lower bound, too, for those who do not know what was drawn. It is never above, and far below where runs differ.) It
bounds the mean square error over runs, whose initial errors and biases are drawn from the initial covariance; a single
run may be better.

What it is not: a bound beyond the model (`simnav.estimators.models.about_truth`). A disturbance of the IMU, the motion
of a vessel without an IMU and the velocity of the water count as known. So do the times of outages.

Smoothed output, which has seen what comes after, has a bound of its own (``smoothed``): the covariance that a
Rauch-Tung-Striebel smoother behind the same filter ends with (``oracle-rts`` for ``flags``).

Source: P. Tichavsky, C. H. Muravchik and A. Nehorai, "Posterior Cramer-Rao bounds for discrete-time nonlinear
filtering", IEEE Trans. Signal Processing 46(5), 1998.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from simnav.estimators.adaptations.truth import FisherNoise, NominalNoise, TrueNoise
from simnav.estimators.solvers.oracle import OracleEstimator
from simnav.estimators.solvers.smoother import Smoother
from simnav.recording import Recording
from simnav.scenario import Scenario
from simnav.simulation.simulator import ideal
from simnav.spec import SpecError
from simnav.trial import run_trial
from simnav.types import COMPONENTS, Array

__all__ = ["KINDS", "Bound", "Kind", "bound", "bound_of_run"]

Kind = Literal["clean", "flags", "mix"]
KINDS: tuple[Kind, ...] = ("clean", "flags", "mix")


@dataclass(frozen=True, eq=False)
class Bound:
    """The bound of a scenario.

    Attributes
    ----------
    scenario : str
        Its id.
    kind : str
        Which bound it is.
    runs : int
        Number of simulated runs that it is the mean of.
    time : (T,) array
        Ends of the steps [s].
    covariance : (T, 9, 9) array
        Over `simnav.types.COMPONENTS`; NaN for what the model does not estimate.
    smoothed : bool
        Of smoothed output; False: of output in real time.
    """

    scenario: str
    kind: Kind
    runs: int
    time: Array
    covariance: Array
    smoothed: bool = False

    @property
    def sigma(self) -> Array:
        """(T, 9) array: the bound on the standard deviation of each component [m, m/s, rad]."""
        sigma: Array = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))
        return sigma

    @property
    def horizontal(self) -> Array:
        """(T,) array: the bound on the RMS horizontal position error [m]."""
        distance: Array = np.hypot(self.sigma[:, 0], self.sigma[:, 1])
        return distance

    @property
    def horizontal_rms(self) -> float:
        """The bound on the horizontal RMSE of whole runs [m]."""
        return float(np.sqrt(np.mean(self.horizontal**2)))

    def summary(self) -> dict[str, Any]:
        """A small dict for JSON: the RMS over the run and the last value of each component, SI units."""
        sigma = self.sigma
        known = [bool(k) for k in np.all(np.isfinite(sigma), axis=0)]
        rms = np.sqrt(np.mean(sigma**2, axis=0))
        return {
            "scenario": self.scenario,
            "kind": self.kind,
            "smoothed": self.smoothed,
            "runs": self.runs,
            "duration_s": float(self.time[-1]),
            "horizontal_rms_m": self.horizontal_rms,
            "horizontal_last_m": float(self.horizontal[-1]),
            "rms": {name: float(x) for name, x, k in zip(COMPONENTS, rms, known, strict=True) if k},
            "last": {name: float(x) for name, x, k in zip(COMPONENTS, sigma[-1], known, strict=True) if k},
        }


#: What the estimator of each bound is told of the noise.
_KNOWLEDGE: dict[str, type[TrueNoise]] = {"clean": NominalNoise, "flags": TrueNoise, "mix": FisherNoise}


def bound_of_run(recording: Recording, kind: Kind = "flags", smoothed: bool = False) -> Array:
    """The bound of one run.

    Parameters
    ----------
    recording : Recording
        From `simnav.simulation.simulator.ideal`.
    kind : str
        Which bound is computed.
    smoothed : bool
        What all measurements say, not only those so far.

    Returns
    -------
    (T, 9, 9) array
        Covariances; NaN for what the model does not estimate.

    Raises
    ------
    SpecError
        If no model fits the instruments.
    """
    smoother = Smoother() if smoothed else None
    estimator = OracleEstimator(_KNOWLEDGE[kind](), smoother)
    trial = run_trial(estimator, recording)
    if trial.status != "ok" or trial.covariance is None:
        raise SpecError(f"{recording.scenario}, seed {recording.seed}: there is no bound: {trial.reason}")
    covariance = (trial.covariance if smoother is None else smoother.smoothed_covariance).copy()
    missing = ~np.all(trial.estimated, axis=0)
    covariance[:, missing, :] = covariance[:, :, missing] = np.nan
    return covariance


def bound(scenario: Scenario, seeds: Iterable[int], kind: Kind = "flags", smoothed: bool = False) -> Bound:
    """The posterior Cramer-Rao bound of a scenario, by epoch.

    Parameters
    ----------
    scenario : Scenario
        A simulated one.
    seeds : iterable of int
        Of the runs over which it is averaged; a dozen will do.
    kind : str
        ``clean``, ``flags`` or ``mix``, as the module says.
    smoothed : bool
        True: the bound of smoothed output.

    Returns
    -------
    Bound

    Raises
    ------
    SpecError
        On a recorded scenario, an unknown kind, or instruments that no model fits.
    ValueError
        Without seeds.

    Examples
    --------
    >>> from simnav.scenario import load
    >>> voyage = load("open-sea").model_copy(update={"duration": 20.0})
    >>> bound(voyage, [1]).sigma.shape
    (20, 9)
    """
    if kind not in KINDS:
        raise SpecError(f"there is no bound of kind {kind!r}; there are: {', '.join(KINDS)}")
    if scenario.recorded:
        raise SpecError(f"{scenario.id} is a recorded run; its noise is not known, and so there is no bound")
    total, runs, time = np.zeros(0), 0, np.zeros(0)
    for seed in seeds:
        recording = ideal(scenario, seed)
        covariance = bound_of_run(recording, kind, smoothed)
        total = covariance if runs == 0 else total + covariance
        runs, time = runs + 1, recording.data.truth.time
    if runs == 0:
        raise ValueError("a bound needs at least one seed")
    return Bound(scenario.id, kind, runs, time.copy(), total / runs, smoothed)
