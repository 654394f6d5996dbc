"""Fault of the IMU: a vibration, as of an engine, and the mean error that it leaves (rectification)."""

from __future__ import annotations

from math import pi, sqrt
from typing import Literal

import numpy as np

from simnav.sensors.faults.fault import register_fault
from simnav.sensors.faults.imu_faults import AddedErrors, ImuFaultSpec
from simnav.sensors.faults.layer import FaultLayer
from simnav.sensors.instrument import ZERO, Triple
from simnav.spec import Positive, quantity
from simnav.types import Array

__all__ = ["ImuVibration"]


@register_fault
class ImuVibration(ImuFaultSpec):
    """The accelerometers sense a vibration, and the biases change by ``K v^2``; one number sets all three axes.

    Of a vibration of the root mean square v a sample shows the mean over its interval. The quadratic errors of an
    instrument leave a mean error, the vibration rectification (IEEE Std 1293-2018: ``K v^2`` along each axis).

    Attributes
    ----------
    vibration : tuple
        Root mean square v along each axis [m/s^2].
    frequency : float
        Frequency of the vibration [Hz]. Its phase is drawn for each axis.
    gyroscope, accelerometer : tuple
        Rectification coefficient K of each axis [rad/s / (m/s^2)^2, m/s^2 / (m/s^2)^2].
    """

    kind: Literal["imu_vibration"] = "imu_vibration"
    vibration: Triple = quantity("g", also=("m_s2",))
    frequency: Positive = quantity("hz", 40.0)
    gyroscope: Triple = quantity("deg_h_g2", ZERO)
    accelerometer: Triple = quantity("ug_g2", ZERO)

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Vibration(self, index, seed, self.key_of_streams(index, occurrence))


class _Vibration(AddedErrors):
    def __init__(self, spec: ImuVibration, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        vibration = np.array(spec.vibration)
        self._rectified = np.concatenate([spec.gyroscope, spec.accelerometer]) * np.tile(vibration, 2) ** 2
        self._amplitude, self._turns = sqrt(2.0) * vibration, 2.0 * pi * spec.frequency
        self._phase = self.rng("phase").uniform(0.0, 2.0 * pi, 3)

    def errors(self, since: Array, length: Array) -> Array:
        error = self._rectified[None].repeat(len(since), axis=0)
        end, begin = (np.cos(self._turns * t[:, None] + self._phase) for t in (since, since - length))
        error[:, 3:] += self._amplitude * (begin - end) / (self._turns * length[:, None])
        return error
