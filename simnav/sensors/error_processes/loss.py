"""Readings that are lost in bursts, like those of a Doppler log in the bubbles that waves bring under the hull."""

from __future__ import annotations

from math import exp
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from simnav.kinds import Kind
from simnav.sensors.error_processes.process import Act, ErrorProcessSpec, Mask, Sampled, register_error_process
from simnav.spec import Positive, quantity
from simnav.types import Array

__all__ = ["Loss"]

#: No more than this share of the readings is lost, whatever the factors are.
_MOST = 0.98


@register_error_process
class Loss(ErrorProcessSpec):
    """Readings are lost in bursts: a Markov chain of two states, lost and delivered.

    ``probability`` is the share of lost readings in the long run where the factors are 1; it is multiplied with them
    (aeration: ``proportional_to = { wave_height_m = 2.0 }``). The lengths of the bursts are exponentially distributed
    with the mean ``mean``. Estimators see that a reading is missing, so the datasheet does not have the process.
    """

    act: ClassVar[Act] = "loses"

    kind: Literal["loss"] = "loss"
    probability: Annotated[float, Field(ge=0.0, le=1.0)] = Field(description="share of readings that are lost")
    mean: Positive = quantity("s", 5.0, description="mean length of a burst")

    def check(self, kind: Kind) -> None:
        """See `ErrorProcessSpec.check`."""
        super().check(kind)
        if self.components:
            raise ValueError("components is of no use to 'loss', which loses whole readings; leave it out")

    def sampled(self, kind: Kind, rng: np.random.Generator) -> Sampled | None:
        """See `ErrorProcessSpec.sampled`."""
        return None

    def lost(self, time: Array, factor: Array, rng: np.random.Generator, state: dict[str, float]) -> Mask:
        """See `ErrorProcessSpec.lost`."""
        drawn = rng.random(len(time)).tolist()
        mask = np.zeros(len(time), dtype=np.bool_)
        lost, last = bool(state.get("lost", 0.0)), state.get("time")
        for k, (t, f) in enumerate(zip(time.tolist(), factor.tolist(), strict=True)):
            share = min(abs(self.probability * f), _MOST)
            stays = 0.0 if last is None else exp(-(t - last) / (self.mean * (1.0 - share)))
            # The chance of the state at t given that before: it forgets with the rate of leaving plus that of entering.
            lost = drawn[k] < share + (float(lost) - share) * stays
            mask[k], last = lost, t
        if last is not None:
            state["lost"], state["time"] = float(lost), last
        return mask
