"""The error-state extended Kalman filter with feedback, over any model.

Every measurement is used at its own time of validity: the state is propagated to it, inside the step. The covariance is
updated in Joseph's form (`simnav.estimators.algebra.joseph`).

The filter tests its innovations. If they stay improbably large, the diagnostic ``inconsistent`` is 1
(`simnav.estimators.solvers.innovation_consistency`).

An instrument with channels is used channel by channel (`simnav.estimators.models.channels`). Its diagnostics are the
means over its channels; each channel has its own, too, as ``nis.INSTRUMENT:CHANNEL``.

The diagnostic ``skipped`` is the number of measurements that could not be used: not finite or implausible, older than
the state, repeated, or with a singular innovation covariance.

Source: P. D. Groves 2013, sections 3.2 and 3.4.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import hypot
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.adaptive_step import step_rule
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.intersection import weaken_position
from simnav.estimators.adaptations.noise import NoiseAdaptation
from simnav.estimators.composition import Solver
from simnav.estimators.models.base import (
    INNOVATION,
    NIS,
    REJECTED,
    SIGMA,
    SIZE,
    ErrorModel,
    Linearised,
    Observation,
    StepRule,
)
from simnav.estimators.models.channels import owners, summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.stated_sigmas import with_stated_sigmas
from simnav.estimators.models.suitable import ModelChoice
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements, NavigationStates

from .admission import Admission, together
from .innovation_consistency import InnovationTest
from .iterated import Iteration, absorb_iterated
from .smoother import Smoother

__all__ = ["KalmanEstimator"]


class KalmanEstimator(Solver):
    """The filter of the module. Solvers that predict or correct in another way are subclasses.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        States, dynamics and measurement equations.
    adaptation : Adaptation, optional
        Chooses the noise of each measurement; None: the nominal noise.
    iteration : Iteration, optional
        Settings of repeated linearisation; None: every measurement is linearised once. With it the diagnostic
        ``iterations`` is the largest number of linearisations of a measurement.
    smoother : Smoother, optional
        Smooths the trajectory after the last update.

    Attributes
    ----------
    model : ErrorModel
        The model of the run, from `reset` on.
    covariance : (n, n) array
        Covariance of the model's error.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model", "adaptation", "iteration", "smoother")
    refuses: ClassVar[Mapping[str, str]] = {
        "weighting": "WeightedKalmanEstimator is the filter that takes one",
        "isolation": "a filter sees one measurement at a time, so that none can agree with another",
    }
    #: True if `ErrorModel.assimilate` may replace `_observe` and `_absorb` when the noise is the nominal one. A solver
    #: with another form of one of these methods sets it to False.
    assimilates: ClassVar[bool] = True
    #: True if `ErrorModel.assimilate_step` may replace `_take` and `_propagate`, too, for all measurements of a step.
    takes_steps: ClassVar[bool] = True

    model: ErrorModel

    def __init__(
        self,
        model: ModelChoice,
        adaptation: Adaptation | None = None,
        iteration: Iteration | None = None,
        smoother: Smoother | None = None,
    ):
        self._choice = model
        if isinstance(model, ErrorModel):
            self.model = model
        self.adaptation = adaptation
        self.iteration = None if iteration is None else iteration.check()
        self.smoother = smoother
        self._stepwise = smoother is not None and smoother.stepwise
        if self._stepwise and iteration is not None:
            raise ValueError(f"{type(smoother).__name__} knows one Jacobian of a measurement; iterated, it has several")

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        instruments = by_source(instruments, self._choice, self.label)
        self.model = self._chosen(instruments)
        self.model.reports_all |= self.reports_all
        self.covariance = self.model.begin(start, instruments)
        self._first_variances = self.covariance.diagonal().copy()
        if self.adaptation is not None:
            self.adaptation.reset(instruments)
        self._names = [name for name, sheet in instruments.items() if self.model.observes(sheet)]
        self._admission = Admission(instruments, self._names)
        self._innovation_test = InnovationTest()
        self._correction = np.empty(self.model.size)
        self._owners, self._mean_labels = owners(instruments), dict[str, str]()
        self._keys = {name: (f"innovation.{name}", f"nis.{name}") for name in self._names}
        self._blank = dict.fromkeys((label for pair in self._keys.values() for label in pair), np.nan)
        self._plain = self.assimilates and self.adaptation is None and not self._stepwise
        self._rule = self._step_rule(instruments)
        known = self.adaptation is None or self._rule is not None
        single = self.iteration is not None or self.smoother is not None
        self._whole = self.assimilates and self.takes_steps and known and not single
        self._linearised: Linearised | None = None
        if self.smoother is not None:
            self.smoother.begin(self.model, [instruments[name] for name in self._names])

    def _chosen(self, instruments: Instruments) -> ErrorModel:
        """The model of a run; subclasses may override it."""
        return with_stated_sigmas(self._choice.choose(instruments, self.label), instruments)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        model = self.model
        model.load(measurements.imu)
        diagnostics: dict[str, float | Array] = dict(self._blank)
        flagged: list[tuple[str, float]] = []
        admitted = self._admission.admit(measurements, model.time)
        if not (self._whole and self._take_step(admitted, measurements.time, diagnostics, flagged)):
            advance = self._propagate if self.smoother is None else self._advance
            for group in self._together(admitted):
                advance(min(group[0].time, measurements.time))
                if len(group) == 1 or not self._take_together(group, diagnostics):
                    for m in group:
                        self._take(m, diagnostics, flagged)
            advance(measurements.time)
        diagnostics["skipped"] = float(self._admission.skipped)
        self._innovation_test.end_epoch()
        diagnostics["variance_factor"] = self._innovation_test.variance_factor
        diagnostics["inconsistent"] = float(self._innovation_test.inconsistent)
        if self.adaptation is not None:
            diagnostics.update(self.adaptation.diagnostics())
        if self._owners:
            diagnostics.update(summary(diagnostics, self._owners, self._mean_labels))
        estimate = self._estimate()
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        if self.smoother is not None:
            self.smoother.end_step(measurements.time)
        return estimate

    def smooth(self) -> NavigationStates | None:
        """The smoother's trajectory at the ends of all steps; None before the first, and without a smoother."""
        return None if self.smoother is None else self.smoother.smooth(self.model, self.covariance)

    def earlier(self, lags: Sequence[float]) -> Array | None:
        """The fixed-lag smoothed states of earlier times; None without a smoother."""
        return None if self.smoother is None else self.smoother.earlier(self.model, lags)

    @property
    def smoothed_covariance(self) -> Array:
        """(T, 9, 9) covariances of the trajectory that `smooth` returned."""
        assert self.smoother is not None, "it has no smoother"
        return self.smoother.smoothed_covariance

    def _propagate(self, until: float) -> None:
        """Propagate the state and the covariance to a time; subclasses may override it."""
        self.model.propagate(self.covariance, until)

    def _advance(self, until: float) -> None:
        """Call `_propagate`, and record the stretch for the smoother."""
        assert self.smoother is not None
        begin = self.model.time
        if until > begin:
            self.smoother.depart(self.model, self.covariance)
            self._propagate(until)
            self.smoother.arrive(self.model, self.covariance, until - begin)

    def _estimate(self) -> Estimate:
        """The estimate at the end of a step; subclasses may override it."""
        return self.model.estimate(self.covariance)

    def _observe(self, m: Measurement) -> Observation | None:
        """The linearised measurement; None if it cannot be used. Subclasses may override it."""
        if not self._stepwise:
            return self.model.innovate(m, self.covariance)
        self._linearised = self.model.measure(m)
        return None if self._linearised is None else self._linearised.project(self.covariance)

    def _absorb(self, observation: Observation) -> float:
        """Correct the state and the covariance with the given noise; subclasses may override it.

        It returns the normalised innovation squared, or -1 if nothing was changed. ``_correction`` is the correction of
        the state.
        """
        if not self._stepwise:
            return self.model.absorb(observation, self.covariance, self._correction)
        return ErrorModel.absorb(self.model, observation, self.covariance, self._correction)

    def _take(self, m: Measurement, diagnostics: dict[str, float | Array], flagged: list[tuple[str, float]]) -> None:
        """Use one measurement: linearise it, choose its noise or reject it, and correct the state."""
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
        if self.adaptation is not None:
            chosen = self.adaptation.adapt(Innovation(m, residual, predicted, noise, self.covariance, cross))
            if chosen is None:
                flagged.append((m.instrument, m.time))
                return
            noise, inflation = chosen, self.adaptation.inflation
            if inflation != 1.0 and not self.adaptation.inflates:
                self.model.loosen(self.covariance, inflation, self._first_variances)
                residual, cross, predicted, _ = self._observe(m) or observation
            elif inflation != 1.0 and self.adaptation.inflates_position:
                weaken_position(self.covariance, inflation)
                residual, cross, predicted, _ = self._observe(m) or observation
            elif inflation != 1.0:
                for matrix in (self.covariance, cross, predicted):
                    matrix *= inflation
        observation = residual, cross, predicted, noise
        if iteration is not None:
            nis, count = absorb_iterated(self.model, m, observation, self.covariance, self._correction, iteration)
            diagnostics["iterations"] = max(float(count), float(diagnostics.get("iterations", 0.0)))
        else:
            nis = self._absorb(observation)
        self._note(m, nis, hypot(*residual.tolist()), diagnostics, noise)

    def _together(self, measurements: Sequence[Measurement]) -> Iterable[Sequence[Measurement]]:
        """The measurements, those of the channels of one instrument at one time in one group if that is quicker."""
        if not (self._plain and self.model.many) or self.iteration is not None or self.smoother is not None:
            return ((m,) for m in measurements)
        return together(measurements, self._owners)

    def _step_rule(self, instruments: Instruments) -> StepRule | None:
        """How the noise of each measurement is chosen in a kernel; None: it is nominal, or chosen in Python."""
        own = self.adaptation
        return step_rule(own, self._names, self._first_variances) if isinstance(own, NoiseAdaptation) else None

    def _take_step(
        self,
        measurements: Sequence[Measurement],
        until: float,
        diagnostics: dict[str, float | Array],
        flagged: list[tuple[str, float]],
    ) -> bool:
        """Use the measurements of a step, and propagate to its end; False if they have to be taken one by one."""
        rule = self._rule
        used = self.model.assimilate_step(measurements, until, self.covariance, self._correction, rule)
        if used is None:
            self._whole = self._whole and rule is None  # otherwise it is so for the run
            return False
        if rule is None:
            for m, row in zip(measurements, used, strict=True):
                self._note(m, row[NIS], row[SIZE], diagnostics)
            return True
        noted = self._reporter()
        for m, row in zip(measurements, used, strict=True):
            if row[NIS] == REJECTED:
                flagged.append((m.instrument, m.time))
                continue
            noted(m.instrument, row)
            size = row[SIZE]
            if size != size:
                size = hypot(*row[INNOVATION:SIGMA])
            self._note(m, row[NIS], size, diagnostics)
        return True

    def _reporter(self) -> Callable[[str, Sequence[float]], None]:
        """What is told by `_take_step` what a kernel chose for an instrument, see `Adaptation.noted`."""
        assert self.adaptation is not None
        return self.adaptation.noted

    def _take_together(self, group: Sequence[Measurement], diagnostics: dict[str, float | Array]) -> bool:
        """Use the measurements of a group; False if they have to be taken one by one."""
        used = self.model.assimilate_together(group, self.covariance, self._correction)
        if used is None:
            return False
        for m, nis, size in zip(group, used[0].tolist(), used[1].tolist(), strict=True):
            self._note(m, nis, size, diagnostics)
        return True

    def _note(
        self, m: Measurement, nis: float, size: float, diagnostics: dict[str, float | Array], noise: Array | None = None
    ) -> None:
        """Record the diagnostics of a measurement, or that it was skipped (``nis`` below 0)."""
        if nis < 0.0:
            self._admission.skipped += 1
            return
        self._innovation_test.add(nis, len(m.value))
        innovation, normalised = self._keys[m.instrument]
        diagnostics[innovation], diagnostics[normalised] = size, nis
        if self.smoother is not None:
            self.smoother.use(self._correction, self._linearised, noise)
