"""The Kalman filter of the oracles. It is linearised at the truth, and knows the noise and the faults."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from simnav.estimator import Needs, UnsuitableScenario
from simnav.estimator.needs import AID
from simnav.estimators.adaptations.truth import NominalNoise, TrueNoise, imu_faults
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.fault_states import FaultStateModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_errors import TRIAD
from simnav.estimators.models.true_motion import levelled, true_motion, with_imu
from simnav.estimators.models.truth_linearised import TruthLinearisedModel
from simnav.recording import Recording
from simnav.types import (
    Array,
    Estimate,
    ImuSamples,
    InitialState,
    Instruments,
    Measurements,
    NavigationStates,
    TapStates,
)

from .kalman import KalmanEstimator
from .smoother import Smoother

__all__ = ["OracleEstimator"]

#: All components except roll and pitch, which are known without an IMU.
ESTIMATED = np.array([True, True, True, True, True, True, False, False, True])


class OracleEstimator(KalmanEstimator):
    """The solver of the module: the inertial model about the truth, with the true motion if there is no IMU.

    It knows the labels and the statistics of the faults, not their values (`simnav.estimators.adaptations.truth`).
    Gross errors are rejected, and lasting errors such as multipath are states
    (`simnav.estimators.models.fault_states`). A disturbance of the IMU is subtracted from its samples. The filter is
    linearised about the truth (`simnav.estimators.models.truth_linearised`), and knows the velocity of the water.
    Without an IMU it knows the motion of the vessel (`simnav.estimators.models.true_motion`).

    Parameters
    ----------
    adaptation : TrueNoise
        Knowledge of the noise and the faults.
    smoother : Smoother, optional
        Smooths the trajectory after the last update.
    restore : bool
        True: the errors of the faults are subtracted from each measurement; with the adaptation `NominalNoise`.
    """

    pieces = ("adaptation", "smoother")
    refuses: ClassVar[Mapping[str, str]] = {
        **KalmanEstimator.refuses,
        "model": "it takes the one that suits the instruments, with a state for each fault that lasts",
    }
    reference = True

    @classmethod
    def misfit(cls, keyword: str, made: type) -> str:
        """Why it cannot work with a piece of a class: an adaptation is to know the truth."""
        if keyword == "adaptation" and not issubclass(made, TrueNoise):
            return "an oracle is told the noise, and estimates none; TrueNoise, NominalNoise and MixtureNoise say it"
        return super().misfit(keyword, made)

    def __init__(self, adaptation: TrueNoise, smoother: Smoother | None = None, *, restore: bool = False):
        super().__init__(InertialModel(), adaptation, smoother=smoother)
        if restore and not isinstance(adaptation, NominalNoise):
            raise ValueError(f"{type(adaptation).__name__} does not know what the faults added; NominalNoise does")
        self.truth, self.restore = adaptation, restore
        self._imu_faults: tuple[Array, Array] | None = None
        self._motion: ImuSamples | None = None
        self._recording: Recording | None = None

    @property
    def needs(self) -> Needs:
        """An instrument beside the IMU."""
        return (AID,)

    def observes(self, instruments: Instruments) -> Collection[str] | None:
        """All of them: about the true motion there is a model of each."""
        return instruments.keys()

    def reveal(self, recording: Recording) -> None:
        """Receive the labels, and the true figures if datasheets or the initial covariance are wrong."""
        self.truth.reveal(recording)
        self._imu_faults = imu_faults(recording)
        self._motion = true_motion(recording) if recording.instruments.imu is None else None
        self._recording = recording

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an instrument beside the IMU, and `reveal` before."""
        if self._recording is None:
            raise UnsuitableScenario("the oracle needs the truth: reveal(recording) before reset()")
        if not instruments:
            raise UnsuitableScenario("the oracle needs an instrument beside the IMU; there is none")
        if self._recording.actual_covariance is not None:
            start = replace(start, covariance=self._recording.actual_covariance)
        if self._recording.actual is not None:
            actual = self._recording.actual
            instruments = actual.without(actual.keys() - instruments.keys())
        if self._motion is not None:
            start, instruments = levelled(start, self._recording), with_imu(instruments)
        super().reset(start, instruments)

    def _chosen(self, instruments: Instruments) -> ErrorModel:
        recording = self._recording
        assert recording is not None
        first, then = recording.initial_truth, recording.data.truth
        names = ("time", "position", "velocity", "attitude")
        truth = NavigationStates(*(np.concatenate([getattr(first, n), getattr(then, n)]) for n in names))
        water = None
        if isinstance(then, TapStates):
            water = np.concatenate([then.water_velocity[:1], then.water_velocity])
        inner: ErrorModel = TruthLinearisedModel(truth, water)
        states = self.truth.states()
        return FaultStateModel(inner, states) if states else inner

    def update(self, measurements: Measurements) -> Estimate:
        """Process one step, after the subtraction of IMU faults."""
        imu, aids = measurements.imu, measurements.aids
        if self._motion is not None:
            first, last = np.searchsorted(self._motion.time, (measurements.start + 1e-9, measurements.time + 1e-9))
            imu = self._motion[first:last]
        if self.restore and isinstance(self.truth, NominalNoise):
            aids = [self.truth.restore(m) for m in aids]
        else:
            aids = [self.truth.corrected(m) for m in aids]
        if imu is not None and len(imu) and self._imu_faults is not None:
            times, error = self._imu_faults
            k = int(np.searchsorted(times, imu.time[0] - 1e-9))
            e = error[k : k + len(imu)]
            gyroscopes, accelerometers = e[:, TRIAD.gyroscopes], e[:, TRIAD.accelerometers]
            imu = replace(
                imu, angular_rate=imu.angular_rate - gyroscopes, specific_force=imu.specific_force - accelerometers
            )
        estimate = super().update(Measurements(measurements.start, measurements.time, imu, aids))
        if self._motion is not None:
            estimate.estimated = ESTIMATED
        return estimate
