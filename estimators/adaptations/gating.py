"""Chi-square gating, with a recovery after repeated rejections."""

from __future__ import annotations

from math import isnan, nan
from typing import Any

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.models.channels import ChannelDatasheet
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Array, Instruments, Measurement

from .base import Innovation
from .noise import NoiseAdaptation
from .rules import copied

__all__ = ["ChiSquareGate", "gate_noise"]

#: Patience [s], and the limits of chi-square for 0 to 3 components.
SETTINGS = structure(patience=float, limits=4)
#: Time of the last measurement of the instrument [s], and the time since which all have failed; NaN if it has passed.
MEMORY = structure(heard=float, failing=float)


@kernel(passed=True)
def gate_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Make the test of `ChiSquareGate`, without the witnesses among channels; 1 if it fails, else 0."""
    gate, instrument = settings.view(SETTINGS)[0], memory.view(MEMORY)[0]
    copied(prediction.nominal, prediction.noise)
    time = instrument.heard = readings.time[k]
    square = normalised_square(prediction.innovation, prediction.predicted, prediction.nominal)
    if square <= gate.limits[prediction.innovation.size]:
        instrument.failing = nan
        return 0.0
    if isnan(instrument.failing):
        instrument.failing = time
    readings.rejected[k] = not time - instrument.failing >= gate.patience
    return 1.0


class ChiSquareGate(NoiseAdaptation):
    """Rejects a measurement whose normalised innovation squared fails its chi-square test.

    Bar-Shalom, Li and Kirubarajan (2001), section 5.4; Groves (2013), section 17.3.1. With a gate alone a filter with a
    wrong state and a small covariance never recovers, because every good measurement fails the test. So if all
    measurements of an instrument have failed for ``patience`` seconds, the filter is taken as wrong: its measurements
    are used again until one of them passes. The channels of an instrument are witnesses against one another: those of a
    satellite are used again only if more than half of the satellites that are heard fail.

    Parameters
    ----------
    probability : float
        Probability that a good measurement passes the test.
    patience : float
        Time without a passed test after which the measurements of an instrument are used again [s].
    """

    rule = gate_noise

    def __init__(self, probability: float = 0.999, patience: float = 10.0):
        if not 0.0 < probability < 1.0:
            raise ValueError(f"probability = {probability:g}: it must lie between 0 and 1")
        if not patience >= 0.0:
            raise ValueError(f"patience = {patience:g} s: it must not be negative")
        self.probability, self.patience = probability, patience

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        owner = {s.name: s.instrument for s in instruments.values() if isinstance(s, ChannelDatasheet)}
        self._siblings = {name: [n for n in owner if owner[n] == of] for name, of in owner.items()}

    @property
    def ruled(self) -> bool:
        """As `NoiseAdaptation.ruled`; the channels of an instrument are counted in Python."""
        return super().ruled and not self._siblings

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(SETTINGS, patience=self.patience, limits=chi_square_limits(self.probability))

    def begun(self, per_second: float, m: int) -> Array:
        """As `NoiseAdaptation.begun`."""
        return filled(MEMORY, heard=-np.inf, failing=np.nan)

    def choose(self, innovation: Innovation) -> Array | None:
        """The nominal noise, or None."""
        if self.ask(gate_noise, innovation, np.empty_like(innovation.noise)) == 0.0:
            return innovation.noise
        doubted = not self._reading.rejected[0] and self._doubtful(innovation.measurement)
        return innovation.noise if doubted else None

    def _memory(self, name: str) -> Any:
        return self.memory_of(name)[1].view(MEMORY)[0]

    def _doubtful(self, measurement: Measurement) -> bool:
        """Whether the filter is doubted, and not a channel: most channels of the instrument fail."""
        siblings = self._siblings.get(measurement.instrument)
        if siblings is None:
            return True
        heard = [n for n in siblings if measurement.time - self._memory(n).heard <= self.patience]
        return 2 * sum(not isnan(self._memory(n).failing) for n in heard) > len(heard)
