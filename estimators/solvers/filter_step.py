"""One step of a filter: propagate, predict, choose the noise, correct. Every Kalman filter of simnav is this loop.

The functions that it calls are handed over in a `Filter`. If all of them are kernels, the whole step is compiled code,
once for all models, adaptations and solvers; if one of them is a Python function, the same source runs in Python
(``filter_step.function``). A solver of another kind replaces one of the functions
(`simnav.estimators.solvers.kalman.KalmanEstimator.functions`).
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.choice import Choice
from simnav.estimators.algebra.joseph import joseph_update
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings, clear_readings
from simnav.estimators.models.propagation import Samples
from simnav.kernel_types import Matrix
from simnav.records import Record

__all__ = ["Filter", "correct", "filter_step", "use_nominal"]


class Filter(Record):
    """A filter as data: its functions, and what they work on.

    Attributes
    ----------
    dynamics : Dynamics
        The state of the model, with its covariance.
    choice : Choice
        How the noise of each reading is chosen.
    propagate : callable
        Advances the state to a time.
    predict : callable
        Predicts a reading: its innovation, P H', H P H' and nominal noise; False where there is no such reading.
    choose : callable
        Sets the noise of a reading, or rejects it, or asks for an inflation of the covariance.
    inflate : callable
        Inflates the covariance by the factor of a reading; True if the reading has to be predicted again.
    correct : callable
        Corrects covariance and state; the normalised innovation squared, -1 if nothing was changed.
    retract : callable
        Adds the correction to the state.
    """

    dynamics: Dynamics
    choice: Choice
    propagate: Callable[[Dynamics, Samples, float], None]
    predict: Callable[[Dynamics, Readings, int, Prediction], bool]
    choose: Callable[[Choice, Matrix, Readings, int, Prediction], None]
    inflate: Callable[[Dynamics, Readings, int, Prediction], bool]
    correct: Callable[[Dynamics, Choice, Readings, int, Prediction], float]
    retract: Callable[[Dynamics], None]


@kernel
def filter_step(f: Filter, readings: Readings, samples: Samples, count: int, until: float) -> None:
    """Use the readings of a step, each at its own time, and propagate to the end of the step.

    Parameters
    ----------
    f : Filter
        The filter; its state and its covariance are updated.
    readings : Readings
        In order of their times, as `ReadingsOfSteps` makes them; one that is later than ``until`` is used then. What
        became of each is written into it.
    samples : Samples
        The IMU samples of the step.
    count : int
        Number of readings.
    until : float
        End of the step [s].
    """
    n = f.dynamics.covariance.shape[0]
    clear_readings(readings, count)
    for k in range(count):
        f.propagate(f.dynamics, samples, min(float(readings.time[k]), until))
        d = int(readings.components[k])
        prediction = Prediction(np.empty(d), np.empty((n, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d)))
        if not f.predict(f.dynamics, readings, k, prediction):
            continue
        square = 0.0
        for a in range(d):
            square += prediction.innovation[a] * prediction.innovation[a]
        readings.size[k] = sqrt(square)
        f.choose(f.choice, f.dynamics.covariance, readings, k, prediction)
        if readings.rejected[k]:
            continue
        if readings.inflation[k] != 1.0 and f.inflate(f.dynamics, readings, k, prediction):
            f.predict(f.dynamics, readings, k, prediction)
        readings.nis[k] = nis = f.correct(f.dynamics, f.choice, readings, k, prediction)
        if nis >= 0.0:
            f.retract(f.dynamics)
    f.propagate(f.dynamics, samples, until)


@kernel(passed=True)
def use_nominal(choice: Choice, covariance: Matrix, readings: Readings, k: int, prediction: Prediction) -> None:
    """Choose the noise of the datasheet."""
    d = prediction.innovation.size
    for a in range(d):
        for b in range(d):
            prediction.noise[a, b] = prediction.nominal[a, b]


@kernel(passed=True)
def correct(dynamics: Dynamics, choice: Choice, readings: Readings, k: int, prediction: Prediction) -> float:
    """Correct the covariance, and compute the correction of the state (`joseph_update`)."""
    d = prediction.innovation.size
    spread = np.empty((d, d))
    for a in range(d):
        for b in range(d):
            spread[a, b] = prediction.predicted[a, b] + prediction.noise[a, b]
    return joseph_update(dynamics.covariance, prediction.cross, spread, prediction.innovation, dynamics.correction)
