"""Navigators of many voyages: the plain inertial filter in one compiled pass, any other estimator one by one.

The pass makes the steps of `simnav.estimators.solvers.kalman.KalmanEstimator` around an `InertialModel`, with the same
kernels, and gives the same numbers, bit for bit.
"""

from __future__ import annotations

from functools import cached_property
from math import atan2, hypot
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import kernel
from simnav.estimator import Estimator
from simnav.estimators.models.covariance_propagation import propagate_covariance
from simnav.estimators.models.filtering import Aid
from simnav.estimators.models.inertial import InertialModel
from simnav.estimators.models.inertial_functions import use_reading
from simnav.estimators.models.measurements import State
from simnav.estimators.models.propagation import (
    BLOCK,
    BLOCK_NUMBERS,
    CLOCK,
    Motion,
    Samples,
    accumulate_error,
    advance_inertial,
)
from simnav.estimators.models.suitable import Suitable
from simnav.estimators.solvers.admission import LATE, is_usable
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.kernel_types import FlagVector, IntegerMatrix, IntegerVector, Matrix, Stack, Vector
from simnav.sensors.stepwise import Delivered, ImuSteps
from simnav.simulation.steps import SteppedRuns
from simnav.types import Array, Estimate, InitialState, Instruments

__all__ = ["Navigators", "navigate"]

_PROCESS = ("sensors", "decay", "density")


class AidTables(NamedTuple):
    """The instruments of b filters, at most i each (`simnav.estimators.models.inertial.InertialModel.arrays`).

    Attributes
    ----------
    code, components, bias_at, scale_at, lever_arm, noise : (b, i, ...) array
        As of `simnav.estimators.models.filtering.AidTable`.
    limits : (b, i, 3) array
        Largest plausible values.
    used : (b, i) array
        Time of the last measurement that was used [s].
    """

    code: IntegerMatrix
    components: IntegerMatrix
    bias_at: IntegerMatrix
    scale_at: IntegerMatrix
    lever_arm: Stack
    noise: Stack
    limits: Stack
    used: Matrix


class FilterStates(NamedTuple):
    """The states of b filters (`simnav.estimators.models.inertial.InertialModel.arrays`).

    Attributes
    ----------
    size : (b,) int array
        Number of states.
    time : (b,) array
        Time of the state [s].
    position, velocity, dcm, memory, bias, turn, clock : (b, ...) array
        As of `simnav.estimators.models.propagation.Motion`, where the memory is called increments.
    calibration : (b, ...) array
        States of the instruments.
    covariance : (b, ...) array
        The covariance, flattened, in a row that may be longer.
    """

    size: IntegerVector
    time: Vector
    position: Matrix
    velocity: Matrix
    dcm: Stack
    memory: Matrix
    bias: Matrix
    turn: Matrix
    clock: Matrix
    calibration: Matrix
    covariance: Matrix


class Navigators:
    """The navigators of n voyages.

    Parameters
    ----------
    runs : SteppedRuns
        The runs of the voyages, with their measurements.

    Attributes
    ----------
    estimate : (n, 9) array
        Position, velocity, roll, pitch and yaw; NaN for components that are not estimated.
    spread : (n, 4) array
        Variance of the position north, its covariance, variance east [m^2], and variance of the heading [rad^2].
    """

    def __init__(self, runs: SteppedRuns):
        self.runs, self.n = runs, runs.n
        self.estimate, self.spread = np.full((self.n, 9), np.nan), np.ones((self.n, 4))
        self._others: list[Estimator | None] = [None] * self.n
        self._banked = np.zeros(self.n, np.bool_)
        self._size, self._now = np.full(self.n, 15, np.int64), np.zeros(self.n)
        self._until = np.zeros(self.n)
        self._arrays: dict[str, NDArray[Any]] = {}

    def begin(self, b: int, start: InitialState, instruments: Instruments, navigator: Estimator | None) -> None:
        """Begin a voyage, with a navigator, or the plain filter.

        Raises
        ------
        UnsuitableScenario
            If it lacks an instrument.
        """
        plain = KalmanEstimator(Suitable())
        chosen = plain if navigator is None else navigator
        chosen.reset(start, instruments)
        model = plain.model if navigator is None else None
        arrays = model.arrays(self.runs.names[b]) if type(model) is InertialModel else None
        self._banked[b] = arrays is not None
        self._others[b] = chosen if arrays is None else None
        if arrays is not None:
            self._size[b], self._now[b] = plain.model.size, start.time
            arrays["covariance"] = plain.covariance.ravel()
            arrays["used"] = np.full(len(self.runs.names[b]), -np.inf)
            for name, array in arrays.items():
                self._put(name, b, array)
        self._note(b, Estimate(start.time, start.position, start.velocity, start.attitude, start.covariance))

    def update(self, active: NDArray[np.bool_]) -> None:
        """Process the measurements of the last step of some voyages."""
        runs = self.runs
        for b in np.flatnonzero(active & ~self._banked).tolist():
            navigator = self._others[b]
            assert navigator is not None
            self._note(b, navigator.update(runs.packet(b)))
        banked = active & self._banked
        if not banked.any():
            return
        for b in np.flatnonzero(banked).tolist():
            self._until[b] = runs.interval_of(b)[1]
        instruments, process, state = self._bank
        result = self.estimate, self.spread
        navigate.unchecked(banked, self._until, runs.delivered, runs.imu_steps, instruments, process, state, result)

    @cached_property
    def _bank(self) -> tuple[AidTables, Any, FilterStates]:
        """The arrays as `navigate` takes them; `_put` forgets them where it replaces one."""
        known = self._arrays | {"size": self._size, "time": self._now}
        return (
            AidTables(**{name: known[name] for name in AidTables._fields}),
            tuple(known[name] for name in _PROCESS),
            FilterStates(**{name: known[name] for name in FilterStates._fields}),
        )

    def _put(self, name: str, b: int, array: NDArray[Any]) -> None:
        """Store an array of voyage b; where there is no room for it, all get more."""
        old = self._arrays.get(name)
        if old is None or any(m > c for m, c in zip(array.shape, old.shape[1:], strict=True)):
            shape = array.shape if old is None else tuple(map(max, array.shape, old.shape[1:]))
            new = np.zeros((self.n, *shape), array.dtype)
            if old is not None:
                new[tuple(slice(0, m) for m in old.shape)] = old
            old = self._arrays[name] = new
            self.__dict__.pop("_bank", None)
        place: Any = (b, *(slice(0, m) for m in array.shape))
        old[place] = array

    def _note(self, b: int, e: Estimate) -> None:
        for k, part in enumerate((e.position, e.velocity, e.attitude)):
            self.estimate[b, 3 * k : 3 * k + 3] = np.nan if part is None else part
        self.spread[b] = 1.0, 0.0, 1.0, 1.0
        if e.covariance is not None:
            p = e.covariance
            self.spread[b] = p[0, 0], p[0, 1], p[1, 1], p[8, 8]

    def covariance(self, b: int) -> Array:
        """(2, 2) array: of the position, north and east [m^2]."""
        p, q, r, _ = self.spread[b].tolist()
        return np.array([[p, q], [q, r]])


@kernel
def navigate(
    active: FlagVector,
    until: Vector,
    delivered: Delivered,
    imu: ImuSteps,
    instruments: AidTables,
    process: tuple[Matrix, Matrix, Matrix],
    state: FilterStates,
    result: tuple[Matrix, Matrix],
) -> None:
    """One step of many inertial filters: each propagated to its measurements, and corrected by them.

    Parameters
    ----------
    active : (b,) bool array
        True for each filter that is advanced.
    until : (b,) array
        End of each step [s].
    delivered : Delivered
        Measurements of the step.
    imu : ImuSteps
        IMU samples of the step.
    instruments : AidTables
        The instruments of each filter; the times of their last used measurements are updated.
    process : tuple of (b, ...) arrays
        ``sensors``, ``decay`` and ``density`` of `InertialModel.arrays`.
    state : FilterStates
        Updated.
    result : (b, 9) and (b, 4) arrays
        Overwritten with ``estimate`` and ``spread`` of `Navigators`.
    """
    who, when, value = delivered.who, delivered.when, delivered.value
    limits, used = instruments.limits, instruments.used
    sensors, decay, density = process
    position, velocity, dcm, bias, clock = state.position, state.velocity, state.dcm, state.bias, state.clock
    calibration, now = state.calibration, state.time
    estimate, spread = result
    longest = 0.0
    for b in range(active.size):
        if active[b]:
            longest = max(longest, until[b] - now[b])
    blocks = np.empty((int(longest / BLOCK) + 4, BLOCK_NUMBERS))
    transition, process_noise = np.empty((15, 15)), np.empty((15, 15))
    unmeasured = np.zeros((imu.time.shape[1], 6))  # the IMU measures at all times
    for b in range(active.size):
        if not active[b]:
            continue
        n, first, since = state.size[b], 0, now[b]
        P = state.covariance[b, : n * n].reshape((n, n))
        correction = np.empty(n)
        for j in range(delivered.number[b] + 1):
            i, d = -1, 0
            stop = until[b]
            if j < delivered.number[b]:
                i = who[b, j]
                d, t = instruments.components[b, i], when[b, j]
                if d == 0:  # it is none of those that the filter uses
                    continue
                begin, end = since - LATE, until[b] + LATE
                if not is_usable(t, value[b, j], used[b, i], limits[b, i, :d], begin, end):
                    continue
                used[b, i] = t
                stop = min(t, until[b])
            elapsed = stop - now[b]
            if elapsed > 0.0:
                s = imu.number[b]
                moved = Motion(position[b], velocity[b], dcm[b], bias[b], state.memory[b], state.turn[b], clock[b])
                samples = Samples(
                    imu.time[b, :s],
                    imu.interval[b, :s],
                    imu.angular_rate[b, :s],
                    imu.specific_force[b, :s],
                    unmeasured[:s],
                )
                first, blocks_used = advance_inertial(moved, samples, first, stop, sensors[b], blocks)
                accumulate_error(blocks, blocks_used, sensors[b], transition, process_noise)
                now[b] = stop
                more = n - 15
                propagate_covariance(
                    P, transition, process_noise, calibration[b, :more], decay[b, :more], density[b, :more], elapsed
                )
            if i >= 0:
                bias_at, scale_at = instruments.bias_at[b, i], instruments.scale_at[b, i]
                aid = Aid(instruments.code[b, i], instruments.lever_arm[b, i], bias_at, scale_at)
                rate = clock[b].view(CLOCK)[0].rate[:]
                here = State(position[b], velocity[b], dcm[b], rate, bias[b], calibration[b, : n - 15])
                noise = instruments.noise[b, i, : d * d].reshape((d, d))
                use_reading(aid, value[b, j, :d], here, P, noise, correction)
        for k in range(3):
            estimate[b, k], estimate[b, 3 + k] = position[b, k], velocity[b, k]
        c = dcm[b]
        estimate[b, 6] = atan2(c[2, 1], c[2, 2])
        estimate[b, 7] = atan2(-c[2, 0], hypot(c[2, 1], c[2, 2]))
        estimate[b, 8] = atan2(c[1, 0], c[0, 0])
        spread[b, 0], spread[b, 1], spread[b, 2], spread[b, 3] = P[0, 0], P[0, 1], P[1, 1], P[8, 8]
