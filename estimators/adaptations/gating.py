"""Chi-square gating, with a recovery after repeated rejections."""

from __future__ import annotations

from math import isnan, nan

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.algebra.direct_update import normalised_square
from simnav.estimators.models.channels import ChannelDatasheet
from simnav.estimators.models.filtering import Prediction
from simnav.kernel_types import Vector
from simnav.types import Array, Instruments, Measurement

from .base import Innovation
from .noise import NoiseAdaptation
from .rules import REJECT, TIME, copied

__all__ = ["ChiSquareGate", "gate_noise"]

#: Places in the settings: patience [s], and the limits of chi-square for 0 to 3 components; in the memory: time of the
#: last measurement of the instrument, and the time since which all have failed, NaN if the last one has passed.
PATIENCE, LIMITS = range(2)
HEARD, FAILING = range(2)


@kernel(passed=True)
def gate_noise(settings: Vector, memory: Vector, shared: Vector, prediction: Prediction) -> float:
    """Make the test of `ChiSquareGate`, without the witnesses among channels; 1 if it fails, else 0."""
    copied(prediction.nominal, prediction.noise)
    time = memory[HEARD] = shared[TIME]
    square = normalised_square(prediction.innovation, prediction.predicted, prediction.nominal)
    if square <= settings[LIMITS + prediction.innovation.size]:
        memory[FAILING] = nan
        return 0.0
    if isnan(memory[FAILING]):
        memory[FAILING] = time
    if not time - memory[FAILING] >= settings[PATIENCE]:
        shared[REJECT] = 1.0
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

    def settings_of(self, longer: float) -> list[float]:
        """As `NoiseAdaptation.settings_of`."""
        return [self.patience, *chi_square_limits(self.probability)]

    def begun(self, longer: float, m: int) -> Array:
        """As `NoiseAdaptation.begun`."""
        return np.array([-np.inf, np.nan])

    def choose(self, innovation: Innovation) -> Array | None:
        """The nominal noise, or None."""
        if self.ask(gate_noise, innovation, np.empty_like(innovation.noise)) == 0.0:
            return innovation.noise
        doubted = self.rule_shared[REJECT] == 0.0 and self._doubtful(innovation.measurement)
        return innovation.noise if doubted else None

    def _fails(self, name: str) -> bool:
        since: float = self.memory_of(name)[1][FAILING]
        return since == since

    def _doubtful(self, measurement: Measurement) -> bool:
        """Whether the filter is doubted, and not a channel: most channels of the instrument fail."""
        siblings = self._siblings.get(measurement.instrument)
        if siblings is None:
            return True
        heard = [n for n in siblings if measurement.time - self.memory_of(n)[1][HEARD] <= self.patience]
        return 2 * sum(map(self._fails, heard)) > len(heard)
