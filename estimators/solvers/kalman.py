"""The error-state extended Kalman filter with feedback, over any model.

Every measurement is used at its own time of validity: the state is propagated to it, inside the step. The covariance is
updated in Joseph's form, which stays symmetric and positive semi-definite for any gain.

Measurements that cannot be used are counted, in the diagnostic ``skipped``: values that mean nothing (not finite, not
on Earth), those older than the state, repetitions, and innovations whose covariance is singular.

Source: P. D. Groves 2013, sections 3.2 and 3.4.3; G. J. Bierman, *Factorization Methods for Discrete Sequential
Estimation*, 1977, for Joseph's form.
"""

from __future__ import annotations

from itertools import pairwise
from math import hypot, sqrt

import numpy as np

from estimators.adaptations.base import Adaptation, Innovation
from estimators.models.base import ErrorModel, Linearised
from estimators.models.measurements import plausible
from simnav.compiled import kernel
from simnav.estimator import Estimator
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements

__all__ = ["KalmanEstimator", "Observation", "joseph_update"]

#: Of m components and n states: innovation (m,), P H' (n, m), H P H' (m, m) and noise (m, m).
Observation = tuple[Array, Array, Array, Array]
#: A measurement this much older than the state [s] still counts as of its time.
LATE = 1e-4


@kernel("f8(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[::1])")
def joseph_update(covariance, cross, innovation_covariance, residual, correction):  # type: ignore[no-untyped-def]
    """Kalman gain, correction and Joseph-form update of the covariance, in place.

    With S = H P H' + R and K = P H' S^-1, Joseph's (I - K H) P (I - K H)' + K R K' is, multiplied out,
    ``P - K (P H')' - (P H') K' + K S K'``.

    Parameters
    ----------
    covariance : (n, n) array
        P, updated.
    cross : (n, m) array
        P H'.
    innovation_covariance : (m, m) array
        S.
    residual : (m,) array
    correction : (n,) array
        Overwritten with K times the residual.

    Returns
    -------
    float
        Normalised innovation squared; -1 where S is singular, and nothing is changed.
    """
    n, m = cross.shape
    L = np.zeros((m, m))
    for i in range(m):
        for j in range(i + 1):
            x = innovation_covariance[i, j]
            for k in range(j):
                x -= L[i, k] * L[j, k]
            if i == j:
                if not x > 1e-14 * innovation_covariance[i, i]:
                    return -1.0
                L[i, i] = sqrt(x)
            else:
                L[i, j] = x / L[j, j]
    # Whitened: U = P H' L^-T, so that K S K' = U U', K (P H')' = U U'; Joseph's sum needs the gain K = U L^-1.
    gain = np.empty((n, m))
    for r in range(n):
        for i in range(m):
            x = cross[r, i]
            for k in range(i):
                x -= L[i, k] * gain[r, k]
            gain[r, i] = x / L[i, i]
        for i in range(m - 1, -1, -1):
            x = gain[r, i]
            for k in range(i + 1, m):
                x -= L[k, i] * gain[r, k]
            gain[r, i] = x / L[i, i]
    nis = 0.0
    white = np.empty(m)
    for i in range(m):
        x = residual[i]
        for k in range(i):
            x -= L[i, k] * white[k]
        white[i] = x / L[i, i]
        nis += white[i] * white[i]
    for r in range(n):
        x = 0.0
        for i in range(m):
            x += gain[r, i] * residual[i]
        correction[r] = x
    spread = np.empty((n, m))  # K S - P H'
    for r in range(n):
        for i in range(m):
            x = -cross[r, i]
            for k in range(m):
                x += gain[r, k] * innovation_covariance[k, i]
            spread[r, i] = x
    for r in range(n):
        for c in range(r + 1):
            x = covariance[r, c]
            for i in range(m):
                x += spread[r, i] * gain[c, i] - gain[r, i] * cross[c, i]
            covariance[r, c] = x
            covariance[c, r] = x
    return nis


class KalmanEstimator(Estimator):
    """An estimator made of a model and an adaptation; a subclass says which, and registers.

    Parameters
    ----------
    model : ErrorModel
    adaptation : Adaptation, optional
        None: every measurement counts with its nominal noise.

    Attributes
    ----------
    covariance : (n, n) array
        Of the model's error.
    """

    def __init__(self, model: ErrorModel, adaptation: Adaptation | None = None):
        self.model = model
        self.adaptation = adaptation or Adaptation()

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        self.covariance = self.model.begin(start, instruments)
        self.adaptation.reset(instruments)
        self._used = {name: -np.inf for name, sheet in instruments.items() if self.model.observes(sheet)}
        self._kinds = {name: sheet.kind for name, sheet in instruments.items()}
        self._correction = np.empty(self.model.size)
        self._skipped = 0
        self._blank = {f"{quantity}.{name}": np.nan for name in self._used for quantity in ("innovation", "nis")}

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        model = self.model
        model.load(measurements.imu)
        diagnostics: dict[str, float | Array] = dict(self._blank)
        flagged: list[tuple[str, float]] = []
        aids = measurements.aids
        if any(before.time > after.time for before, after in pairwise(aids)):
            aids = sorted(aids, key=_time)
        for m in aids:
            used = self._used.get(m.instrument)
            if used is None:
                continue
            if (
                not model.time - LATE <= m.time <= measurements.time + LATE
                or m.time <= used
                or not plausible(self._kinds[m.instrument], m.value)
            ):
                self._skipped += 1
                continue
            self._propagate(min(m.time, measurements.time))
            self._used[m.instrument] = m.time
            self._take(m, diagnostics, flagged)
        self._propagate(measurements.time)
        diagnostics["skipped"] = float(self._skipped)
        diagnostics.update(self.adaptation.diagnostics())
        estimate = self._estimate()
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        return estimate

    def _propagate(self, until: float) -> None:
        """Advance the state and the covariance; a hook."""
        self.model.propagate(self.covariance, until)

    def _estimate(self) -> Estimate:
        """The estimate at the end of a step; a hook."""
        return self.model.estimate(self.covariance)

    def _observe(self, m: Measurement) -> Observation | None:
        """What a measurement says of the state; None where nothing usable; a hook."""
        linearised = self._linearise(m)
        if linearised is None:
            return None
        residual, jacobian, noise = linearised
        cross = np.dot(self.covariance, jacobian.T)
        return residual, cross, np.dot(jacobian, cross), noise

    def _linearise(self, m: Measurement) -> Linearised | None:
        """The measurement at the present estimate; a hook."""
        return self.model.measure(m)

    def _correct(self, dx: Array) -> None:
        """Correct the state, the covariance being updated already; a hook."""
        self.model.correct(dx)

    def _take(self, m: Measurement, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]) -> None:
        """Correct the state by one measurement."""
        observation = self._observe(m)
        if observation is None:
            self._skipped += 1
            return
        residual, cross, predicted, noise = observation
        chosen = self.adaptation.adapt(Innovation(m, residual, predicted, noise, self.covariance, cross))
        if chosen is None:
            flagged.append((m.instrument, m.time))
            return
        inflation = self.adaptation.inflation
        if inflation != 1.0:
            for matrix in (self.covariance, cross, predicted):
                matrix *= inflation
        nis = joseph_update(self.covariance, cross, predicted + chosen, residual, self._correction)
        if nis < 0.0:
            self._skipped += 1
            return
        self._correct(self._correction)
        diagnostics[f"innovation.{m.instrument}"] = hypot(*residual.tolist())
        diagnostics[f"nis.{m.instrument}"] = nis


def _time(m: Measurement) -> float:
    return m.time
