"""Faults that remove or replace measurements: outage, frozen output, false zero."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from simnav.recording import AidStream
from simnav.sensors.faults.fault import Effect, FaultSpec, register_fault
from simnav.sensors.faults.layer import DROPS, HOLDS, ZEROES, FaultLayer
from simnav.types import KINDS, Array

__all__ = ["FalseZero", "Frozen", "Outage", "ReplacingLayer"]


@register_fault
class Outage(FaultSpec):
    """No measurements are delivered. The times of the missing ones are in ``AidStream.dropped``."""

    effect: ClassVar[Effect] = "missing"
    kind: Literal["outage"] = "outage"

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Outage(self, index, seed, self.key_of_streams(index, occurrence))


class _Outage(FaultLayer):
    operation = DROPS

    def apply(self, stream: AidStream) -> AidStream:
        found = self.activity.locate(stream.time) if self.touches(stream) else None
        if found is None:
            return stream
        keep = np.ones(len(stream.time), dtype=bool)
        keep[found[0]] = False
        dropped = np.sort(np.concatenate([stream.dropped, stream.time[~keep]]), kind="stable")
        kept = {n: getattr(stream, n)[keep] for n in ("time", "value", "faults", "fault_error", "sigma")}
        return AidStream(stream.name, stream.kind, **kept, dropped=dropped)


class ReplacingLayer(FaultLayer):
    """Replaces the measurements within the intervals by other values."""

    def replace_values(
        self, stream: AidStream, rows: NDArray[np.intp], values: Array, interval: NDArray[np.intp]
    ) -> AidStream:
        """Replace the rows of a stream, and label them with the numbers of their intervals."""
        value, faults, fault_error = stream.value.copy(), stream.faults.copy(), stream.fault_error.copy()
        fault_error[rows] += KINDS[stream.kind].difference(values, value[rows])
        value[rows] = values
        faults[rows] |= self.bits(interval)
        return replace(stream, value=value, faults=faults, fault_error=fault_error)


@register_fault
class Frozen(FaultSpec):
    """The instrument repeats its last value before the interval (or its first value within, if there is none)."""

    effect: ClassVar[Effect] = "replaced"
    kind: Literal["frozen"] = "frozen"

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _Frozen(self, index, seed, self.key_of_streams(index, occurrence))


class _Frozen(ReplacingLayer):
    operation = HOLDS

    def __init__(self, spec: FaultSpec, index: int, seed: int, key: str):
        super().__init__(spec, index, seed, key)
        self._last: dict[str, Array] = {}
        self._held: dict[str, tuple[int, Array]] = {}

    def apply(self, stream: AidStream) -> AidStream:
        if not self.touches(stream) or len(stream) == 0:
            return stream
        name, found = stream.name, self.activity.locate(stream.time)
        last = self._last.get(name)
        self._last[name] = stream.value[-1].copy()
        if found is None:
            return stream
        rows, interval = found
        values = np.empty((len(rows), stream.value.shape[1]))
        for number in np.unique(interval):
            here = interval == number
            if name not in self._held or self._held[name][0] != number:
                first = int(rows[here][0])
                before = stream.value[first - 1] if first > 0 else last
                self._held[name] = int(number), (stream.value[first] if before is None else before).copy()
            values[here] = self._held[name][1]
        return self.replace_values(stream, rows, values, interval)


@register_fault
class FalseZero(FaultSpec):
    """The instrument reads zero on all axes, like a DVL that lost bottom lock."""

    effect: ClassVar[Effect] = "replaced"
    kind: Literal["false_zero"] = "false_zero"

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _FalseZero(self, index, seed, self.key_of_streams(index, occurrence))


class _FalseZero(ReplacingLayer):
    operation = ZEROES

    def apply(self, stream: AidStream) -> AidStream:
        found = self.activity.locate(stream.time) if self.touches(stream) else None
        if found is None:
            return stream
        rows, interval = found
        return self.replace_values(stream, rows, np.zeros((len(rows), stream.value.shape[1])), interval)
