"""The filter of one hypothesis: it can be copied from another one, and says how probable the measurements were to it.

It is the filter of `simnav.estimators.solvers.imm`: the noise of each instrument switches between levels, so that gross
errors and a larger noise need no hypothesis of their own. The density of an innovation over all levels is the evidence
of the hypothesis. The errors of an instrument are alike from one reading to the next, but for its white noise, so a
thousand readings say less than their number. An instrument of more than `FULL` readings per second counts as one of
that rate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.adaptations.prediction import PredictionTest
from simnav.estimators.models.doubted_instruments import DoubtingModel
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.roles import fixes_and_logs
from simnav.kernel_types import Vector
from simnav.types import Estimate, ImuSamples, InitialState, Instruments, Measurement

from .imm import ImmEstimator, mix
from .kalman import FilterFunctions
from .step_report import StepReport, note_readings

__all__ = ["FULL", "RARE", "HypothesisFilter", "Step", "lone_fix"]

#: Readings of an instrument per second that count fully as evidence.
FULL = 1.0
#: A fix of a lower rate is rare [Hz]. Chosen on voyages of its own, see docs/explanation/hypotheses.md.
RARE = 0.5


def lone_fix(instruments: Instruments) -> str:
    """Name of a rare fix that has neither another fix nor a log beside it, but an IMU; empty if there is none.

    From one such fix to the next the error of the IMU grows as far as that of a wrong fix, so nothing tells them apart.
    """
    group = fixes_and_logs(instruments)
    if instruments.imu is None or len(group) != 1:
        return ""
    ((name, is_fix),) = group.items()
    return name if is_fix and instruments[name].rate < RARE else ""


class Step(NamedTuple):
    """What a filter uses in one step.

    Attributes
    ----------
    imu : ImuSamples or None
        The samples of the IMU.
    readings : sequence of Measurement
        The admitted measurements, in order of their times.
    until : float
        End of the step [s].
    """

    imu: ImuSamples | None
    readings: Sequence[Measurement]
    until: float


class Evidence(NamedTuple):
    """What measurements say of a hypothesis: log density, sum of the NIS, and its degrees of freedom."""

    density: float
    nis: float
    freedom: float


@kernel
def evidence_of(readings: Readings, count: int, shares: Vector) -> Evidence:
    """Sum over the first readings, each by the share of its instrument; one that was not used has a negative NIS."""
    density = nis = freedom = 0.0
    for k in range(count):
        if readings.nis[k] >= 0.0:
            share = shares[readings.instrument[k]]
            density += share * readings.reported[k]
            nis += share * readings.nis[k]
            freedom += share * readings.components[k]
    return Evidence(density, nis, freedom)


@kernel(passed=True)
def correct_with_evidence(
    dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Correct the covariance by a mixture of levels, and report the logarithm of the density of the innovation."""
    nis, _, readings.reported[k] = mix(dynamics, choice, readings, k, prediction)
    return nis


class HypothesisFilter(ImmEstimator):
    """The filter of the module.

    Attributes
    ----------
    evidence : float
        Logarithm of the density of the measurements of the last step.
    nis, freedom : float
        Sum of the normalised innovations squared of the last step, and of their degrees of freedom, by the noise of the
        datasheets. An instrument of a high rate counts as for the evidence.
    notes : list of (Measurement, float)
        The measurements of the last step, with the normalised innovation squared; below 0 where one was not used.
    """

    model: DoubtingModel

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(start, instruments)
        sheets = self.model.instruments
        self._shares = np.array([min(1.0, FULL / sheets[name].rate) for name in self._names])
        self._clear()

    def _clear(self) -> None:
        self.evidence = self.nis = self.freedom = 0.0
        self.notes: list[tuple[Measurement, float]] = []

    def functions(self) -> FilterFunctions:
        """The correction is a mixture that reports its evidence."""
        return super().functions().replaced(correct=correct_with_evidence)

    def noise_choice(self, instruments: Instruments) -> Choice:
        """As of `ImmEstimator`, but without tests of the prediction: that the IMU is wrong is another hypothesis.

        The noise of a lone fix (`lone_fix`) has one level.
        """
        choice = replace(super().noise_choice(instruments), test=PredictionTest(instruments, together=0).record(0))
        if name := lone_fix(instruments):
            choice.settings[list(instruments).index(name), : len(self._variances)] = 1.0
        return choice

    def advance(self, step: Step) -> None:
        """Take one step's measurements."""
        self.model.load(step.imu)
        self._clear()
        self._advance(step.readings, step.until, [])

    def note_last(self, report: StepReport) -> None:
        """Note the measurements of the last step in a report."""
        note_readings.unchecked(report, self._arrays.room(0), len(self.notes))

    def estimate(self) -> Estimate:
        """The estimate at the end of the step."""
        return self._estimate()

    @property
    def names(self) -> Sequence[str]:
        """The instruments that it observes."""
        return self._names

    def take_over(self, other: HypothesisFilter) -> None:
        """Copy the state of another filter of the same run, with all that it keeps."""
        self.model.take_over(other.model)
        self.model.take_over_doubts(other.model)
        self.covariance[...] = other.covariance
        mine, theirs = self._filter.choice, other._filter.choice
        mine.memories[...], mine.last[...] = theirs.memories, theirs.last

    def _note(self, readings: Readings, count: int) -> None:
        """Add the evidence of the measurements, and keep what became of each."""
        if not count:
            return
        said: Evidence = evidence_of.unchecked(readings, count, self._shares)
        self.evidence += said.density
        self.nis += said.nis
        self.freedom += said.freedom
        self.notes += zip(self._measurements, readings.nis[:count].tolist(), strict=True)
