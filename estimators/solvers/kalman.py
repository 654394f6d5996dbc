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

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np

from simnav.compiled import Kernel, ready
from simnav.estimates import Estimates
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.choice import Choice, choose_noise, no_choice
from simnav.estimators.adaptations.inflation import inflate_moving
from simnav.estimators.adaptations.noise import NoiseAdaptation
from simnav.estimators.adaptations.noise_report import NoiseReport
from simnav.estimators.algebra.joseph import joseph_update, project
from simnav.estimators.composition import Solver
from simnav.estimators.models.base import ErrorModel, Linearised
from simnav.estimators.models.channels import owners, summary
from simnav.estimators.models.coupling import by_source
from simnav.estimators.models.filtering import Dynamics, ModelFunctions, Prediction, Readings, ReadingsOfSteps
from simnav.estimators.models.propagation import NO_SAMPLES, Samples
from simnav.estimators.models.stated_sigmas import with_stated_sigmas
from simnav.estimators.models.suitable import ModelChoice
from simnav.steps import Steps
from simnav.structures import length
from simnav.types import Array, Estimate, InitialState, Instruments, Measurement, Measurements, NavigationStates

from .admission import Admission, Arrivals, together
from .filter_step import Filter, correct, filter_step, use_nominal
from .filter_steps import FLAG, StepStates, filter_steps
from .iterated import Iteration, absorb_iterated
from .smoother import Smoother
from .step_report import begun_report, end_report, labels_of, note_readings
from .step_together import step_together

__all__ = ["FilterFunctions", "KalmanEstimator"]

#: Methods of a step, which compiled steps do not call.
_OF_A_STEP = ("update", "_use", "_note", "_estimate")
#: Methods that a filter of kernels has functions in place of.
_OF_A_READING = ("functions", "predict", "correct", "retract")


class FilterFunctions(NamedTuple):
    """The functions of a filter, see `simnav.estimators.solvers.filter_step.Filter`.

    ``predict_together`` predicts readings of one time of the channels of an instrument, so that they are used by one
    call (`simnav.estimators.solvers.step_together`); None: they are used one by one.
    """

    propagate: Callable[[Dynamics, Samples, float], None]
    predict: Callable[[Dynamics, Readings, int, Prediction], bool]
    choose: Callable[[Choice, Array, Readings, int, Prediction], None]
    inflate: Callable[[Dynamics, Readings, int, Prediction], bool]
    correct: Callable[[Dynamics, Choice, Readings, int, Prediction], float]
    retract: Callable[[Dynamics], None]
    predict_together: Callable[[Sequence[Measurement]], Linearised | None] | None = None

    def replaced(self, **functions: Callable[..., Any]) -> FilterFunctions:
        """Some functions in place of others; readings are then used one by one."""
        return self._replace(**functions, predict_together=None)


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
    model: ErrorModel

    def __init__(
        self,
        model: ModelChoice,
        adaptation: Adaptation | None = None,
        iteration: Iteration | None = None,
        smoother: Smoother | None = None,
    ):
        self._model_choice = model
        if isinstance(model, ErrorModel):
            self.model = model
        self.adaptation = adaptation
        self.iteration = None if iteration is None else iteration.check()
        self.smoother = smoother
        if smoother is not None and smoother.stepwise and iteration is not None:
            raise ValueError(f"{type(smoother).__name__} knows one Jacobian of a measurement; iterated, it has several")

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        instruments = by_source(instruments, self._model_choice, self.label)
        self.model = self._chosen(instruments)
        self.model.reports_all |= self.reports_all
        self.covariance = self.model.begin(start, instruments)
        if self.adaptation is not None:
            self.adaptation.reset(instruments)
        self._names = [name for name, sheet in instruments.items() if self.model.observes(sheet)]
        self._admission = Admission(instruments, self._names)
        self._owners, self._mean_labels = owners(instruments), dict[str, str]()
        self._blank: dict[str, float | Array] = {}
        self._labels = labels_of(self._names)
        self._linearised: Linearised | None = None
        self._measurements: Sequence[Measurement] = ()
        self._arrays = ReadingsOfSteps({name: self.model.components(instruments[name]) for name in self._names})
        self._filter = self._assembled(instruments)
        self._compiled, self._iterated = self._filter.compiled, False
        self._noise_report = self._reported_noise(instruments)
        self._report = begun_report(instruments, self._names, self._admission.record.skipped, self._noise_report)
        self._row = np.empty(len(self._labels) + self._report.chosen.size)
        if self.smoother is not None:
            self.smoother.begin(self.model, [instruments[name] for name in self._names])

    def _chosen(self, instruments: Instruments) -> ErrorModel:
        """The model of a run; subclasses may override it."""
        return with_stated_sigmas(self._model_choice.choose(instruments, self.label), instruments)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        model = self.model
        model.load(measurements.imu)
        diagnostics = dict(self._blank)
        flagged: list[tuple[str, float]] = []
        self._iterations = 0
        self._advance(self._admission.admit(measurements, model.time), measurements.time, flagged)
        end_report.unchecked(self._report, self._row)
        diagnostics.update(zip(self._labels, self._row.tolist()))
        if self._iterations:
            diagnostics["iterations"] = float(self._iterations)
        chosen = self._noise_report if self.adaptation is None else self.adaptation
        if chosen is not None:
            diagnostics.update(chosen.diagnostics())
        if self._owners:
            diagnostics.update(summary(diagnostics, self._owners, self._mean_labels))
        estimate = self._estimate()
        estimate.diagnostics, estimate.flagged = diagnostics, flagged
        if self.smoother is not None:
            self.smoother.end_step(measurements.time)
        return estimate

    def update_all(self, steps: Steps) -> Estimates | None:
        """Take several steps in compiled code, where the whole filter is."""
        if not self._steps_are_compiled:
            return None
        model, n, t = self.model, len(self._labels), len(steps)
        model.load(steps.imu)
        rows = {name: row for row, name in enumerate(self._names)}
        arrivals = Arrivals(
            np.array(steps.ends), np.array(steps.readings), steps.rows_of(rows), ready(steps.time),
            ready(steps.value[:, :3]),
        )  # fmt: skip
        size = model.size
        found = StepStates(
            np.empty((t, len(self.dynamics.numbers))), np.empty((t, size, size)), np.empty((t, len(self._row))),
            np.empty((len(steps.time), length(FLAG))),
        )  # fmt: skip
        readings = self._arrays.room(int(np.diff(steps.readings).max(initial=0)))
        imu = model.samples, np.array(steps.samples)
        known = self._admission.record, self._report
        flags = filter_steps.unchecked(self._filter, *known, arrivals, imu, readings, model.time, found)
        estimates = model.estimates(found.numbers, found.covariances)
        noise = {} if self._noise_report is None else self._noise_report.table(found.reports[:, n:])
        estimates.diagnostics = {**dict(zip(self._labels, found.reports.T)), **noise, **estimates.diagnostics}
        rejected = found.flags.view(FLAG)[:flags, 0].tolist()
        estimates.flagged = [(step, self._names[row], time) for step, row, time in rejected]
        return estimates

    @property
    def _steps_are_compiled(self) -> bool:
        """Whether compiled code does all that `update` does. Means over channels are made in Python."""
        own = self.adaptation
        return (
            self._compiled
            and not self._owners
            and (own is None or type(own).diagnostics is NoiseAdaptation.diagnostics)
            and self._keeps(_OF_A_STEP)
        )

    def _keeps(self, methods: Sequence[str]) -> bool:
        """Whether it overrides none of some methods."""
        return all(getattr(type(self), name) is getattr(KalmanEstimator, name) for name in methods)

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

    def _estimate(self) -> Estimate:
        """The estimate at the end of a step; subclasses may override it."""
        return self.model.estimate(self.covariance)

    def functions(self) -> FilterFunctions:
        """The functions of the filter; a solver of another kind replaces some of them.

        They are kernels where the model has its equations as kernels and nothing has to be known of a measurement in
        Python: a smoother and an iteration have to know.
        """
        own, kernels, model = self.adaptation, self._kernels(), self.model
        inflate: Callable[..., bool] = inflate_moving if own is None else own.inflate
        choose: Callable[..., None] = self.choose
        if own is None:
            choose = use_nominal
        elif isinstance(own, NoiseAdaptation) and own.ruled:
            choose = choose_noise
        if self.smoother is not None or self.iteration is not None:
            return FilterFunctions(self.propagate, self.predict, choose, inflate, self.correct, self.retract)
        if kernels is None:
            together = model.measure_together if model.many and own is None else None
            return FilterFunctions(self.propagate, self.predict, choose, inflate, self.correct, self.retract, together)
        return FilterFunctions(kernels.propagate, kernels.predict, choose, inflate, correct, kernels.retract)

    def _kernels(self) -> ModelFunctions | None:
        """The equations of the model as kernels; subclasses may override it."""
        return self.model.functions()

    def _reported_noise(self, instruments: Instruments) -> NoiseReport | None:
        """Where the noise is reported that `choose_noise` chooses; None if it does not choose."""
        own = self.adaptation
        return own.report if isinstance(own, NoiseAdaptation) and self._filter.choose is choose_noise else None

    def _dynamics(self) -> Dynamics:
        """What the functions of the model work on; subclasses may override it."""
        return self.model.dynamics(self.covariance, self._names)

    def _assembled(self, instruments: Instruments) -> Filter:
        """The filter of a run, with all that its functions work on."""
        self.dynamics = self._dynamics()
        functions = self.functions()._asdict()
        self._predict_together = functions.pop("predict_together")
        self._of_kernels: dict[str, Filter] = {}
        if self._predict_together is not None and self._keeps(_OF_A_READING):
            self._of_kernels = self._filters_of_kernels()
        if functions["choose"] is use_nominal and not all(isinstance(f, Kernel) for f in functions.values()):
            functions["choose"] = self.choose  # a loop in Python copies an array sooner than it calls a kernel
        return Filter(dynamics=self.dynamics, choice=self.noise_choice(instruments), **functions)

    def _filters_of_kernels(self) -> dict[str, Filter]:
        """The one filter that uses single readings, by the name of each instrument that the model has kernels for."""
        kernels = {name: own for name in self._names if (own := self.model.functions_of(name)) is not None}
        if not kernels:
            return {}
        functions = next(iter(kernels.values()))
        single = Filter(
            dynamics=self.dynamics, choice=no_choice(), propagate=functions.propagate, predict=functions.predict,
            choose=use_nominal, inflate=inflate_moving, correct=correct, retract=functions.retract,
        )  # fmt: skip
        return dict.fromkeys(kernels, single)

    def noise_choice(self, instruments: Instruments) -> Choice:
        """How the noise of each reading is chosen in a run."""
        own = self.adaptation
        if isinstance(own, NoiseAdaptation) and own.ruled:
            return own.noise_choice(self._names, self.model.size)
        return no_choice()

    def _advance(self, admitted: Sequence[Measurement], until: float, flagged: list[tuple[str, float]]) -> None:
        """Use the admitted measurements of a step, and propagate to its end."""
        model = self.model
        if self._predict_together is None:
            self._use(admitted, model.samples, until, flagged)
            return
        for group in together(admitted, self._owners):
            end = min(group[0].time, until)
            if len(group) == 1 or not self._use_together(group, end):
                self._use(group, model.samples, end, flagged)
        if model.time < until:
            self._use((), model.samples, until, flagged)

    def _use(
        self,
        measurements: Sequence[Measurement],
        samples: Samples,
        until: float,
        flagged: list[tuple[str, float]],
    ) -> None:
        """Use measurements in order of their times, propagate to a time, and record what became of each."""
        self._measurements, count = measurements, len(measurements)
        readings = self._arrays.fill(measurements)
        of_kernels = self._of_kernels.get(measurements[0].instrument) if count == 1 else None
        if self._compiled:
            filter_step.unchecked(self._filter, readings, samples, count, until)
        elif of_kernels is not None:
            self.propagate(self.dynamics, samples, until)
            filter_step.unchecked(of_kernels, readings, NO_SAMPLES, count, self.model.time)
        else:
            filter_step.function(self._filter.in_python, readings, samples, count, until)
        self._note(readings, count)
        rejected = readings.rejected[:count].tolist()
        if True in rejected:
            flagged += [(m.instrument, m.time) for m, bad in zip(measurements, rejected) if bad]

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the state and its covariance to a time, and record the motion for a smoother."""
        begin = self.model.time
        if until <= begin:
            return
        if self.smoother is not None:
            self.smoother.depart(self.model, self.covariance)
        self.model.propagate(self.covariance, until)
        if self.smoother is not None:
            self.smoother.arrive(self.model, self.covariance, until - begin)

    def predict(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Linearise a measurement at the present state, and project the covariance."""
        linearised = self._linearised = self.model.measure(self._measurements[k])
        if linearised is None:
            return False
        prediction.innovation[:], prediction.nominal[:] = linearised.innovation, linearised.noise
        project.unchecked(self.covariance, ready(linearised.jacobian), prediction.cross, prediction.predicted)
        return True

    def choose(self, choice: Choice, covariance: Array, readings: Readings, k: int, prediction: Prediction) -> None:
        """Ask an adaptation that chooses in Python; without one the noise is that of the datasheet."""
        own, m = self.adaptation, self._measurements[k]
        if own is None:
            prediction.noise[...] = prediction.nominal
            return
        innovation, cross, predicted, nominal, noise = (
            prediction.innovation, prediction.cross, prediction.predicted, prediction.nominal, prediction.noise,
        )  # fmt: skip
        chosen = own.adapt(Innovation(m, innovation, predicted, nominal, covariance, cross))
        if chosen is None:
            readings.rejected[k] = True
        else:
            noise[...] = chosen
            readings.inflation[k] = own.inflation

    def correct(self, dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
        """Correct the covariance, and compute the correction of the state."""
        covariance, correction, iteration = self.covariance, dynamics.correction, self.iteration
        if iteration is not None and iteration.applies(self.model, covariance):
            measurement = self._measurements[k]
            nis, count = absorb_iterated(self.model, measurement, prediction, covariance, correction, iteration)
            self._iterations, self._iterated = max(self._iterations, count), True
        else:
            self._iterated = False
            spread = prediction.predicted + prediction.noise
            nis = joseph_update.unchecked(covariance, prediction.cross, spread, prediction.innovation, correction)
        if nis >= 0.0 and self.smoother is not None:
            self.smoother.use(correction, self._linearised, prediction.noise)
        return nis

    def retract(self, dynamics: Dynamics) -> None:
        """Add the correction to the state; an iterated one is added already."""
        if not self._iterated:
            self.model.correct(dynamics.correction)

    def _use_together(self, measurements: Sequence[Measurement], until: float) -> bool:
        """Use measurements of one time by one call; False if they have to be used one by one."""
        assert self._predict_together is not None
        f, samples = self._filter.in_python, self.model.samples
        readings = step_together(f, self._predict_together, measurements, self._arrays, samples, until)
        if readings is None:
            return False
        self._measurements = measurements
        self._note(readings, len(measurements))
        return True

    def _note(self, readings: Readings, count: int) -> None:
        """Note what became of the measurements; subclasses may override it."""
        note_readings.unchecked(self._report, readings, count)
