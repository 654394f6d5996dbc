"""The selection and order of the measurements of a step that a solver uses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import attrgetter

from simnav.estimators.models.channels import reading_of
from simnav.types import KINDS, Instruments, Measurement, Measurements

__all__ = ["LATE", "Admission", "together"]

#: A measurement that is older than the state by at most this counts as simultaneous [s].
LATE = 1e-4
_time = attrgetter("time")


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
    skipped : int
        Number of rejected measurements so far.
    """

    def __init__(self, instruments: Instruments, observed: Iterable[str]):
        self._used = dict.fromkeys(observed, float("-inf"))
        self._plausible = {name: KINDS[instruments[name].kind].plausible for name in self._used}
        self.skipped = 0

    def admit(self, measurements: Measurements, since: float) -> list[Measurement]:
        """The measurements of a step to be used by a state of time ``since`` [s], in order of their times."""
        admitted = []
        begin, end, used, plausible = since - LATE, measurements.time + LATE, self._used, self._plausible
        for m in sorted(measurements.aids, key=_time):
            time, name, _, value, channel, _ = m
            if channel:
                m = reading_of(m)
                name = m.instrument
            latest = used.get(name)
            if latest is None:
                continue
            if not begin <= time <= end or time <= latest or not plausible[name](value):
                self.skipped += 1
                continue
            used[name] = time
            admitted.append(m)
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
