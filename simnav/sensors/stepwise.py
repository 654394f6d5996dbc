"""One step of the instruments and faults of many runs: the kernels of `simnav.simulation.steps`.

The random numbers of instruments and faults depend on the times of their samples only, so those of several steps of a
run are drawn together. Such steps are a *batch*. The kernels compute what depends on the motion.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simnav.compiled import Array, helper, kernel
from simnav.kernel_types import FlagVector, Hypermatrix, IntegerMatrix, IntegerStack, IntegerVector, Matrix, Stack
from simnav.kinds import add_error_scalar
from simnav.sensors.faults.layer import ADDS, DROPS, HOLDS, STEPS_NOISE, ZEROES
from simnav.sensors.imu import HeldTable, TriadErrors, triad_errors
from simnav.sensors.observation import noise_scalar, observe_one
from simnav.structures import structure
from simnav.true_state import TRUE_STATE

__all__ = [
    "BLOCKS",
    "COMPILED",
    "DUE",
    "HELD",
    "INERTIAL",
    "LAYOUT",
    "NOISE_STEP",
    "OPERATION",
    "UNTOUCHED",
    "AidDraws",
    "BatchProgress",
    "Delivered",
    "FaultLayers",
    "ImuDraws",
    "ImuSteps",
    "SampleTimes",
    "TriadTables",
    "begin_step",
    "sense",
    "sense_imu",
    "sort_out",
]

#: What a reading of an instrument is: the code of the observed quantity, the number of components, and the two numbers
#: of `simnav.kinds.Kind.layout`.
LAYOUT = structure(code=int, components=int, positions=int, cyclic=int)
#: The action of a fault layer (`simnav.sensors.faults.layer.ADDS`, ...), its first bit, and 1 if each interval has a
#: bit of its own.
OPERATION = structure(action=int, first_bit=int, bit_each=int)
#: The noise of a layer that steps it: the new sigma of an instrument, or the factor on its sigma if it is not 0.
NOISE_STEP = structure(sigma=3, factor=float)
#: The state of a layer that repeats values: the last value, and 1 if there is one; the number of the interval, from 1
#: on; the repeated value.
HELD = structure(last=3, has_last=int, number=int, value=3)
#: The truth at the end of a step: the first parts of a `simnav.true_state.TRUE_STATE`.
STEP_END = structure(position=3, velocity=3, attitude=3)
#: Number of the interval of a measurement that a layer does not affect.
UNTOUCHED = -2
#: What `sort_out` finds: a run with only the block form; one that is compiled, with an IMU, at the end of the batch.
BLOCKS, COMPILED, INERTIAL, DUE = 1, 2, 4, 8


class BatchProgress(NamedTuple):
    """What b runs are, and how far they are within their batches.

    Attributes
    ----------
    compiled, has_imu : (b,) bool array
        Whether a run is compiled, and whether it has an IMU.
    at, end : (b,) int array
        Number of its step within the batch, and number of steps in the batch.
    """

    compiled: FlagVector
    has_imu: FlagVector
    at: IntegerVector
    end: IntegerVector


class TriadTables(NamedTuple):
    """The error parameters of the IMUs of b runs; the second axis is gyroscopes, accelerometers.

    Attributes
    ----------
    matrix, bias : (b, 2, 3, 3), (b, 2, 3) array
        As of `simnav.sensors.imu.TriadErrors`.
    density, range, step : (b, 2) array
        As of the same.
    instability_per_second, walk_per_second : (b, 2) array
        Rows a second of the tables of `ImuDraws`.
    residual : (b, 2, 3) array
        Residual of the quantization; updated.
    """

    matrix: Hypermatrix
    bias: Stack
    density: Matrix
    range: Matrix
    step: Matrix
    instability_per_second: Matrix
    walk_per_second: Matrix
    residual: Stack


class ImuDraws(NamedTuple):
    """The random numbers of the IMUs of b runs for a batch of s samples.

    Attributes
    ----------
    variates : (b, 2, s, 3) array
        Unit variates of the samples.
    instability, walk : (b, 2, k, 3) array
        Tables of the in-run biases and of the random walks.
    instability_rows, walk_rows : (b, 2) int array
        Lengths of the tables.
    instability_first, walk_first : (b, 2) int array
        Numbers of their first rows.
    """

    variates: Hypermatrix
    instability: Hypermatrix
    walk: Hypermatrix
    instability_rows: IntegerMatrix
    instability_first: IntegerMatrix
    walk_rows: IntegerMatrix
    walk_first: IntegerMatrix


class ImuSteps(NamedTuple):
    """The IMU samples of a step of b runs.

    Attributes
    ----------
    number : (b,) int array
        Number of samples of each run.
    time, interval : (b, k) array
        Ends of the samples, and their lengths [s].
    angular_rate, specific_force : (b, k, 3) array
        Means over the intervals [rad/s], [m/s^2].
    """

    number: IntegerVector
    time: Matrix
    interval: Matrix
    angular_rate: Stack
    specific_force: Stack


class SampleTimes(NamedTuple):
    """When and where the aiding instruments of b runs measure; a batch has s samples.

    Attributes
    ----------
    first, last : (b,) int array
        Index of the first sample of the step within the batch, and index after the last one.
    time : (b, s) array
        Times of the samples of the batch [s].
    states : (b, m, 15) array
        True states at the samples of the step, each a `simnav.true_state.TRUE_STATE`.
    owner : (b, s) int array
        Number of the instrument of each sample; -1: the end of a step.
    """

    first: IntegerVector
    last: IntegerVector
    time: Matrix
    states: Stack
    owner: IntegerMatrix


class AidDraws(NamedTuple):
    """The random numbers of the aiding instruments and faults of b runs, for a batch of s samples and k fault layers.

    Attributes
    ----------
    error, white : (b, s, 3) array
        Biases and unit variates of each sample.
    interval : (b, s, k) int array
        Number of the interval of a sample in each layer; -1: outside of all intervals; -2: the layer does not affect
        the instrument.
    fault : (b, s, k, 3) array
        The error or noise that the layer has drawn for the sample.
    """

    error: Stack
    white: Stack
    interval: IntegerStack
    fault: Hypermatrix


class FaultLayers(NamedTuple):
    """The fault layers of b runs, at most k for i instruments.

    Attributes
    ----------
    number : (b,) int array
        Number of layers.
    operations : (b, k, 3) int array
        The `OPERATION` of each layer.
    sizes : (b, i, k, 4) array
        The `NOISE_STEP` of each.
    held : (b, i, k, 8) array
        The `HELD` of each; updated.
    """

    number: IntegerVector
    operations: IntegerStack
    sizes: Hypermatrix
    held: Hypermatrix


class Delivered(NamedTuple):
    """The measurements of a step of b runs.

    Attributes
    ----------
    number : (b,) int array
        Number of measurements of each run.
    who : (b, m) int array
        Number of the instrument of each measurement.
    when : (b, m) array
        Time of the measurement [s].
    value : (b, m, 3) array
        What was measured.
    faults : (b, m) uint32 array
        Label: a bit for each fault that affected it.
    """

    number: IntegerVector
    who: IntegerMatrix
    when: Matrix
    value: Stack
    faults: Annotated[NDArray[np.uint32], "uint32[:, ::1]"]


@kernel
def sort_out(
    active: FlagVector,
    runs: BatchProgress,
    which: tuple[FlagVector, FlagVector, FlagVector],
) -> int:
    """Find what each of b runs needs in a step.

    Parameters
    ----------
    active : (b,) bool array
        True for each run that is advanced.
    runs : BatchProgress
        The runs.
    which : three (b,) bool arrays
        Overwritten: the runs that are advanced and compiled; those of them with an IMU; those at the end of the batch.

    Returns
    -------
    int
        `BLOCKS`, `COMPILED`, `INERTIAL` and `DUE`, as far as there is such a run, added.
    """
    compiled, inertial, due = which
    found = 0
    for b in range(active.size):
        compiled[b] = active[b] and runs.compiled[b]
        inertial[b] = compiled[b] and runs.has_imu[b]
        due[b] = compiled[b] and runs.at[b] >= runs.end[b]
        if active[b]:
            found |= COMPILED if runs.compiled[b] else BLOCKS
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
    triads: TriadTables,
    drawn: ImuDraws,
    disturbances: tuple[Annotated[NDArray[np.bool_], "boolean[:, :, ::1]"], Hypermatrix],
    clock: Matrix,
    imu: ImuSteps,
) -> None:
    """Add the errors and disturbances of the IMUs of b runs, for one step of each run.

    The random numbers of several steps, a batch of s samples, were drawn in advance.

    Parameters
    ----------
    active : (b,) bool array
        True for each run that is advanced.
    at : (b,) int array
        Number of the step within the batch.
    triads : TriadTables
        Error parameters of the IMUs.
    drawn : ImuDraws
        Random numbers of the batch.
    disturbances : (b, d, s) bool and (b, d, s, 6) arrays
        True for each sample of the batch that each of d disturbances affects, and the errors that they add.
    clock : (b, 2) array
        Number of the sample before the batch, and number of samples in a second.
    imu : ImuSteps
        Times and intervals are overwritten; the errors are added to angular rates and specific forces, which are ideal.
    """
    variates, instability, walk = drawn.variates, drawn.instability, drawn.walk
    disturbed, disturbance = disturbances
    time, interval, rate, force = imu.time, imu.interval, imu.angular_rate, imu.specific_force
    for b in range(active.size):
        if not active[b]:
            continue
        n = imu.number[b]
        begin = at[b] * n
        for i in range(n):
            time[b, i] = (clock[b, 0] + begin + i + 1) / clock[b, 1]
            interval[b, i] = 1.0 / clock[b, 1]
        for t in range(2):
            out = rate[b, :n] if t == 0 else force[b, :n]
            triad = TriadErrors(
                triads.matrix[b, t], triads.bias[b, t], triads.density[b, t], triads.range[b, t], triads.step[b, t]
            )
            in_run = HeldTable(
                instability[b, t, : drawn.instability_rows[b, t]],
                drawn.instability_first[b, t],
                triads.instability_per_second[b, t],
            )
            walked = HeldTable(
                walk[b, t, : drawn.walk_rows[b, t]], drawn.walk_first[b, t], triads.walk_per_second[b, t]
            )
            triad_errors(
                out,
                variates[b, t, begin : begin + n],
                out,
                time[b, :n],
                interval[b, :n],
                triad,
                in_run,
                walked,
                triads.residual[b, t],
            )
        for d in range(disturbed.shape[1]):
            for i in range(n):
                if disturbed[b, d, begin + i]:
                    for j in range(3):
                        rate[b, i, j] += disturbance[b, d, begin + i, j]
                        force[b, i, j] += disturbance[b, d, begin + i, 3 + j]


@kernel
def sense(
    active: FlagVector,
    samples: SampleTimes,
    drawn: AidDraws,
    instruments: tuple[IntegerStack, Stack],
    layers: FaultLayers,
    delivered: Delivered,
    truth: Matrix,
) -> None:
    """Compute the measurements of the aiding instruments of b runs, with faults, for one step of each run.

    The random numbers of several steps, a batch of s samples, were drawn in advance.

    Parameters
    ----------
    active : (b,) bool array
        True for each run that is advanced.
    samples : SampleTimes
        Times of the samples, and the true states there.
    drawn : AidDraws
        Random numbers of the batch.
    instruments : (b, i, 4) int and (b, i, n) arrays
        For each of i instruments its `LAYOUT` and its `simnav.sensors.observation.INSTRUMENT`.
    layers : FaultLayers
        The faults.
    delivered : Delivered
        Overwritten with the measurements.
    truth : (b, 9) array
        Overwritten: position, velocity and attitude at the end of the step.
    """
    first, last = samples.first, samples.last
    layout, numbers = instruments
    operations, sizes = layers.operations, layers.sizes
    who, when, value, faults = delivered.who, delivered.when, delivered.value, delivered.faults
    reading, wrong, sigma = np.empty(3), np.empty(3), np.empty(3)
    for b in range(active.size):
        if not active[b]:
            continue
        known = 0
        for t in range(first[b], last[b]):
            tap = samples.states[b, t - first[b]]
            i = samples.owner[b, t]
            if i < 0:
                at, end = tap.view(TRUE_STATE)[0], truth[b].view(STEP_END)[0]
                for j in range(3):
                    end.position[j], end.velocity[j], end.attitude[j] = at.position[j], at.velocity[j], at.attitude[j]
                continue
            own = layout[b, i].view(LAYOUT)[0]
            d, positions, cyclic = own.components, own.positions, own.cyclic
            there = observe_one(own.code, numbers[b, i], tap, reading)
            for j in range(d):
                sigma[j] = noise_scalar(numbers[b, i], reading, j)
                wrong[j] = drawn.error[b, t, j] + sigma[j] * drawn.white[b, t, j]
            if not there:
                continue
            add_error_scalar(positions, cyclic, reading[:d], wrong[:d])
            label = 0
            for k in range(layers.number[b]):
                layer = operations[b, k].view(OPERATION)[0]
                number, what = drawn.interval[b, t, k], layer.action
                if number == UNTOUCHED:
                    continue
                touched = number >= 0
                if what == HOLDS:
                    touched = _hold(layers.held[b, i, k].view(HELD)[0], number, reading, d)
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
                        wrong[j] = drawn.fault[b, t, k, j]
                        touched = touched or wrong[j] != 0.0
                    if touched and what == STEPS_NOISE:
                        stepped = sizes[b, i, k].view(NOISE_STEP)[0]
                        for j in range(d):
                            new = stepped.factor * sigma[j]
                            if stepped.factor == 0.0:
                                new = max(sigma[j], stepped.sigma[j])
                            wrong[j] *= sqrt(new * new - sigma[j] * sigma[j])
                            sigma[j] = new
                    if touched and what in (ADDS, STEPS_NOISE):
                        add_error_scalar(positions, cyclic, reading[:d], wrong[:d])
                if touched:
                    label |= 1 << (layer.first_bit + (number if layer.bit_each else 0))
            if there:
                who[b, known], when[b, known], faults[b, known] = i, samples.time[b, t], label
                for j in range(3):
                    value[b, known, j] = reading[j] if j < d else 0.0
                known += 1
        delivered.number[b] = known


@helper
def _hold(held: Any, number: int, reading: Array, d: int) -> bool:
    """Replace a reading within an interval by the last one before it (or the first within). Return whether it did."""
    if number >= 0 and held.number != number + 1:
        held.number = number + 1
        for j in range(d):
            held.value[j] = held.last[j] if held.has_last else reading[j]
    for j in range(d):
        held.last[j] = reading[j]
        if number >= 0:
            reading[j] = held.value[j]
    held.has_last = 1
    return number >= 0
