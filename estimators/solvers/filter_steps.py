"""Several steps of a compiled filter by one call: what `KalmanEstimator.update` does, step after step."""

from __future__ import annotations

from typing import NamedTuple

from simnav.compiled import kernel
from simnav.estimators.models.filtering import Readings
from simnav.estimators.models.propagation import Samples
from simnav.kernel_types import IntegerVector, Matrix, Stack
from simnav.structures import structure

from .admission import Admitted, Arrivals, admit
from .filter_step import Filter, filter_step
from .step_report import StepReport, end_report, note_readings

__all__ = ["FLAG", "StepStates", "filter_steps"]

#: A reading that was rejected: number of the step, row of its instrument, and time [s].
FLAG = structure(step=int, instrument=int, time=float)


class StepStates(NamedTuple):
    """The filter at the ends of t steps.

    Attributes
    ----------
    numbers : (t, s) array
        The flat state.
    covariances : (t, n, n) array
        Covariance of its error.
    reports : (t, ...) array
        What is reported (`end_report`).
    flags : (k, 3) array
        `FLAG` of each reading that was rejected; k is at least the number of readings.
    """

    numbers: Matrix
    covariances: Stack
    reports: Matrix
    flags: Matrix


@kernel
def filter_steps(
    f: Filter,
    admitted: Admitted,
    report: StepReport,
    arrivals: Arrivals,
    imu: tuple[Samples, IntegerVector],
    readings: Readings,
    since: float,
    states: StepStates,
) -> int:
    """Take the steps of a filter, one after the other; the number of readings that were rejected.

    Parameters
    ----------
    f : Filter
        The filter.
    admitted : Admitted
        What is known of its instruments.
    report : StepReport
        What is reported.
    arrivals : Arrivals
        The readings of the steps.
    imu : Samples, (t + 1,) array of int
        IMU samples of all steps, and the first one of each.
    readings : Readings
        Room for the readings of a step.
    since : float
        Time of the state [s].
    states : StepStates
        Overwritten.
    """
    dynamics, flags, (samples, first) = f.dynamics, 0, imu
    for step in range(arrivals.ends.size):
        until, a, b = arrivals.ends[step], first[step], first[step + 1]
        of_step = Samples(
            samples.time[a:b],
            samples.interval[a:b],
            samples.angular_rate[a:b],
            samples.specific_force[a:b],
            samples.unmeasured[a:b],
        )
        dynamics.next_sample[0] = 0
        count = admit(admitted, dynamics.aids.components, arrivals, step, since, readings)
        filter_step(f, readings, of_step, count, until)
        note_readings(report, readings, count)
        end_report(report, states.reports[step])
        for k in range(count):
            if readings.rejected[k]:
                flag = states.flags[flags].view(FLAG)[0]
                flag.step, flag.instrument, flag.time = step, readings.instrument[k], readings.time[k]
                flags += 1
        for i in range(dynamics.numbers.size):
            states.numbers[step, i] = dynamics.numbers[i]
        for i in range(dynamics.covariance.shape[0]):
            for j in range(dynamics.covariance.shape[0]):
                states.covariances[step, i, j] = dynamics.covariance[i, j]
        since = max(since, until)
    return flags
