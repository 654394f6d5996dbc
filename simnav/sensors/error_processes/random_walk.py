"""An error that wanders off without a limit."""

from __future__ import annotations

from math import inf, sqrt
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.blocks import StateBlock
from simnav.kinds import Kind
from simnav.sensors.error_processes.process import ErrorProcessSpec, Figure, figure, in_units, register_error_process
from simnav.sensors.processes import GaussMarkov as Process
from simnav.spec import quantity
from simnav.types import Array

__all__ = ["RandomWalk"]


@register_error_process
class RandomWalk(ErrorProcessSpec):
    """A random walk that starts at 0. Its standard deviation after a time t is sigma sqrt(t / after)."""

    kind: Literal["random_walk"] = "random_walk"
    sigma: Figure = figure("standard deviation after the time `after`")
    after: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = quantity(
        "s", 3600.0, also=("min", "h"), description="time after which the standard deviation is `sigma`"
    )

    def _density(self, kind: Kind) -> Array:
        return self.sizes("sigma", kind) / sqrt(self.after)

    def sampled(self, kind: Kind, rng: np.random.Generator) -> Process:
        """See `ErrorProcessSpec.sampled`."""
        return Process(self._density(kind), inf, rng)

    def block(self, name: str, kind: Kind) -> StateBlock:
        """See `ErrorProcessSpec.block`."""
        density = tuple(self._density(kind).tolist())
        return StateBlock(name, len(density), in_units(kind), 0.0, "random_walk", density)
