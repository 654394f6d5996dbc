"""Fading memory: the covariance is inflated, so that old information has less weight."""

from __future__ import annotations

from math import exp, isnan

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .inflation import inflate_all
from .noise import NoiseAdaptation
from .rules import copied

__all__ = ["FadingMemory", "fading_noise"]

#: Time in which the weight of information decreases by a factor of e [s].
SETTINGS = structure(memory=float)
#: Time of the last reading of any instrument [s]; NaN before the first.
TOGETHER = structure(time=float)


@kernel(passed=True)
def fading_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Inflate P by the time since the last measurement (`FadingMemory`); the noise is the nominal one; 0."""
    copied(prediction.nominal, prediction.noise)
    last, time = common.view(TOGETHER)[0], readings.time[k]
    if not isnan(last.time):
        readings.inflation[k] = exp((time - last.time) / settings.view(SETTINGS)[0].memory)
    last.time = time
    return 0.0


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

    rule = fading_noise
    together = 0
    inflates, inflate = True, inflate_all

    def __init__(self, memory: float = 1000.0):
        if not memory > 0.0:
            raise ValueError(f"memory = {memory:g} s: it must be above 0")
        self.memory = memory

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(SETTINGS, memory=self.memory)

    def begun_together(self) -> Array:
        """As `NoiseAdaptation.begun_together`."""
        return filled(TOGETHER, time=np.nan)
