"""Coloured noise of first order: its autocorrelation decays exponentially."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from simnav.blocks import StateBlock
from simnav.kinds import Kind
from simnav.sensors.error_processes.process import ErrorProcessSpec, Figure, figure, in_units, register_error_process
from simnav.sensors.processes import GaussMarkov as Process
from simnav.spec import quantity

__all__ = ["GaussMarkov"]


@register_error_process
class GaussMarkov(ErrorProcessSpec):
    """A stationary first-order Gauss-Markov process, with the autocorrelation exp(-t / correlation_time)."""

    kind: Literal["gauss_markov"] = "gauss_markov"
    sigma: Figure = figure("standard deviation")
    correlation_time: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] = quantity(
        "s", also=("min", "h"), description="time after which the autocorrelation is 1/e"
    )

    def sampled(self, kind: Kind, rng: np.random.Generator) -> Process:
        """See `ErrorProcessSpec.sampled`."""
        return Process(self.sizes("sigma", kind), self.correlation_time, rng)

    def block(self, name: str, kind: Kind) -> StateBlock:
        """See `ErrorProcessSpec.block`."""
        sigma = tuple(self.sizes("sigma", kind).tolist())
        return StateBlock.stationary(name, len(sigma), in_units(kind), sigma, self.correlation_time)
