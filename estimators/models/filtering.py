"""What the functions of a filter work on: the arrays of a model, the readings of a step, and one prediction.

A model that has its equations as kernels keeps its state in one flat vector, with all else that its functions need, in
`Dynamics`. `ModelFunctions` are these functions. `simnav.estimators.solvers.filter_step` calls them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.inflation import MotionStates
from simnav.kernel_types import FlagVector, IntegerVector, Matrix, Vector
from simnav.records import Record
from simnav.types import Array, Measurement

__all__ = [
    "NOWHERE", "Aid", "AidTable", "Dynamics", "ModelFunctions", "Prediction", "Readings", "ReadingsOfSteps",
    "SigmaPoints", "aid_of", "aid_table", "clear_readings", "has_noise_chosen", "room_for",
]  # fmt: skip


#: Index of a state that an instrument does not have.
NOWHERE = -1


class Aid(NamedTuple):
    """The parameters of an instrument.

    Attributes
    ----------
    code : int
        Its measurement equation, by the number that its model has for it.
    lever_arm : (3,) array
        In body axes [m].
    bias_at, scale_at : int
        Index in the error state of its first bias, and of its scale factor; `NOWHERE` for none. Of an inertial model
        there are three misalignments after a DVL's scale factor, and the current, north and east, after a log's bias.
    """

    code: int = 0
    lever_arm: Vector = np.zeros(3)
    bias_at: int = NOWHERE
    scale_at: int = NOWHERE

    def __deepcopy__(self, memo: object) -> Aid:
        """Itself: it never changes, and an estimator that takes late readings is copied in each step."""
        return self


class AidTable(NamedTuple):
    """The instruments of a filter, one in each row.

    Attributes
    ----------
    code, bias_at, scale_at : (i,) array of int
        As of `Aid`.
    components : (i,) array of int
        Number of components that the model predicts; 0 for an instrument that it does not observe.
    lever_arm : (i, 3) array
        In body axes [m].
    noise : (i, 9) array
        Figures of the white noise: of an inertial model the elements of its covariance, of a ship
        `simnav.estimators.models.ship_kernels.SHIP_NOISE`.
    """

    code: IntegerVector
    components: IntegerVector
    bias_at: IntegerVector
    scale_at: IntegerVector
    lever_arm: Matrix
    noise: Matrix

    def __deepcopy__(self, memo: object) -> AidTable:
        """Itself: it never changes, and an estimator that takes late readings is copied in each step."""
        return self


def aid_table(aids: Sequence[Aid | None], components: Sequence[int], noise: Sequence[Array]) -> AidTable:
    """The table of some instruments; None for one that is not observed.

    Parameters
    ----------
    aids : sequence of Aid or None
        Parameters of each instrument.
    components : sequence of int
        Number of components of each.
    noise : sequence of (at most 9,) array
        Figures of the white noise of each.
    """
    i = len(aids)
    whole: Any = np.int64
    table = AidTable(
        np.zeros(i, whole), np.array(components, whole), np.full(i, -1, whole), np.full(i, -1, whole),
        np.zeros((i, 3)), np.zeros((i, 9)),
    )  # fmt: skip
    for row, (aid, figures) in enumerate(zip(aids, noise, strict=True)):
        if aid is not None:
            table.code[row], table.lever_arm[row] = aid.code, aid.lever_arm
            table.bias_at[row], table.scale_at[row] = aid.bias_at, aid.scale_at
            table.noise[row, : len(figures)] = figures
    return table


@helper
def aid_of(table: AidTable, row: int) -> Aid:
    """An instrument of a table."""
    return Aid(table.code[row], table.lever_arm[row], table.bias_at[row], table.scale_at[row])


class SigmaPoints(NamedTuple):
    """The points of a filter that takes its moments from them (`simnav.estimators.models.points`).

    Attributes
    ----------
    spread : float
        Distance of the points from the state, in columns of the square root of the covariance.
    weight : float
        Weight of each point.
    excess : float
        Weight of the squared mean in a covariance.
    errors : (2 n, n) array
        Differences of the points from the state.
    """

    spread: float
    weight: float
    excess: float
    errors: Matrix


class Dynamics(Record):
    """The state of a model with n error components, its covariance, and what its functions need to know.

    Attributes
    ----------
    numbers : (s,) array
        The flat state. Its model knows the named blocks.
    covariance : (n, n) array
        Covariance of the error.
    transition, process_noise : (m, m) arrays
        Of the last propagation.
    constants : (c,) array
        Figures of the motion; its model knows their meaning.
    decay, density : (n - m,) arrays
        Inverse correlation times [1/s] and noise densities of the states behind the motion.
    first_variances, correction : (n,) arrays
        Variances at the start of the run; the last correction of the state.
    next_sample : (1,) array of int
        Index of the first IMU sample of the step that is not completely used.
    aids : AidTable
        The instruments.
    moving : MotionStates
        The states of the motion.
    points : SigmaPoints
        None of them where the filter linearises.
    """

    numbers: Vector
    covariance: Matrix
    transition: Matrix
    process_noise: Matrix
    constants: Vector
    decay: Vector
    density: Vector
    first_variances: Vector
    correction: Vector
    next_sample: IntegerVector
    aids: AidTable
    moving: MotionStates
    points: SigmaPoints = SigmaPoints(0.0, 0.0, 0.0, np.empty((0, 0)))


class Readings(Record):
    """The readings of a step in the order of their times, and what became of each.

    Attributes
    ----------
    instrument, components : (k,) array of int
        Row of its instrument, and number d of its components.
    time : (k,) array
        Time of validity [s].
    value : (k, 3) array
        What was measured.
    nis : (k,) array
        Normalised innovation squared; -1 where the reading was not used.
    size : (k,) array
        Norm of the innovation; -1 where the reading was not predicted.
    sigma : (k, 3) array
        Roots of the variances that an adaptation chose; NaN where none was chosen.
    reported : (k,) array
        A further number that an adaptation reports, or 0.
    inflation : (k,) array
        Factor by which the covariance of the prediction is inflated before the reading is used.
    rejected, wrong : (k,) array of bool
        Whether the reading is rejected; whether the prediction is taken as wrong.
    """

    instrument: IntegerVector
    components: IntegerVector
    time: Vector
    value: Matrix
    nis: Vector
    size: Vector
    sigma: Matrix
    reported: Vector
    inflation: Vector
    rejected: FlagVector
    wrong: FlagVector


@kernel
def clear_readings(readings: Readings, count: int) -> None:
    """Forget what became of the first readings: none of them is predicted yet."""
    for k in range(count):
        readings.nis[k] = readings.size[k] = -1.0
        readings.sigma[k, 0], readings.reported[k], readings.inflation[k] = np.nan, 0.0, 1.0
        readings.rejected[k] = readings.wrong[k] = False


@helper
def has_noise_chosen(readings: Readings, k: int) -> bool:
    """Whether an adaptation has chosen the noise of a reading."""
    chosen: bool = readings.sigma[k, 0] == readings.sigma[k, 0]  # NaN is not equal to itself
    return chosen


class Prediction(NamedTuple):
    """What one reading of d components is compared with.

    Attributes
    ----------
    innovation : (d,) array
        Measured minus predicted, in the units of ``KINDS[kind].errors``.
    cross, predicted : (n, d), (d, d) array
        P H' and H P H', with the covariance P of the model's error and the Jacobian H of the reading. The first is
        empty where a rule is asked through `simnav.estimators.adaptations.noise.NoiseAdaptation.adapt`.
    nominal, noise : (d, d) array
        Covariance R of the noise by the datasheet, and that which is used.
    """

    innovation: Vector
    cross: Matrix
    predicted: Matrix
    nominal: Matrix
    noise: Matrix


class ModelFunctions(NamedTuple):
    """The equations of a model as kernels.

    Attributes
    ----------
    propagate : Kernel
        Advances a state and its covariance to a time: ``propagate(dynamics, samples, until)``.
    predict : Kernel
        Predicts a reading: ``predict(dynamics, readings, k, prediction)``; False where there is no such reading.
    retract : Kernel
        Adds the correction to the state: ``retract(dynamics)``.
    difference : callable, optional
        The error that leads from another flat state to one: ``difference(numbers, other, error)`` overwrites the (n,)
        ``error``. Only the window of a `simnav.estimators.models.function_model.FunctionModel` asks for it.
    """

    propagate: Callable[..., None]
    predict: Callable[..., bool]
    retract: Callable[..., None]
    difference: Callable[..., None] | None = None


def room_for(count: int) -> Readings:
    """Room for so many readings."""
    whole: Any = np.int64
    return Readings(
        instrument=np.zeros(count, whole), components=np.zeros(count, whole), time=np.zeros(count),
        value=np.zeros((count, 3)), nis=np.zeros(count), size=np.zeros(count),
        sigma=np.zeros((count, 3)), reported=np.zeros(count), inflation=np.ones(count),
        rejected=np.zeros(count, np.bool_), wrong=np.zeros(count, np.bool_),
    )  # fmt: skip


class ReadingsOfSteps:
    """The readings of a step as arrays, which are used again at the next step.

    Parameters
    ----------
    components : dict of str to int
        The instruments in the order of their rows, with the number of components that a model predicts.
    """

    def __init__(self, components: Mapping[str, int]):
        self._row = {name: (i, d) for i, (name, d) in enumerate(components.items())}
        self._readings = room_for(8)

    def room(self, count: int) -> Readings:
        """Room for so many readings at least; those of the call before are there until they are overwritten."""
        if count > len(self._readings.time):
            self._readings = room_for(2 * count)
        return self._readings

    def of_instruments(self, measurements: Sequence[Measurement]) -> Readings:
        """Room for measurements, of which only the instruments are written."""
        into, known = self.room(len(measurements)), self._row
        into.instrument[: len(measurements)] = [known[m.instrument][0] for m in measurements]
        return into

    def fill(self, measurements: Sequence[Measurement]) -> Readings:
        """The measurements as arrays; those of the call before are overwritten."""
        into, known = self.room(len(measurements)), self._row
        instrument, components, time, value = into.instrument, into.components, into.time, into.value
        for k, m in enumerate(measurements):
            (instrument[k], components[k]), time[k] = known[m.instrument], m.time
            value[k, : len(m.value)] = m.value
        return into
