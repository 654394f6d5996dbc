"""What a simulated run drew, and no estimator is told."""

from __future__ import annotations

import numpy as np

from simnav.scenario import Scenario
from simnav.types import ImuSamples

__all__ = ["imu_biases"]


def imu_biases(scenario: Scenario, seed: int, time: np.ndarray) -> np.ndarray:
    """(T, 6) biases of gyroscopes and accelerometers that a run draws: what the IMU gives at rest without noise."""
    spec = scenario.instruments["imu"]
    quiet = {n: getattr(spec, n).model_copy(update={"random_walk": 0.0}) for n in ("gyroscope", "accelerometer")}
    zeros = np.zeros((len(time), 3))
    real = spec.model_copy(update=quiet).build(seed).sense(ImuSamples(time, np.full(len(time), 1.0), zeros, zeros))
    return np.hstack([real.angular_rate, real.specific_force])
