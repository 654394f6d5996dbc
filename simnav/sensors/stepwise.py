"""One step of the instruments and faults of many runs: the kernels of `simnav.simulation.steps`.

The random numbers of instruments and faults depend on the times of their samples only, so those of several steps of a
run are drawn together. Such steps are a *batch*. The kernels compute what depends on the motion.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import Array, helper, kernel
from simnav.kernel_types import FlagVector, Hypermatrix, IntegerMatrix, IntegerStack, IntegerVector, Matrix, Stack
from simnav.kinds import add_error_scalar
from simnav.sensors.faults.layer import ADDS, DROPS, HOLDS, STEPS_NOISE, ZEROES
from simnav.sensors.imu import triad_errors
from simnav.sensors.observation import noise_scalar, observe_one

__all__ = [
    "BLOCKS", "COMPILED", "DUE", "HELD", "INERTIAL", "UNTOUCHED", "begin_step", "sense", "sense_imu", "sort_out",
]  # fmt: skip

#: State of a layer that repeats values: the last value, and 1 if there is one; number of the interval, and the repeated
#: value.
LAST, HAS_LAST, NUMBER, VALUE = 0, 3, 4, 5
HELD = 8
#: Number of the interval of a measurement that a layer does not affect.
UNTOUCHED = -2
#: What `sort_out` finds: a run with only the block form; one that is compiled, with an IMU, at the end of the batch.
BLOCKS, COMPILED, INERTIAL, DUE = 1, 2, 4, 8


@kernel
def sort_out(
    active: FlagVector,
    runs: tuple[FlagVector, FlagVector, IntegerVector, IntegerVector],
    which: tuple[FlagVector, FlagVector, FlagVector],
) -> int:
    """Find what each of b runs needs in a step.

    Parameters
    ----------
    active : (b,) bool array
        True for each run that is advanced.
    runs : (b,) bool, (b,) bool, (b,) int and (b,) int arrays
        Whether a run is compiled and has an IMU; number of its step within the batch, and number of steps in the batch.
    which : three (b,) bool arrays
        Overwritten: the runs that are advanced and compiled; those of them with an IMU; those at the end of the batch.

    Returns
    -------
    int
        `BLOCKS`, `COMPILED`, `INERTIAL` and `DUE`, as far as there is such a run, added.
    """
    known, imu, at, end = runs
    compiled, inertial, due = which
    found = 0
    for b in range(active.size):
        compiled[b] = active[b] and known[b]
        inertial[b] = compiled[b] and imu[b]
        due[b] = compiled[b] and at[b] >= end[b]
        if active[b]:
            found |= COMPILED if known[b] else BLOCKS
        if inertial[b]:
            found |= INERTIAL
        if due[b]:
            found |= DUE
    return found


@kernel
def begin_step(
    compiled: FlagVector,
    drawn: tuple[IntegerMatrix, IntegerVector],
    counters: tuple[IntegerVector, IntegerVector, IntegerVector],
    limits: tuple[IntegerVector, IntegerVector, IntegerVector],
) -> int:
    """Begin a step of b runs. Return the largest number of times in a step at which the state is needed.

    Parameters
    ----------
    compiled : (b,) bool array
        True for each run that is advanced.
    drawn : (b, s + 1) int and (b,) int arrays
        Where the times of each step begin within the batch, and number of IMU samples in a step.
    counters : three (b,) int arrays
        Number of the step within the batch and in the run, increased; number of IMU samples in the step, overwritten.
    limits : three (b,) int arrays
        Overwritten: number of the step within the batch, index of its first time, and index after the last one.
    """
    edge, samples_a_step = drawn
    at, step, samples = counters
    place, first, last = limits
    most = 0
    for b in range(compiled.size):
        if compiled[b]:
            k = at[b]
            place[b], first[b], last[b] = k, edge[b, k], edge[b, k + 1]
            most = max(most, last[b] - first[b])
            samples[b] = samples_a_step[b]
            at[b] = k + 1
            step[b] += 1
    return most


@kernel
def sense_imu(
    active: FlagVector,
    at: IntegerVector,
    samples: IntegerVector,
    triads: tuple[Hypermatrix, Stack, Stack, Stack],
    drawn: tuple[Hypermatrix, Hypermatrix, Hypermatrix, IntegerStack],
    disturbances: tuple[Annotated[NDArray[np.bool_], "boolean[:, :, ::1]"], Hypermatrix],
    clock: Matrix,
    imu: tuple[Matrix, Matrix, Stack, Stack],
) -> None:
    """Add the errors and disturbances of the IMUs of b runs, for one step of each run.

    The random numbers of several steps, a batch of s samples, were drawn in advance.

    Parameters
    ----------
    active : (b,) bool array
        True for each run that is advanced.
    at, samples : (b,) int arrays
        Number of the step within the batch, and number of samples in a step.
    triads : tuple of (b, 2, ...) arrays
        Gyroscopes and accelerometers: matrix and bias, as `simnav.sensors.imu.triad_errors` takes them; density of the
        white noise, range, quantization, and points a second of both tables; residual of the quantization.
    drawn : (b, 2, s, 3), (b, 2, k, 3), (b, 2, k, 3) and (b, 2, 4) int arrays
        Variates of the samples of the batch; tables of the in-run biases and of the random walks; length and first
        grid point of both tables.
    disturbances : (b, d, s) bool and (b, d, s, 6) arrays
        True for each sample of the batch that each of d disturbances affects, and the errors that they add.
    clock : (b, 2) array
        Number of the sample before the batch, and number of samples in a second.
    imu : tuple of (b, ...) arrays
        Times and intervals, overwritten; angular rates and specific forces: ideal samples, to which the errors are
        added.
    """
    matrix, bias, numbers, residual = triads
    variates, instability, walk, tables = drawn
    disturbed, disturbance = disturbances
    imu_time, imu_interval, rate, force = imu
    for b in range(active.size):
        if not active[b]:
            continue
        n = samples[b]
        begin = at[b] * n
        for i in range(n):
            imu_time[b, i] = (clock[b, 0] + begin + i + 1) / clock[b, 1]
            imu_interval[b, i] = 1.0 / clock[b, 1]
        for t in range(2):
            out = rate[b, :n] if t == 0 else force[b, :n]
            q, table = numbers[b, t], tables[b, t]
            triad_errors(
                out, variates[b, t, begin : begin + n], out, imu_time[b, :n], imu_interval[b, :n],
                (matrix[b, t], bias[b, t], q[0], q[1], q[2]), (instability[b, t, : table[0]], table[1], q[3]),
                (walk[b, t, : table[2]], table[3], q[4]), residual[b, t],
            )  # fmt: skip
        for d in range(disturbed.shape[1]):
            for i in range(n):
                if disturbed[b, d, begin + i]:
                    for j in range(3):
                        rate[b, i, j] += disturbance[b, d, begin + i, j]
                        force[b, i, j] += disturbance[b, d, begin + i, 3 + j]


@kernel
def sense(
    active: FlagVector,
    samples: tuple[IntegerVector, IntegerVector, Matrix, Stack, IntegerMatrix],
    drawn: tuple[Stack, Stack, IntegerStack, Hypermatrix],
    instruments: tuple[IntegerStack, Stack],
    layers: tuple[IntegerVector, IntegerStack, Hypermatrix, Hypermatrix],
    delivered: tuple[IntegerVector, IntegerMatrix, Matrix, Stack, Annotated[NDArray[np.uint32], "uint32[:, ::1]"]],
    truth: Matrix,
) -> None:
    """Compute the measurements of the aiding instruments of b runs, with faults, for one step of each run.

    The random numbers of several steps, a batch of s samples, were drawn in advance.

    Parameters
    ----------
    active : (b,) bool array
        True for each run that is advanced.
    samples : (b,) int, (b,) int, (b, s), (b, m, 14) and (b, s) int arrays
        For each run: index of the first sample of the step within the batch, and index after the last one; times of
        the samples of the batch [s]; true states at the samples of the step; number of the instrument of each sample
        (-1: the end of a step).
    drawn : (b, s, 3), (b, s, 3), (b, s, k) int and (b, s, k, 3) arrays
        Biases and unit variates of each sample; for each of k fault layers, the number of the interval of a sample (-1:
        outside of all intervals, -2: the layer does not affect the instrument), and the error or noise that the layer
        has drawn for the sample.
    instruments : (b, i, 4) int and (b, i, 24) arrays
        For each of i instruments: code of the observed quantity, number of components, and the two numbers of
        `simnav.kinds.Kind.layout`; its parameters, as in `simnav.sensors.observation.observe_one`.
    layers : (b,) int, (b, k, 3) int, (b, i, k, 4) and (b, i, k, 8) arrays
        Number of fault layers; action of each (`simnav.sensors.faults.layer.ADDS`, ...), its first bit, and 1 if each
        interval has a bit of its own; for noise steps the new sigma of an instrument, or the factor on its sigma if it
        is not 0; state of layers that repeat values.
    delivered : tuple of (b, ...) arrays
        Overwritten: ``count``, ``who``, ``when``, ``value`` and ``faults`` of `simnav.simulation.steps.SteppedRuns`.
    truth : (b, 9) array
        Overwritten: position, velocity and attitude at the end of the step.
    """
    first, last, tap_time, taps, owner = samples
    error, white, interval, fault = drawn
    layout, numbers = instruments
    number_of_layers, operations, sizes, held = layers
    count, who, when, value, faults = delivered
    state = np.zeros(15)
    reading, wrong, sigma = np.empty(3), np.empty(3), np.empty(3)
    for b in range(active.size):
        if not active[b]:
            continue
        known = 0
        for t in range(first[b], last[b]):
            tap = taps[b, t - first[b]]
            i = owner[b, t]
            if i < 0:
                for j in range(9):
                    truth[b, j] = tap[j]
                continue
            for j in range(14):
                state[j] = tap[j]
            d, positions, cyclic = layout[b, i, 1], layout[b, i, 2], layout[b, i, 3]
            there = observe_one(layout[b, i, 0], numbers[b, i], state, reading)
            for j in range(d):
                sigma[j] = noise_scalar(numbers[b, i], reading, j)
                wrong[j] = error[b, t, j] + sigma[j] * white[b, t, j]
            if not there:
                continue
            add_error_scalar(positions, cyclic, reading[:d], wrong[:d])
            label = 0
            for k in range(number_of_layers[b]):
                number, what = interval[b, t, k], operations[b, k, 0]
                if number == UNTOUCHED:
                    continue
                touched = number >= 0
                if what == HOLDS:
                    touched = _hold(held[b, i, k], number, reading, d)
                elif what == DROPS:
                    if touched:
                        there = False
                        break
                elif what == ZEROES:
                    if touched:
                        for j in range(d):
                            reading[j] = 0.0
                elif touched:
                    touched = False
                    for j in range(d):
                        wrong[j] = fault[b, t, k, j]
                        touched = touched or wrong[j] != 0.0
                    if touched and what == STEPS_NOISE:
                        for j in range(d):
                            new = sizes[b, i, k, 3] * sigma[j]
                            if sizes[b, i, k, 3] == 0.0:
                                new = max(sigma[j], sizes[b, i, k, j])
                            wrong[j] *= sqrt(new * new - sigma[j] * sigma[j])
                            sigma[j] = new
                    if touched and what in (ADDS, STEPS_NOISE):
                        add_error_scalar(positions, cyclic, reading[:d], wrong[:d])
                if touched:
                    label |= 1 << (operations[b, k, 1] + (number if operations[b, k, 2] else 0))
            if there:
                who[b, known], when[b, known], faults[b, known] = i, tap_time[b, t], label
                for j in range(3):
                    value[b, known, j] = reading[j] if j < d else 0.0
                known += 1
        count[b] = known


@helper
def _hold(held: Array, number: int, reading: Array, d: int) -> bool:
    """Replace a reading within an interval by the last one before it (or the first within). Return whether it did."""
    if number >= 0 and held[NUMBER] != number + 1.0:
        held[NUMBER] = number + 1.0
        for j in range(d):
            held[VALUE + j] = held[LAST + j] if held[HAS_LAST] > 0.0 else reading[j]
    for j in range(d):
        held[LAST + j] = reading[j]
        if number >= 0:
            reading[j] = held[VALUE + j]
    held[HAS_LAST] = 1.0
    return number >= 0
