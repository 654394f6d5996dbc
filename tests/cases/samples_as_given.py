"""The samples of an IMU as a model takes them, without the flat-line test."""

from __future__ import annotations

import numpy as np

from simnav.estimators.models.flat_lines import AXES
from simnav.estimators.models.propagation import NO_SAMPLES, Samples
from simnav.types import ImuSamples

__all__ = ["as_given"]


def as_given(imu: ImuSamples | None) -> Samples:
    """The samples of a step; all of them are measurements."""
    if imu is None:
        return NO_SAMPLES
    return Samples(imu.time, imu.interval, imu.angular_rate, imu.specific_force, np.zeros((len(imu.time), AXES)))
