"""The selection and order of the measurements of a step that a solver uses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.models.channels import reading_of
from simnav.estimators.models.filtering import Readings
from simnav.kernel_types import IntegerVector, Matrix, Vector
from simnav.records import Record
from simnav.types import KINDS, Instruments, Measurement, Measurements

__all__ = ["LATE", "Admission", "Admitted", "Arrivals", "admit", "is_usable", "together"]

#: A measurement that is older than the state by at most this counts as simultaneous [s].
LATE = 1e-4
_time = attrgetter("time")


class Arrivals(NamedTuple):
    """The readings of t steps as they arrive.

    Attributes
    ----------
    ends : (t,) array
        End of each step [s].
    first : (t + 1,) array of int
        Index of the first reading of each step, and the number of readings.
    instrument : (k,) array of int
        Row of the instrument of each; -1 for one that is not observed.
    time : (k,) array
        Time of validity [s]; in order within a step.
    value : (k, 3) array
        What was measured.
    """

    ends: Vector
    first: IntegerVector
    instrument: IntegerVector
    time: Vector
    value: Matrix


class Admitted(Record):
    """What is known of i instruments whose readings are admitted.

    Attributes
    ----------
    latest : (i,) array
        Time of the last reading that was admitted [s].
    limits : (i, 3) array
        The value is plausible between the limit and its negative.
    skipped : (1,) array
        Number of readings so far that could not be used.
    """

    latest: Vector
    limits: Matrix
    skipped: Vector


@helper
def is_usable(time: float, value: Any, latest: float, limits: Any, begin: float, end: float) -> bool:
    """Whether a reading is in time, later than the last one of its instrument, and plausible.

    Parameters
    ----------
    time : float
        Time of validity [s].
    value : array or list
        What was measured, its d components first.
    latest : float
        Time of the last reading of the instrument that was used [s].
    limits : array or list
        Each of the d components is plausible between its limit and the negative of it (`simnav.kinds.Kind.limits`).
    begin, end : float
        The first and the last time that are usable [s].
    """
    usable = begin <= time <= end and time > latest
    for a in range(len(limits)):
        usable = usable and -limits[a] < value[a] < limits[a]
    return usable


@kernel
def admit(
    admitted: Admitted, components: IntegerVector, arrivals: Arrivals, step: int, since: float, readings: Readings
) -> int:
    """Write the readings of a step that are to be used into others, as `Admission.admit` does; their number.

    Parameters
    ----------
    admitted : Admitted
        Updated.
    components : (i,) array of int
        Number of components that the model predicts of each instrument.
    arrivals : Arrivals
        What arrives.
    step : int
        Number of the step.
    since : float
        Time of the state [s].
    readings : Readings
        Room for all readings of the step.
    """
    begin, end, count = since - LATE, arrivals.ends[step] + LATE, 0
    for k in range(arrivals.first[step], arrivals.first[step + 1]):
        row, time = arrivals.instrument[k], arrivals.time[k]
        if row < 0:
            continue
        if not is_usable(time, arrivals.value[k], admitted.latest[row], admitted.limits[row], begin, end):
            admitted.skipped[0] += 1.0
            continue
        admitted.latest[row] = time
        readings.instrument[count], readings.components[count], readings.time[count] = row, components[row], time
        for a in range(3):
            readings.value[count, a] = arrivals.value[k, a]
        count += 1
    return count


class Admission:
    """Selects the usable measurements: of known instruments, plausible, not older than the state, each only once.

    The reading of a channel becomes a measurement of an instrument of its own.

    Parameters
    ----------
    instruments : Instruments
        Datasheets of the run's instruments, channel by channel (`simnav.estimators.models.channels.by_channel`).
    observed : iterable of str
        Names of the instruments that the model uses. Measurements of others are ignored and not counted.

    Attributes
    ----------
    record : Admitted
        What it knows, for `admit`.
    """

    def __init__(self, instruments: Instruments, observed: Iterable[str]):
        self._rows = {name: row for row, name in enumerate(observed)}
        kinds = [KINDS[instruments[name].kind] for name in self._rows]
        self._limits = [kind.limits for kind in kinds]
        limits = np.full((len(kinds), 3), np.inf)
        for row, kind in enumerate(kinds):
            limits[row, : len(kind.limits)] = kind.limits[:3]
        self.record = Admitted(latest=np.full(len(kinds), -np.inf), limits=limits, skipped=np.zeros(1))

    @property
    def skipped(self) -> float:
        """Number of rejected measurements so far."""
        return float(self.record.skipped[0])

    @skipped.setter
    def skipped(self, count: float) -> None:
        self.record.skipped[0] = count

    def admit(self, measurements: Measurements, since: float) -> list[Measurement]:
        """The measurements of a step to be used by a state of time ``since`` [s], in order of their times."""
        admitted = []
        begin, end, rows, latest = since - LATE, measurements.time + LATE, self._rows, self.record.latest.tolist()
        usable = is_usable.function
        for m in sorted(measurements.aids, key=_time):
            reading = reading_of(m) if m.channel else m
            row, time = rows.get(reading.instrument), m.time
            if row is None:
                continue
            if not usable(time, m.value.tolist(), latest[row], self._limits[row], begin, end):
                self.skipped += 1
                continue
            latest[row] = time
            admitted.append(reading)
        self.record.latest[:] = latest
        return admitted


def together(measurements: Iterable[Measurement], owner: Mapping[str, str]) -> list[list[Measurement]]:
    """Measurements in groups: those of the channels of one instrument at one time are one group.

    Parameters
    ----------
    measurements : iterable of Measurement
        In the order of `Admission.admit`.
    owner : mapping of str to str
        The instrument of each channel (`simnav.estimators.models.channels.owners`).
    """
    groups: list[list[Measurement]] = []
    instrument, time = None, 0.0
    for m in measurements:
        whose = owner.get(m.instrument)
        if whose is not None and whose == instrument and m.time == time:
            groups[-1].append(m)
        else:
            groups.append([m])
            instrument, time = whose, m.time
    return groups
