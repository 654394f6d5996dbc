"""The step of a filter for readings of one time of the channels of an instrument, such as the satellites of a receiver.

They are predicted at one state, and the state is corrected once. One by one, as `filter_step` takes them, each would be
predicted at the state that those before it corrected. The order of the functions is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from simnav.estimators.algebra.joseph import joseph_sequence
from simnav.estimators.models.base import Linearised
from simnav.estimators.models.filtering import Readings, ReadingsOfSteps, clear_readings
from simnav.estimators.models.propagation import Samples
from simnav.types import Measurement

__all__ = ["step_together"]


def step_together(
    f: Any,
    predict: Callable[[Sequence[Measurement]], Linearised | None],
    measurements: Sequence[Measurement],
    arrays: ReadingsOfSteps,
    samples: Samples,
    until: float,
) -> Readings | None:
    """Use readings of one time with the noise of the datasheet.

    Parameters
    ----------
    f : Filter
        The functions of the filter for a caller in Python (`Filter.in_python`).
    predict : callable
        Predicts the readings (`ErrorModel.measure_together`).
    measurements : sequence of Measurement
        The readings.
    arrays : ReadingsOfSteps
        Makes arrays of them.
    samples : Samples
        The IMU samples of the step.
    until : float
        Time to which the state is propagated first [s].

    Returns
    -------
    Readings or None
        What became of each; None if they have to be used one by one.
    """
    f.propagate(f.dynamics, samples, until)
    predicted = predict(measurements)
    if predicted is None:
        return None
    readings, count, dynamics = arrays.of_instruments(measurements), len(measurements), f.dynamics
    clear_readings.unchecked(readings, count)
    nis, size = readings.nis[:count], readings.size[:count]
    joseph_sequence.unchecked(dynamics.covariance, *predicted, dynamics.correction, nis, size)
    f.retract(dynamics)
    return readings
