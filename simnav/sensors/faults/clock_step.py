"""A fault of the clock of an instrument: a step of its time stamps."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from simnav.recording import AidStream
from simnav.sensors.faults.fault import Effect, FaultSpec, register_fault
from simnav.sensors.faults.layer import FaultLayer
from simnav.spec import quantity

__all__ = ["ClockStep"]


@register_fault
class ClockStep(FaultSpec):
    """The time stamps jump by a constant. The values, and when they arrive, are right.

    Each reading keeps its true time of validity in the recording. The fault adds no error to its value.
    """

    effect: ClassVar[Effect] = "other"
    kind: Literal["clock_step"] = "clock_step"
    step: float = quantity("s", description="added to the stamps; positive: they are too late")

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if self.step == 0.0:
            raise ValueError("step_s = 0: should be another number; a step of zero is no fault")
        if self.channels:
            raise ValueError("channels: all channels of an instrument have one clock; leave them out")
        return self

    def build(self, index: int, seed: int, occurrence: int | None = None) -> FaultLayer:
        """See `FaultSpec.build`."""
        return _ClockStep(self, index, seed, self.key_of_streams(index, occurrence))


class _ClockStep(FaultLayer):
    spec: ClockStep
    #: After all others, which see the times of validity only.
    last = True

    def laid_over(self, stream: AidStream) -> AidStream:
        """As `FaultLayer.laid_over`, for all channels at once: they have one clock."""
        return self._applied(stream) if self.touches(stream) else stream

    def apply(self, stream: AidStream) -> AidStream:
        found = self.activity.locate(stream.time) if self.touches(stream) else None
        if found is None:
            return stream
        rows, interval = found
        stamp, faults = np.array(stream.stamps), stream.faults.copy()
        stamp[rows] += self.spec.step
        faults[rows] |= self.bits(interval)
        return replace(stream, stamp=stamp, faults=faults)
