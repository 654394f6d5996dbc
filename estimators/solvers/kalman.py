"""The error-state extended Kalman filter with feedback, over any model.

Every measurement is used at its own time of validity: the state is propagated to it, inside the step. The covariance is
updated in Joseph's form (`simnav.estimators.algebra.joseph`).

Measurements that cannot be used are counted, in the diagnostic ``skipped``: values that mean nothing (not finite, not
on Earth), those older than the state, repetitions, and innovations whose covariance is singular.

Source: P. D. Groves 2013, sections 3.2 and 3.4.3.
"""

from __future__ import annotations

from math import hypot

import numpy as np

from simnav.estimator import Estimator
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.base import ErrorModel, Linearised, Observation
from simnav.estimators.solvers.admission import Admission
from simnav.estimators.solvers.iterated import Iteration, absorb_iterated
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements

__all__ = ["KalmanEstimator"]

#: Of `KalmanEstimator`: what is done with a measurement.
_HOOKS = ("_observe", "_linearise", "_correct")


class KalmanEstimator(Estimator):
    """An estimator made of a model and an adaptation; a subclass says which, and registers.

    Parameters
    ----------
    model : ErrorModel
    adaptation : Adaptation, optional
        None: every measurement counts with its nominal noise.
    iteration : Iteration, optional
        None: every measurement is linearised once. Where measurements are iterated, the diagnostic ``iterations`` is
        the most linearisations that one of them took.

    Attributes
    ----------
    covariance : (n, n) array
        Of the model's error.
    """

    def __init__(self, model: ErrorModel, adaptation: Adaptation | None = None, iteration: Iteration | None = None):
        self.model = model
        self.adaptation = adaptation or Adaptation()
        self.iteration = None if iteration is None else iteration.check()

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        self.covariance = self.model.begin(start, instruments)
        self.adaptation.reset(instruments)
        self._names = [name for name, sheet in instruments.items() if self.model.observes(sheet)]
        self._admission = Admission(instruments, self._names)
        self._correction = np.empty(self.model.size)
        self._keys = {name: (f"innovation.{name}", f"nis.{name}") for name in self._names}
        self._blank = dict.fromkeys((label for pair in self._keys.values() for label in pair), np.nan)
        # Where no hook is in the way, the model may do in one go what is else done step by step.
        hooks = {name for name in _HOOKS if getattr(type(self), name) is not getattr(KalmanEstimator, name)}
        self._direct, self._corrects = "_linearise" not in hooks, "_correct" not in hooks
        self._plain = not hooks and type(self.adaptation) is Adaptation

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        model = self.model
        model.load(measurements.imu)
        diagnostics: dict[str, float | Array] = dict(self._blank)
        flagged: list[tuple[str, float]] = []
        for m in self._admission.admit(measurements, model.time):
            self._propagate(min(m.time, measurements.time))
            self._take(m, diagnostics, flagged)
        self._propagate(measurements.time)
        diagnostics["skipped"] = float(self._admission.skipped)
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
        if self._direct:
            return self.model.innovate(m, self.covariance)
        linearised = self._linearise(m)
        return None if linearised is None else linearised.project(self.covariance)

    def _linearise(self, m: Measurement) -> Linearised | None:
        """The measurement at the present estimate; a hook."""
        return self.model.measure(m)

    def _correct(self, dx: Array) -> None:
        """Correct the state, the covariance being updated already; a hook."""
        self.model.correct(dx)

    def _take(self, m: Measurement, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]) -> None:
        """Correct the state by one measurement."""
        iteration = self.iteration
        if iteration is not None and not iteration.applies(self.model, self.covariance):
            iteration = None
        if self._plain and iteration is None:
            used = self.model.assimilate(m, self.covariance, self._correction)
            if used is not None:
                self._note(m, *used, diagnostics)
                return
        observation = self._observe(m)
        if observation is None:
            self._admission.skipped += 1
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
        if iteration is not None:
            chosen_observation = residual, cross, predicted, chosen
            nis, count = absorb_iterated(
                self.model, m, chosen_observation, self.covariance, self._correction, iteration
            )
            diagnostics["iterations"] = max(float(count), float(diagnostics.get("iterations", 0.0)))
        elif self._corrects:
            nis = self.model.absorb((residual, cross, predicted, chosen), self.covariance, self._correction)
        else:
            nis = joseph_update(self.covariance, cross, predicted + chosen, residual, self._correction)
            if nis >= 0.0:
                self._correct(self._correction)
        self._note(m, nis, hypot(*residual.tolist()), diagnostics)

    def _note(self, m: Measurement, nis: float, size: float, diagnostics: dict[str, float | Array]) -> None:
        """Note the innovation of a measurement, or that it was skipped (``nis`` below 0)."""
        if nis < 0.0:
            self._admission.skipped += 1
            return
        innovation, normalised = self._keys[m.instrument]
        diagnostics[innovation], diagnostics[normalised] = size, nis
