"""Instruments that compute their readings from those of another instrument of the vessel, faults included."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping

from simnav.recording import AidStream
from simnav.sensors.errors import InstrumentError, label_of, raised
from simnav.sensors.instrument import Instrument
from simnav.types import Array, Datasheet, TapStates

__all__ = ["DerivedInstrument"]


class DerivedInstrument(Instrument):
    """An instrument that reads another one. Its specification names that one (`AidSpec.sources`).

    The other instrument is sampled first, and its faults are applied; then `derive` is called. An instrument of this
    class draws no errors of its own: the figures of its datasheet describe what becomes of those of the other one.
    """

    @abstractmethod
    def derive(self, time: Array, streams: Mapping[str, AidStream], sheets: Mapping[str, Datasheet]) -> AidStream:
        """The readings at the n sample times of this instrument.

        Parameters
        ----------
        time : (n,) array
            Sample times [s].
        streams : mapping of str to AidStream
            The streams of the same block of the instruments that the specification names, with faults.
        sheets : mapping of str to Datasheet
            Their datasheets.
        """

    def observe(self, tap: TapStates) -> Array:
        """A derived instrument does not see the truth."""
        raise NotImplementedError(f"{type(self).__qualname__} reads other instruments; it is called by derive()")

    def derived(self, time: Array, streams: Mapping[str, AidStream], sheets: Mapping[str, Datasheet]) -> AidStream:
        """`derive`, with errors that name the instrument."""
        try:
            return self.derive(time, streams, sheets)
        except (InstrumentError, MemoryError):
            raise
        except Exception as error:
            raise raised(label_of(self.name, self.kind, type(self)), type(self), error) from error
