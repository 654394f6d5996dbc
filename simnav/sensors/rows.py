"""The check of the arrays that a method of an instrument returns."""

from __future__ import annotations

from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from simnav.kinds import Kind
from simnav.sensors.errors import InstrumentError, label_of, raised
from simnav.types import Array, TapStates

__all__ = ["checked_reading", "checked_rows"]


class _Named(Protocol):
    """What the check reads of an instrument."""

    name: str
    kind: str
    definition: Kind


class _Reading(_Named, Protocol):
    """An instrument that is read."""

    def reading(self, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
        """The results of ``observe``, ``noise_sigma`` and ``available``."""
        ...


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


def checked_reading(instrument: _Reading, tap: TapStates) -> tuple[Array, Array, NDArray[np.bool_] | None]:
    """The reading of an instrument. A mistake in it is an error of the instrument, not of the estimator."""
    label = partial(label_of, instrument.name, instrument.kind, type(instrument))
    try:
        value, sigma, there = instrument.reading(tap)
        value = checked_rows(instrument, "observe()", value, tap)
        sigma = checked_rows(instrument, "noise_sigma()", sigma, tap)
        there = None if there is None else np.asarray(there)
    except (InstrumentError, MemoryError):
        raise
    except Exception as error:
        raise raised(label(), type(instrument), error) from error
    n = len(tap.time)
    if there is not None and (there.shape != (n,) or there.dtype != np.bool_):
        raise InstrumentError(
            f"{label()}: available() returned an array of {there.dtype} of shape {there.shape}, where one of bool of "
            f"shape {(n,)} is wanted: an entry for each of {n} times"
        )
    for method, array, wanted, right in (
        ("observe()", value, np.isfinite(value), "finite; where nothing is delivered, available() says so"),
        ("noise_sigma()", sigma, np.isfinite(sigma) & (sigma >= 0.0), "finite and not negative"),
    ):
        wrong = ~wanted.all(axis=1) if there is None else there & ~wanted.all(axis=1)
        if wrong.any():  # the reference of a log may have holes
            wrong &= np.isfinite(np.hstack([tap.position, tap.velocity, tap.attitude])).all(axis=1)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise InstrumentError(
                f"{label()}: {method} returned {array[row].tolist()} at {tap.time[row]:g} s; it should be {right}"
            )
    return value, sigma, there
