"""The plain extended Kalman filter, and the linear problem that it leaves behind in each step.

A filter with other noise would be at ``x = x_r + delta``, x_r the state of the plain filter. To first order in delta it
needs nothing that the plain filter does not have already: the transition matrix Phi and the process noise Q of each
propagation, and the innovation v, the Jacobian H, the noise R and the correction d of each measurement::

    propagation    delta = Phi delta,  P = Phi P Phi' + Q
    measurement    innovation v - H delta;  delta = delta + K (v - H delta) - d

So one filter is run per voyage, whatever is learned about the noise, and all the others are a few matrix products
(`simnav.estimators.learning.bank`). With the nominal noise delta stays zero up to rounding. delta is metres where P is
metres: the terms of second order that are left out are 1e-7 of the distance to the plain filter in position, and half
the square of the difference in heading times the velocity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from simnav.estimators.models.base import Linearised
from simnav.estimators.models.filtering import Dynamics, Prediction, Readings
from simnav.estimators.models.propagation import Samples
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.kalman import FilterFunctions, KalmanEstimator
from simnav.kernel_types import FlagVector, IntegerVector, Matrix, Stack, Vector
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

__all__ = ["LARGEST_MEASUREMENT", "Linear", "ReferenceFilter"]

#: Components of the largest measurement.
LARGEST_MEASUREMENT = 3


class Linear(NamedTuple):
    """The linear problem of e events in a row, each a propagation and the measurement at its end.

    Attributes
    ----------
    transition, process_noise : (e, n, n) array
        Transition matrix Phi and process noise Q of each propagation.
    moves : (e,) bool array
        False where the event has no propagation.
    instrument : (e,) int array
        Which of the watched instruments measures; -1 for none: the propagation to the end of a step.
    time : (e,) array
        Of the measurement [s].
    size : (e,) int array
        Number m of components of the measurement; 0 for none.
    innovation : (e, 3) array
        v; the first m numbers count.
    jacobian : (e, 3, n) array
        H; the first m rows count.
    noise : (e, 3, 3) array
        R; the first m rows and columns count.
    correction : (e, n) array
        d, what the plain filter added to its state.
    """

    transition: Stack
    process_noise: Stack
    moves: FlagVector
    instrument: IntegerVector
    time: Vector
    size: IntegerVector
    innovation: Matrix
    jacobian: Stack
    noise: Stack
    correction: Matrix

    @staticmethod
    def empty(events: int, n: int) -> Linear:
        """Room for so many events of a filter with n states."""
        m = LARGEST_MEASUREMENT
        return Linear(
            np.zeros((events, n, n)), np.zeros((events, n, n)), np.zeros(events, np.bool_),
            np.full(events, -1, np.int64), np.zeros(events), np.zeros(events, np.int64), np.zeros((events, m)),
            np.zeros((events, m, n)), np.zeros((events, m, m)), np.zeros((events, n)),
        )  # fmt: skip

    @staticmethod
    def bytes_each(n: int) -> int:
        """Bytes of one event of a filter with n states."""
        return sum(array.nbytes for array in Linear.empty(1, n))

    def put(self, at: int, other: Linear, count: int) -> None:
        """Copy the first events of another here."""
        for mine, theirs in zip(self, other, strict=True):
            mine[at : at + count] = theirs[:count]


class ReferenceFilter(KalmanEstimator):
    """The filter of ``ekf`` (of ``ship-ekf`` without an IMU), which notes its linear problem.

    Parameters
    ----------
    names : list of str
        The instruments, by the numbers of ``Linear.instrument``; those that a run does not have do no harm.

    Attributes
    ----------
    watched : list of str
        The instruments that it uses.
    linear : Linear
        Of the last step.
    count : int
        How many of its events count.
    start_covariance : (n, n) array
        Of the state at the start of the run.
    """

    def __init__(self, names: list[str]) -> None:
        super().__init__(Suitable())
        self._number = {name: i for i, name in enumerate(names)}
        self.row = "the plain filter of a learning task"

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario where no filter fits the instruments."""
        super().reset(start, instruments)
        self.watched = list(self._names)
        if unknown := [name for name in self.watched if name not in self._number]:
            raise ValueError(f"instrument {unknown[0]!r} is not one of {', '.join(self._number)}")
        self.start_covariance = self.covariance.copy()
        self.linear, self.count = Linear.empty(8, self.model.size), 0

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, as the plain filter does."""
        self.count = 0
        self._moved: tuple[Array, Array] | None = None
        estimate = super().update(measurements)
        self._end()
        return estimate

    def _end(self) -> None:
        """A propagation without a measurement is an event of its own."""
        if self._moved is not None:
            self._append()

    def functions(self) -> FilterFunctions:
        """Every motion and every correction is noted."""
        return super().functions().replaced(propagate=self.propagate, predict=self.predict, retract=self.retract)

    def propagate(self, dynamics: Dynamics, samples: Samples, until: float) -> None:
        """Advance the filter, and note its transition matrix and process noise."""
        elapsed = until - self.model.time
        if elapsed <= 0.0:
            return
        self._end()  # a measurement was skipped: two propagations in a row
        before = self.covariance.copy()
        super().propagate(dynamics, samples, until)
        transition = np.eye(self.model.size)
        self.model.carry(transition, elapsed)
        noise = self.covariance - transition @ before @ transition.T
        self._moved = transition, 0.5 * (noise + noise.T)

    def predict(self, dynamics: Dynamics, readings: Readings, k: int, prediction: Prediction) -> bool:
        """Linearise a measurement, which is noted if it is used."""
        self._measurement = self._measurements[k]
        return super().predict(dynamics, readings, k, prediction)

    def retract(self, dynamics: Dynamics) -> None:
        """Correct the state, and note the measurement."""
        super().retract(dynamics)
        self._append(self._number[self._measurement.instrument], self._measurement.time, self._linearised)

    def _append(self, instrument: int = -1, time: float = 0.0, found: Linearised | None = None) -> None:
        """An event: the propagation since the last one, and a measurement that was used."""
        if self.count == len(self.linear.size):
            room = Linear.empty(2 * self.count, self.model.size)
            room.put(0, self.linear, self.count)
            self.linear = room
        linear, e = self.linear, self.count
        self.count += 1
        linear.moves[e] = self._moved is not None
        if self._moved is not None:
            linear.transition[e], linear.process_noise[e] = self._moved
            self._moved = None
        linear.instrument[e], linear.time[e], linear.size[e], linear.correction[e] = instrument, time, 0, 0.0
        if found is not None:
            d = len(found.innovation)
            linear.size[e], linear.correction[e] = d, self.dynamics.correction
            linear.innovation[e, :d], linear.jacobian[e, :d], linear.noise[e, :d, :d] = found
