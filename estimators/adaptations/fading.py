"""Fading memory: the covariance is inflated, so that old information has less weight."""

from __future__ import annotations

from math import exp

from simnav.types import Array, Instruments

from .base import Innovation
from .noise import NoiseAdaptation

__all__ = ["FadingMemory"]


class FadingMemory(NoiseAdaptation):
    """The weight of old information decreases as ``exp(-age/memory)``.

    Simon (2006), section 7.4: ``P <- a^2 F P F' + Q``, with the covariance P, the transition matrix F and the process
    noise Q; here with ``a^2 = exp(dt/memory)`` for the time dt since the last measurement, so that the memory does not
    depend on the number of instruments. P is inflated before a measurement is used.

    Parameters
    ----------
    memory : float
        Time in which the weight of information decreases by a factor of e [s].
    """

    together = 0
    inflates = True

    def __init__(self, memory: float = 1000.0):
        if not memory > 0.0:
            raise ValueError(f"memory = {memory:g} s: it must be above 0")
        self.memory = memory

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._time: float | None = None

    def choose(self, innovation: Innovation) -> Array:
        """The nominal noise."""
        time = innovation.measurement.time
        self.inflation = exp((time - self._time) / self.memory) if self._time is not None else 1.0
        self._time = time
        return innovation.noise
