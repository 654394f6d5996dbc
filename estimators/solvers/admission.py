"""The selection and order of the measurements of a step that a solver uses."""

from __future__ import annotations

from collections.abc import Iterable
from operator import attrgetter

from simnav.estimators.models.channels import reading_of
from simnav.types import KINDS, Instruments, Measurement, Measurements

__all__ = ["LATE", "Admission"]

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
        begin, end = since - LATE, measurements.time + LATE
        for m in sorted(measurements.aids, key=_time):
            if m.channel:
                m = reading_of(m)
            name, time = m.instrument, m.time
            used = self._used.get(name)
            if used is None:
                continue
            if not begin <= time <= end or time <= used or not self._plausible[name](m.value):
                self.skipped += 1
                continue
            self._used[name] = time
            admitted.append(m)
        return admitted
