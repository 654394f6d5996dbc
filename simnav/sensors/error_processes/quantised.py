"""Rounding of readings to the last digit that an instrument delivers."""

from __future__ import annotations

from math import sqrt
from typing import ClassVar, Literal

import numpy as np

from simnav.kinds import Kind
from simnav.sensors.error_processes.process import (
    Act,
    ErrorProcessSpec,
    Figure,
    Sampled,
    figure,
    register_error_process,
)
from simnav.types import Array

__all__ = ["Quantised"]

#: Mean radius of the Earth [m] (IUGG): a step in metres of a latitude or longitude is this many radians.
_RADIUS = 6371008.8


@register_error_process
class Quantised(ErrorProcessSpec):
    """Readings are rounded to multiples of ``step``, after all other errors.

    The datasheet adds step / sqrt(12) to ``sigma``. The step of a latitude or longitude is an angle, as in a sentence
    of NMEA 0183: ``step_m`` over the mean radius of the Earth.
    """

    act: ClassVar[Act] = "rounds"

    kind: Literal["quantised"] = "quantised"
    step: Figure = figure("distance between two readings")

    def sampled(self, kind: Kind, rng: np.random.Generator) -> Sampled | None:
        """See `ErrorProcessSpec.sampled`."""
        return None

    def check(self, kind: Kind) -> None:
        """See `ErrorProcessSpec.check`."""
        super().check(kind)
        if self.proportional_to:
            raise ValueError("proportional_to is of no use to 'quantised'; leave it out")

    def white(self, kind: Kind) -> Array:
        """See `ErrorProcessSpec.white`."""
        return self.sizes("step", kind) / sqrt(12.0)

    def rounded(self, value: Array, kind: Kind) -> Array:
        """See `ErrorProcessSpec.rounded`."""
        step = self.sizes("step", kind)
        positions, _ = kind.layout
        step[: min(positions, 2)] /= _RADIUS
        out = value.copy()
        for k in np.flatnonzero(step):
            out[:, k] = step[k] * np.floor(value[:, k] / step[k] + 0.5)
        return out
