"""The reference row ``oracle``: the EKF that is told the true noise and the faults."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from simnav.estimator import UnsuitableScenario, register
from simnav.estimators.adaptations.truth import TrueNoise, imu_faults
from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.fault_states import FaultStateModel
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.recording import Recording
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

__all__ = ["Oracle"]


@register("oracle")
class Oracle(KalmanEstimator):
    """EKF that knows each measurement's true noise and faults; what any real-time estimator is measured against.

    The inertial model where there is an IMU, the ship model where there is none. Of the faults it knows the flags and
    the statistics, not what they added (`simnav.estimators.adaptations.truth`): gross errors are left out, errors that
    last, like multipath, are states (`simnav.estimators.models.fault_states`); but a disturbance of the IMU is taken
    off its samples. On a run without faults it is ``ekf`` or ``ship-ekf``. It is not ranked. (Oracle O1.)
    """

    reference = True
    #: What it is told of the noise.
    knowledge: ClassVar[type[TrueNoise]] = TrueNoise

    def __init__(self) -> None:
        self.truth = self.knowledge()
        self._imu_faults: tuple[Array, Array] | None = None
        self._revealed = False
        super().__init__(InertialModel(), self.truth)

    def reveal(self, recording: Recording) -> None:
        """Take the labels."""
        self.truth.reveal(recording)
        self._imu_faults = imu_faults(recording)
        self._revealed = True

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs an IMU or what the ship model needs, and `reveal` before."""
        if not self._revealed:
            raise UnsuitableScenario("the oracle needs the truth: reveal(recording) before reset()")
        if not instruments:
            raise UnsuitableScenario("the oracle needs an instrument beside the IMU; there is none")
        inner: ErrorModel = InertialModel() if instruments.imu is not None else ShipModel()
        states = self.truth.states()
        self.model = FaultStateModel(inner, states) if states else inner
        super().reset(start, instruments)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step, without what a fault did to the IMU."""
        imu = measurements.imu
        if imu is not None and len(imu) and self._imu_faults is not None:
            times, error = self._imu_faults
            k = int(np.searchsorted(times, imu.time[0] - 1e-9))
            e = error[k : k + len(imu)]
            imu = replace(imu, angular_rate=imu.angular_rate - e[:, :3], specific_force=imu.specific_force - e[:, 3:])
            measurements = Measurements(measurements.start, measurements.time, imu, measurements.aids)
        return super().update(measurements)
