"""Errors of a gyrocompass that die away as its axis settles on the meridian: after the start, and after a turn."""

from __future__ import annotations

from math import pi
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.blocks import StateBlock
from simnav.declared_process import DeclaredProcess, Factor, oscillation
from simnav.kinds import Kind
from simnav.sensors.error_processes.constant import ConstantInRun
from simnav.sensors.error_processes.process import ErrorProcessSpec, Figure, figure, in_units, register_error_process
from simnav.spec import Positive, quantity
from simnav.types import Array

__all__ = ["Ballistic", "Settling"]

#: Period of a gyrocompass that a change of speed does not disturb, 2 pi sqrt(R / g) [s], and the damping ratio at which
#: each swing is a third of the one before (Bowditch 2019, chapter 8: damping of a gyrocompass).
SCHULER, DAMPING = 5064.0, 0.33


@register_error_process
class Settling(ErrorProcessSpec):
    """An error at the start of the run that dies away as a damped oscillation: a gyrocompass that is not settled yet.

    Filters take it for a first-order process with the time constant of the decay.
    """

    kind: Literal["settling"] = "settling"
    sigma: Figure = figure("standard deviation at the start of the run")
    period: Positive = quantity("s", SCHULER, also=("min", "h"), description="natural period")
    damping: Annotated[float, Field(gt=0.0, le=100.0)] = Field(DAMPING, description="damping ratio")

    def sampled(self, kind: Kind, rng: np.random.Generator) -> _Settling:
        """See `ErrorProcessSpec.sampled`."""
        sigma = self.sizes("sigma", kind)
        return _Settling(sigma * rng.standard_normal(len(sigma)), self.period, self.damping)

    def block(self, name: str, kind: Kind) -> StateBlock:
        """See `ErrorProcessSpec.block`."""
        return _decaying(self, name, kind, self.period, self.damping)

    def declared(self, name: str, kind: Kind) -> DeclaredProcess:
        """See `ErrorProcessSpec.declared`."""
        block = self.block(name, kind)
        return DeclaredProcess(block, self.period, self.damping, driven=False, factors=self.factors())


@register_error_process
class Ballistic(ErrorProcessSpec):
    """The ballistic error of a gyrocompass: a change of the north velocity throws the axis off, and it settles again.

    The error jumps by c dv / (speed_change cos(latitude)) where the north velocity changes by dv, and dies away as a
    damped oscillation. The constant c is drawn for each run with the standard deviation ``sigma``. The precession of
    the axis during a change of speed is the change of the speed-and-course error, dv / (R w cos(latitude)), times the
    square of the Schuler period over that of the compass; what is too much or too little is the ballistic error
    (Bowditch 2019, chapter 8: ballistic deflection). A compass of 84.4 minutes at its latitude has none.
    """

    kind: Literal["ballistic"] = "ballistic"
    sigma: Figure = figure("standard deviation of the error after a change of the north velocity by `speed_change`")
    speed_change: Positive = quantity("m_s", 10.0, also=("kn",), description="change of the north velocity")
    period: Positive = quantity("s", SCHULER, also=("min", "h"), description="natural period")
    damping: Annotated[float, Field(gt=0.0, le=100.0)] = Field(DAMPING, description="damping ratio")

    def factors(self) -> tuple[Factor, ...]:
        """See `ErrorProcessSpec.factors`."""
        own = Factor("ballistic", self.speed_change, {"period": self.period, "damping": self.damping})
        return (own, *super().factors())

    def sampled(self, kind: Kind, rng: np.random.Generator) -> ConstantInRun:
        """See `ErrorProcessSpec.sampled`."""
        sigma = self.sizes("sigma", kind)
        return ConstantInRun(sigma * rng.standard_normal(len(sigma)))

    def block(self, name: str, kind: Kind) -> StateBlock:
        """See `ErrorProcessSpec.block`."""
        return _decaying(self, name, kind, self.period, self.damping)

    def declared(self, name: str, kind: Kind) -> DeclaredProcess:
        """See `ErrorProcessSpec.declared`; the process itself is a constant."""
        sigma = tuple(self.sizes("sigma", kind).tolist())
        exact = StateBlock(name, len(sigma), in_units(kind), sigma)
        return DeclaredProcess(self.block(name, kind), factors=self.factors(), exact=exact)


def _decaying(spec: ErrorProcessSpec, name: str, kind: Kind, period: float, damping: float) -> StateBlock:
    """A first-order process with the decay of a damped oscillation, whose time constant is 1 / (z w)."""
    sigma = tuple(spec.sizes("sigma", kind).tolist())
    return StateBlock.stationary(name, len(sigma), in_units(kind), sigma, period / (2.0 * pi * damping))


class _Settling:
    def __init__(self, value: Array, period: float, damping: float):
        self._value, self._frequency, self._damping = value, 2.0 * pi / period, damping

    def sample(self, time: Array) -> Array:
        share = [oscillation(max(t, 0.0), self._frequency, self._damping).value_by_value for t in time.tolist()]
        return np.outer(share, self._value)
