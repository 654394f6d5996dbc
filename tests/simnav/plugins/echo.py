"""A fault of acoustic instruments: single ranges are too long, for what was heard is an echo."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from simnav.kinds import KINDS
from simnav.sensors.faults import AdditiveLayer, FaultSpec, register_fault
from simnav.spec import Positive, SpecError, quantity


@register_fault
class Echo(FaultSpec):
    """With a probability, a range is too long by an exponentially distributed detour."""

    kind: Literal["echo"] = "echo"
    probability: float = Field(ge=0.0, le=1.0)
    detour: Positive = quantity("m", description="mean of what an echo travels further")

    def check(self, instruments, *, imu=True):
        """An instrument that measures no range has no echo."""
        super().check(instruments, imu=imu)
        for name in self.touched(instruments):
            if "range" not in KINDS[instruments[name]].values:
                raise SpecError(f"fault 'echo': {name!r} ({instruments[name]}) measures no range")

    def build(self, index, seed, occurrence=None):
        """The fault of one run."""
        return _Echo(self, index, seed, self.key_of_streams(index, occurrence))


class _Echo(AdditiveLayer):
    def error(self, stream, time, since):
        """(m, d) errors at the times within the fault's intervals; rows of zeros touch nothing."""
        hit = self.rng(stream.name, "occurrence").random(len(time)) < self.spec.probability
        detour = self.rng(stream.name, "detour").exponential(self.spec.detour, len(time))
        error = np.zeros((len(time), stream.value.shape[1]))
        error[:, KINDS[stream.kind].values.index("range")] = np.where(hit, detour, 0.0)
        return error
