"""One step of a window: propagate, predict, choose the noise, attach. Every window of simnav is this loop.

Each measurement becomes a factor, at its own time. The functions that the loop calls are handed over in a `WindowStep`.
If all of them are kernels, it is compiled code; if not, the same source runs in Python (``attach_readings.function``).
What follows is the iteration (`simnav.estimators.solvers.window_iteration`), and the nodes that leave
(`simnav.estimators.models.marginalisation`).
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.choice import Choice, choose_noise
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.algebra.factors import NewRows, Rows
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings, clear_readings
from simnav.estimators.models.new_factors import Growing
from simnav.estimators.models.propagation import Samples
from simnav.kernel_types import Matrix
from simnav.records import Record

__all__ = ["WindowStep", "attach_readings", "choose_and_test"]


class WindowStep(Record):
    """A step of a window as data: its functions, and what they work on.

    Attributes
    ----------
    dynamics : Dynamics
        The state of the model at the front; its covariance, if ``advance`` propagates it.
    choice : Choice
        How the noise of each reading is chosen.
    advance : callable
        Propagates the front to a time.
    predict : callable
        Predicts a reading, at least its nominal noise; False where there is no such reading.
    choose : callable
        Sets the noise of a reading, or rejects it.
    make_node : callable
        Makes the front a node, with a motion factor.
    attach : callable
        Makes a reading a factor of the newest node.
    """

    dynamics: Dynamics
    choice: Choice
    advance: Callable[[Dynamics, Growing, Samples, float], None]
    predict: Callable[[Dynamics, Readings, int, Prediction], bool]
    choose: Callable[[Choice, Matrix, Readings, int, Prediction], None]
    make_node: Callable[[Dynamics, Growing, Rows, NewRows], NewRows]
    attach: Callable[[Dynamics, Growing, Rows, NewRows, Readings, int, Prediction], NewRows]


@kernel
def attach_readings(
    w: WindowStep,
    growing: Growing,
    rows: Rows,
    readings: Readings,
    samples: Samples,
    count: int,
    until: float,
    spacing: float,
) -> NewRows:
    """Make the readings of a step factors, each at its own time.

    Parameters
    ----------
    w : WindowStep
        The functions of the step.
    growing : Growing
        The nodes and factors.
    rows : Rows
        Where the window is in its columns, which have room for ``count`` rows more.
    readings : Readings
        In order of their times; one that is later than ``until`` is used then. What became of each is written into it;
        its ``size`` is -1 where it was not predicted, or only its noise was.
    samples : Samples
        The IMU samples of the step.
    count : int
        Number of readings.
    until : float
        End of the step [s].
    spacing : float
        A reading closer to the newest node than this [s] has no node of its own, unless it has the latest time.

    Returns
    -------
    NewRows
        How many rows were appended.
    """
    new, n = NewRows(0, 0, 0), w.dynamics.covariance.shape[0]
    clear_readings(readings, count)
    for k in range(count):
        time = float(readings.time[k])
        w.advance(w.dynamics, growing, samples, min(time, until))
        d = int(readings.components[k])
        prediction = Prediction(np.empty(d), np.empty((n, d)), np.empty((d, d)), np.empty((d, d)), np.empty((d, d)))
        if not w.predict(w.dynamics, readings, k, prediction):
            continue
        w.choose(w.choice, w.dynamics.covariance, readings, k, prediction)
        if readings.rejected[k]:
            continue
        ahead = float(growing.since_node.elapsed[0])
        if ahead > 0.0 and (time == readings.time[count - 1] or ahead >= spacing):
            new = w.make_node(w.dynamics, growing, rows, new)
        new = w.attach(w.dynamics, growing, rows, new, readings, k, prediction)
    return new


@kernel(passed=True)
def choose_and_test(choice: Choice, covariance: Matrix, readings: Readings, k: int, prediction: Prediction) -> None:
    """Choose the noise as a filter does, and test the innovation with it."""
    choose_noise(choice, covariance, readings, k, prediction)
    square = 0.0
    for innovation in prediction.innovation:
        square += innovation * innovation
    readings.size[k] = sqrt(square)
    readings.nis[k] = normalised_square(prediction.innovation, prediction.predicted, prediction.noise)
