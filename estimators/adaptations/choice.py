"""The choice of the noise of one reading: test the prediction, ask the rule of an adaptation, report what was chosen.

This is the one flow for filters and windows. A rule is a function with a memory; a filter and a window hand it over in
a `Choice`. It is compiled where the rule is a kernel, and plain Python otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import FlagVector, IntegerVector, Matrix, Vector
from simnav.records import Record
from simnav.types import Instruments

from .prediction import PredictionTest, TestRecord, joint_inflation, judge_prediction
from .rules import copied

__all__ = ["Choice", "choose_noise", "keep_nominal", "no_choice"]


class Choice(Record):
    """How the noise of each reading is chosen, for i instruments of a filter among j instruments of a run.

    Attributes
    ----------
    rule : callable
        Chooses a noise (`simnav.estimators.adaptations.rules`).
    estimates : bool
        Whether the rule estimates the noise, so that the last one stands while a prediction is poor.
    inflates_disturbed : bool
        Whether the covariance of a disturbed prediction is inflated.
    index : (i,) array of int
        Index of each instrument of the filter among those of the run.
    in_scope : (i,) array of bool
        Whether the rule is asked for an instrument.
    last : (i, 9) array
        The noise used last, its elements one after the other; zeros before the first.
    settings : (j, p) array
        Settings of the rule for each instrument.
    memories : (q,) array
        The memories of all instruments, one after the other.
    first : (j + 1,) array of int
        Index of the first element of each memory.
    common : (c,) array
        What the rule keeps of all instruments together.
    test : TestRecord
        The tests of the prediction.
    """

    rule: Callable[[Vector, Vector, Vector, Readings, int, Prediction], float]
    estimates: bool
    inflates_disturbed: bool
    index: IntegerVector
    in_scope: FlagVector
    last: Matrix
    settings: Matrix
    memories: Vector
    first: IntegerVector
    common: Vector
    test: TestRecord


@helper
def is_used(last: Vector) -> bool:
    """Whether there is a noise that was used last."""
    used: bool = last[0] > 0.0
    return used


@kernel
def is_poor(predicted: Matrix, nominal: Matrix, last: Vector) -> bool:
    """Whether a prediction is less certain than the noise used last, so that it tells little about the noise."""
    before, trace, m = 0.0, 0.0, predicted.shape[0]
    for a in range(m):
        before += last[a * (m + 1)] if is_used(last) else nominal[a, a]
        trace += predicted[a, a]
    return trace > before


@kernel
def has_noise(nominal: Matrix) -> bool:
    """Whether all components have noise."""
    noisy = True
    for a in range(nominal.shape[0]):
        noisy = noisy and nominal[a, a] > 0.0
    return noisy


@kernel
def remember(noise: Matrix, last: Vector, sigma: Vector) -> None:
    """Keep the elements of a noise, and its sigmas for the report."""
    m = noise.shape[0]
    for a in range(m):
        sigma[a] = sqrt(noise[a, a])
        for b in range(m):
            last[a * m + b] = noise[a, b]


@kernel(passed=True)
def choose_noise(choice: Choice, covariance: Matrix, readings: Readings, k: int, prediction: Prediction) -> None:
    """Write the noise of a reading into its prediction, and what was decided into the readings.

    Parameters
    ----------
    choice : Choice
        The rule and the test; their memories are updated.
    covariance : (n, n) array
        Covariance of the model's error before the reading.
    readings : Readings
        Of reading k, ``sigma``, ``reported``, ``inflation``, ``rejected`` and ``wrong`` are set.
    k : int
        The reading.
    prediction : Prediction
        Its innovation; ``noise`` is overwritten. An instrument without noise keeps its nominal one.
    """
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    row, m = readings.instrument[k], prediction.innovation.size
    i, last = choice.index[row], choice.last[row]
    copied(nominal, noise)
    if not has_noise(nominal):
        return
    test, wrong = choice.test, False
    if test.tests:
        judged = judge_prediction(innovation, predicted, nominal, i, readings.time[k], readings.value[k, :m], test)
        wrong = judged.wrong
        if judged.disturbed and choice.inflates_disturbed:
            readings.inflation[k] = joint_inflation(innovation, predicted, nominal, covariance, test)
    readings.wrong[k] = wrong
    if not wrong and choice.in_scope[row]:
        if choice.estimates and is_poor(predicted, nominal, last):
            if is_used(last):
                copied(last[: m * m].reshape((m, m)), noise)
        else:
            memory = choice.memories[choice.first[i] : choice.first[i + 1]]
            readings.reported[k] = choice.rule(choice.settings[i], memory, choice.common, readings, k, prediction)
            if readings.rejected[k]:
                return
    remember(noise, last, readings.sigma[k])


@kernel(passed=True)
def keep_nominal(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """The rule that uses the noise of the datasheet."""
    copied(prediction.nominal, prediction.noise)
    return 0.0


def no_choice() -> Choice:
    """What a filter without an adaptation hands over in its place."""
    return Choice(
        rule=keep_nominal, estimates=False, inflates_disturbed=False, index=np.empty(0, np.int64),
        in_scope=np.empty(0, np.bool_), last=np.empty((0, 9)), settings=np.empty((0, 0)), memories=np.empty(0),
        first=np.empty(0, np.int64), common=np.empty(0), test=PredictionTest(Instruments()).record(0),
    )  # fmt: skip
