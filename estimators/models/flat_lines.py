"""The flat-line test: an IMU that repeats a value, or whose specific force is zero, does not measure.

A sensor has noise, so two samples of an axis are never quite equal. An axis that repeats its value is stuck, saturated,
or held by a logger. A value at the end of the range of its datasheet is saturated, too. An IMU whose specific force is
zero on all axes gives nothing: at sea it always measures gravity. Such values are replaced. They go back from the last
measured value to the mean of the axis, and the process noise of the axis grows
(`simnav.estimators.models.propagation`). All other samples stay as they are, bit for bit.

An axis that often repeats its value is not tested: its resolution is coarse, its logger is faster than the IMU, or it
is simulated without noise. It is known by its first samples, so an axis that is stuck from the start is not found. Nor
is one that is stuck and noisy. An axis that has no noise by its datasheet is not tested, either.

The flat-line test is a standard test of ocean observations: U.S. Integrated Ocean Observing System, "Manual for
Real-Time Quality Control of In-situ Temperature and Salinity Data", test 8 of QARTOD.
"""

from __future__ import annotations

from math import exp

import numpy as np

from simnav.compiled import kernel, ready
from simnav.kernel_types import FlagVector, Matrix, Vector
from simnav.structures import filled, structure
from simnav.types import Array, ImuDatasheet, ImuSamples

from .propagation import HELD_ATTITUDE, HELD_VELOCITY, LARGEST_FORCE, LARGEST_RATE, NO_SAMPLES, Samples

__all__ = ["AXES", "FLAT_LINE_MEMORY", "REPETITIONS", "FlatLineTest", "replace_flat_lines"]

#: Axes of an IMU: three gyroscopes and three accelerometers.
AXES = 6
#: A value that is repeated so many times is a flat line.
REPETITIONS = 5
#: An axis is tested if at most this share of its samples repeats the one before. The share is averaged over the second
#: number of samples, and known from the third on.
LARGEST_SHARE, SHARE_SAMPLES, FIRST_SAMPLES = 0.01, 10_000, 200
#: Time in which a replaced value goes back to the mean, and time over which the mean is taken [s].
RETURN_TIME, MEAN_TIME = 1.0, 60.0

#: What the test remembers: the number of samples; and of each axis the last value of the IMU, how often it is repeated,
#: how long the axis has not measured [s], the share of samples that repeat the one before, the last measured value, and
#: the mean.
FLAT_LINE_MEMORY = structure(
    samples=int, last=AXES, repetitions=AXES, unmeasured_time=AXES, share=AXES, measured=AXES, average=AXES
)


@kernel
def replace_flat_lines(
    memory: Vector,
    tested: FlagVector,
    ranges: Vector,
    interval: Vector,
    rate: Matrix,
    force: Matrix,
    unmeasured: Matrix,
) -> None:
    """Replace the values that an IMU did not measure, in place.

    Parameters
    ----------
    memory : array
        A `FLAT_LINE_MEMORY`; updated.
    tested : (6,) array of bool
        The axes that have noise, gyroscopes first.
    ranges : (6,) array
        The sizes at which they saturate [rad/s], [m/s^2].
    interval : (k,) array
        Lengths of the samples [s].
    rate, force : (k, 3) arrays
        Angular rates [rad/s] and specific forces [m/s^2]; updated.
    unmeasured : (k, 6) array
        Overwritten: the noise density of the values that are replaced, 0 of the others [rad^2/s], [m^2/s^3].
    """
    own = memory.view(FLAT_LINE_MEMORY)[0]
    last, repetitions, missing, share = own.last, own.repetitions, own.unmeasured_time, own.share
    measured, average = own.measured, own.average
    for k in range(interval.size):
        own.samples += 1
        nothing = force[k, 0] == 0.0 and force[k, 1] == 0.0 and force[k, 2] == 0.0
        newest, enough = 1.0 / min(own.samples, SHARE_SAMPLES), own.samples > FIRST_SAMPLES
        weight = max(newest, min(1.0, interval[k] / MEAN_TIME))
        for axis in range(AXES):
            values, column = (rate, axis) if axis < 3 else (force, axis - 3)
            value = values[k, column]
            unmeasured[k, axis] = 0.0
            if not (tested[axis] and abs(value) < (LARGEST_RATE if axis < 3 else LARGEST_FORCE)):  # or it is NaN
                continue
            known = enough and share[axis] <= LARGEST_SHARE
            repeats = own.samples > 1 and value == last[axis]
            last[axis] = value
            repetitions[axis] = repetitions[axis] + 1.0 if repeats else 0.0
            missing[axis] = missing[axis] + interval[k] if repeats or nothing else 0.0
            flat = known and repetitions[axis] >= REPETITIONS
            if not flat:
                share[axis] += newest * ((1.0 if repeats else 0.0) - share[axis])
            elif repetitions[axis] == REPETITIONS:  # those before belong to the flat line, too
                share[axis] = max(0.0, share[axis] - (REPETITIONS - 1) * newest)
            if nothing or flat or abs(value) >= ranges[axis]:
                away, held = measured[axis] - average[axis], HELD_ATTITUDE if axis < 3 else HELD_VELOCITY
                unmeasured[k, axis] = held * held
                values[k, column] = average[axis] + away * exp(-missing[axis] / RETURN_TIME)
            else:
                measured[axis] = value
                average[axis] += weight * (value - average[axis])


class FlatLineTest:
    """The flat-line test of the samples of one IMU, in the order in which they come.

    Parameters
    ----------
    imu : ImuDatasheet
        Its datasheet.

    Attributes
    ----------
    memory : array
        A `FLAT_LINE_MEMORY`.
    """

    def __init__(self, imu: ImuDatasheet):
        self.memory: Array = filled(FLAT_LINE_MEMORY)
        triads = imu.gyroscope, imu.accelerometer
        self._tested = np.repeat([triad.random_walk > 0.0 for triad in triads], 3)
        self._ranges = np.repeat([triad.range for triad in triads], 3)

    def samples(self, imu: ImuSamples | None) -> Samples:
        """The samples of a step; what the IMU did not measure is replaced."""
        if imu is None or len(imu) == 0:
            return NO_SAMPLES
        interval, rate, force = ready(imu.interval), ready(imu.angular_rate).copy(), ready(imu.specific_force).copy()
        unmeasured = np.empty((len(imu), AXES))
        replace_flat_lines.unchecked(self.memory, self._tested, self._ranges, interval, rate, force, unmeasured)
        return Samples(ready(imu.time), interval, rate, force, unmeasured)
