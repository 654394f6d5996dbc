"""An error that is constant in a run, but for its factors: deviation by heading, scale, intercardinal error."""

from __future__ import annotations

from typing import Literal

import numpy as np

from simnav.blocks import StateBlock
from simnav.kinds import Kind
from simnav.sensors.error_processes.process import ErrorProcessSpec, Figure, figure, in_units, register_error_process
from simnav.types import Array

__all__ = ["Constant", "ConstantInRun"]


@register_error_process
class Constant(ErrorProcessSpec):
    """A normal number, drawn once for each run and component, times the factors.

    With the factors ``sin_heading``, ``cos_heading``, ``sin_2heading`` and ``cos_2heading`` the processes are the
    coefficients B, C, D and E of the deviation of a magnetic compass (Bowditch, *The American Practical Navigator*,
    2019, chapter 8). With ``sin_2heading`` and ``roll_squared`` it is the intercardinal rolling error of a gyrocompass
    (same source: it is largest on intercardinal headings, and grows with the square of the roll).
    """

    kind: Literal["constant"] = "constant"
    sigma: Figure = figure("standard deviation over the runs")

    def sampled(self, kind: Kind, rng: np.random.Generator) -> ConstantInRun:
        """See `ErrorProcessSpec.sampled`."""
        sigma = self.sizes("sigma", kind)
        return ConstantInRun(sigma * rng.standard_normal(len(sigma)))

    def block(self, name: str, kind: Kind) -> StateBlock:
        """See `ErrorProcessSpec.block`."""
        sigma = tuple(self.sizes("sigma", kind).tolist())
        return StateBlock(name, len(sigma), in_units(kind), sigma)


class ConstantInRun:
    """A process that has the same (d,) value at all times."""

    def __init__(self, value: Array):
        self._value = value

    def sample(self, time: Array) -> Array:
        """See `Sampled`."""
        return self._value[None].repeat(len(time), axis=0)
