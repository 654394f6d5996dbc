"""Coloured noise of second order: an error that swings, like one that follows the waves."""

from __future__ import annotations

from math import pi
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.blocks import StateBlock
from simnav.declared_process import DeclaredProcess
from simnav.kinds import Kind
from simnav.sensors.error_processes.process import ErrorProcessSpec, Figure, figure, in_units, register_error_process
from simnav.sensors.processes import SecondOrder
from simnav.spec import quantity

__all__ = ["GaussMarkov2"]


@register_error_process
class GaussMarkov2(ErrorProcessSpec):
    """A stationary second-order Gauss-Markov process (`simnav.declared_process`).

    With a damping ratio below 1 it swings with about its natural period. With a ratio of 1 it is smooth, and its
    autocorrelation is (1 + w t) exp(-w t) for the natural angular frequency w. Filters take it for a first-order
    process of the same sigma and the same power density at low frequency: correlation time 2 z / w.
    """

    kind: Literal["gauss_markov_2"] = "gauss_markov_2"
    sigma: Figure = figure("standard deviation")
    period: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = quantity(
        "s", also=("min", "h"), description="natural period 2 pi / w"
    )
    damping: Annotated[float, Field(gt=0.0, le=100.0)] = Field(1.0, description="damping ratio z")

    def sampled(self, kind: Kind, rng: np.random.Generator) -> SecondOrder:
        """See `ErrorProcessSpec.sampled`."""
        return SecondOrder(self.sizes("sigma", kind), self.period, self.damping, rng)

    def block(self, name: str, kind: Kind) -> StateBlock:
        """See `ErrorProcessSpec.block`."""
        sigma = tuple(self.sizes("sigma", kind).tolist())
        time = self.damping * self.period / pi
        return StateBlock.stationary(name, len(sigma), in_units(kind), sigma, time)

    def declared(self, name: str, kind: Kind) -> DeclaredProcess:
        """See `ErrorProcessSpec.declared`."""
        return DeclaredProcess(self.block(name, kind), self.period, self.damping, factors=self.factors())
