"""Chi-square gating, with a recovery after repeated rejections."""

from __future__ import annotations

from simnav.estimators.algebra.chi_square import chi_square_limits
from simnav.estimators.models.channels import ChannelDatasheet
from simnav.types import Array, Instruments

from .base import Innovation
from .noise import NoiseAdaptation, normalised_square

__all__ = ["ChiSquareGate"]


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

    def __init__(self, probability: float = 0.999, patience: float = 10.0):
        if not 0.0 < probability < 1.0:
            raise ValueError(f"probability = {probability:g}: it must lie between 0 and 1")
        if not patience >= 0.0:
            raise ValueError(f"patience = {patience:g} s: it must not be negative")
        self.probability, self.patience = probability, patience

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._limits = chi_square_limits(self.probability)
        self._failing: dict[str, float] = {}
        self._heard: dict[str, float] = {}
        self._owner = {s.name: s.instrument for s in instruments.values() if isinstance(s, ChannelDatasheet)}

    def choose(self, innovation: Innovation) -> Array | None:
        """The nominal noise, or None."""
        nis = normalised_square(innovation.residual, innovation.predicted, innovation.noise)
        name, time = innovation.measurement.instrument, innovation.measurement.time
        self._heard[name] = time
        if nis <= self._limits[len(innovation.residual)]:
            self._failing.pop(name, None)
            return innovation.noise
        since = self._failing.setdefault(name, time)
        return innovation.noise if time - since >= self.patience and self._doubtful(name, time) else None

    def _doubtful(self, name: str, time: float) -> bool:
        """Whether the filter is doubted, and not a channel: most channels of the instrument fail."""
        owner = self._owner.get(name)
        if owner is None:
            return True
        heard = [n for n, last in self._heard.items() if self._owner.get(n) == owner and time - last <= self.patience]
        return 2 * sum(n in self._failing for n in heard) > len(heard)
