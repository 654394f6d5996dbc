"""White noise with heavy tails: most errors are small, and a few are many times larger."""

from __future__ import annotations

from math import sqrt
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from simnav.kinds import Kind
from simnav.sensors.error_processes.process import Act, ErrorProcessSpec, Figure, figure, register_error_process
from simnav.types import Array

__all__ = ["HeavyTailed"]


@register_error_process
class HeavyTailed(ErrorProcessSpec):
    """Independent errors with Student's t distribution. The datasheet adds them to ``sigma``.

    ``sigma`` is the standard deviation, not the scale. The excess kurtosis is 6 / (degrees_of_freedom - 4), and
    infinite for 4 degrees of freedom or less.
    """

    act: ClassVar[Act] = "white"

    kind: Literal["heavy_tailed"] = "heavy_tailed"
    sigma: Figure = figure("standard deviation")
    degrees_of_freedom: Annotated[float, Field(gt=2.0, le=100.0)] = 4.0

    def sampled(self, kind: Kind, rng: np.random.Generator) -> _Student:
        """See `ErrorProcessSpec.sampled`."""
        return _Student(self.sizes("sigma", kind), self.degrees_of_freedom, rng)

    def white(self, kind: Kind) -> Array:
        """See `ErrorProcessSpec.white`."""
        return self.sizes("sigma", kind)


class _Student:
    def __init__(self, sigma: Array, freedom: float, rng: np.random.Generator):
        self._scale, self._freedom, self._rng = sigma * sqrt((freedom - 2.0) / freedom), freedom, rng

    def sample(self, time: Array) -> Array:
        return self._scale * self._rng.standard_t(self._freedom, (len(time), len(self._scale)))
