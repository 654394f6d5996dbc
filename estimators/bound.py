"""The posterior Cramer-Rao bound of a scenario: the best possible accuracy of a real-time estimator, by epoch.

For a state with the transition matrix Phi, the process noise Q, the measurement Jacobian H and the measurement noise R,
with Jacobians at the truth, the information matrix J follows ::

    J+ = (Phi J^-1 Phi' + Q)^-1 + H' R^-1 H

J^-1 is the covariance of a Kalman filter with noise-free inputs. So the filter of the oracle runs over
`simnav.simulation.simulator.ideal`, whose measurements are the truth, and its covariance is the bound.

There are three kinds of bounds, each with its oracle:

- ``clean``: every delivered measurement has its noise without faults (``oracle-clairvoyant``)
- ``flags``: every measurement has its true noise; measurements with a gross error, frozen or missing ones are not used
  (``oracle``)
- ``mix``: it is not known which measurements have a gross error. Each measurement has the Fisher information of the
  density p of its noise, ``J = integral of (p')^2 / p`` (``oracle-mixture``)

Lasting errors (multipath, a bias step, a ramp) are states of the model, so the bound includes their correlation. Each
run has its own trajectory, faults and magnitudes, and so its own covariance of the nine navigation errors. The bound of
a scenario is the mean of these covariances over the runs. (The inverse of the mean information is also a lower bound,
without knowledge of the drawn values. It is never larger, and much smaller if runs differ.) It bounds the mean square
error over runs whose initial errors and biases are drawn from the initial covariance. A single run may be better.

The bound is that of the model (`simnav.estimators.models.truth_linearised`). A disturbance of the IMU, the motion of a
vessel without an IMU and the velocity of the water count as known, and so do the times of outages.

Smoothed output uses later measurements and has a bound of its own (``smoothed``): the covariance of a
Rauch-Tung-Striebel smoother after the same filter (``oracle-rts`` for ``flags``).

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
        Id of the scenario.
    kind : str
        Kind of the bound: ``clean``, ``flags`` or ``mix``.
    runs : int
        Number of simulated runs over which it is the mean.
    time : (T,) array
        Ends of the steps [s].
    covariance : (T, 9, 9) array
        Covariances over `simnav.types.COMPONENTS`; NaN for components that the model does not estimate.
    smoothed : bool
        True: bound of smoothed output; False: of real-time output.
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


#: The adaptation of the estimator of each bound: its knowledge of the noise.
_KNOWLEDGE: dict[str, type[TrueNoise]] = {"clean": NominalNoise, "flags": TrueNoise, "mix": FisherNoise}


def bound_of_run(recording: Recording, kind: Kind = "flags", smoothed: bool = False) -> Array:
    """The bound of one run.

    Parameters
    ----------
    recording : Recording
        A recording of `simnav.simulation.simulator.ideal`.
    kind : str
        Kind of the bound: ``clean``, ``flags`` or ``mix``.
    smoothed : bool
        True: the bound with all measurements of the run, also later ones.

    Returns
    -------
    (T, 9, 9) array
        Covariances; NaN for components that the model does not estimate.

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
        A simulated scenario, not a recorded one.
    seeds : iterable of int
        Seeds of the runs over which it is averaged; a dozen are enough.
    kind : str
        Kind of the bound: ``clean``, ``flags`` or ``mix`` (see the module).
    smoothed : bool
        True: the bound of smoothed output.

    Returns
    -------
    Bound
        The mean over the runs.

    Raises
    ------
    SpecError
        If the scenario is a recorded one, the kind is unknown, or no model fits the instruments.
    ValueError
        If there are no seeds.

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
