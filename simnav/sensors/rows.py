"""The check of the arrays that a method of an instrument returns."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from simnav.kinds import Kind
from simnav.sensors.errors import InstrumentError, label_of
from simnav.types import Array, TapStates

__all__ = ["checked_rows"]


class _Named(Protocol):
    """What the check reads of an instrument."""

    name: str
    kind: str
    definition: Kind


def checked_rows(instrument: _Named, method: str, array: Array, tap: TapStates) -> Array:
    """The result of a method, after a check that it has a row for each time and a column for each component."""
    array = np.asarray(array, dtype=np.float64)
    components = instrument.definition.values
    shape = (len(tap.time), len(components))
    if not len(tap.time) and not array.size:
        return array.reshape(shape)
    if array.shape != shape:
        raise InstrumentError(
            f"{label_of(instrument.name, instrument.kind, type(instrument))}: {method} returned an array of shape "
            f"{array.shape}, where {shape} is wanted: a row for each of {shape[0]} times, a column for each component "
            f"({', '.join(components)})"
        )
    return array
