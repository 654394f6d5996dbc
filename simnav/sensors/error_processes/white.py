"""White noise beside that of ``sigma``: of some components only, or in proportion to a factor."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from simnav.kinds import Kind
from simnav.sensors.error_processes.process import Act, ErrorProcessSpec, Figure, figure, register_error_process
from simnav.types import Array

__all__ = ["White"]


@register_error_process
class White(ErrorProcessSpec):
    """Independent normal errors. The datasheet adds them to ``sigma``."""

    act: ClassVar[Act] = "white"

    kind: Literal["white"] = "white"
    sigma: Figure = figure("standard deviation")

    def sampled(self, kind: Kind, rng: np.random.Generator) -> _White:
        """See `ErrorProcessSpec.sampled`."""
        return _White(self.sizes("sigma", kind), rng)

    def white(self, kind: Kind) -> Array:
        """See `ErrorProcessSpec.white`."""
        return self.sizes("sigma", kind)


class _White:
    def __init__(self, sigma: Array, rng: np.random.Generator):
        self._sigma, self._rng = sigma, rng

    def sample(self, time: Array) -> Array:
        return self._sigma * self._rng.standard_normal((len(time), len(self._sigma)))
