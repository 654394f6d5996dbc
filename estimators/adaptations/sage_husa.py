"""Sage-Husa estimation of the measurement noise."""

from __future__ import annotations

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .base import Innovation
from .noise import EstimatedNoise, Scope
from .rules import copied
from .scaled_noise import bound

__all__ = ["SageHusa", "sage_husa_noise"]

#: Forgetting factor, and bounds of the variance ratios.
SETTINGS = structure(fading=float, lowest=float, highest=float)
#: Weight of the estimate [innovations], whether there is one, and its elements.
MEMORY = structure(count=float, begun=int, estimate=9)


@kernel(passed=True)
def sage_husa_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Update the estimate by the recursion of `SageHusa`, and write it into ``noise`` within its bounds; 0."""
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    own, kept = settings.view(SETTINGS)[0], memory.view(MEMORY)[0]
    m = innovation.size
    estimate = kept.estimate[: m * m].reshape((m, m))
    if not kept.begun:
        kept.begun = 1
        copied(nominal, estimate)
    kept.count += 1.0
    b, n = own.fading, kept.count
    d = 1.0 / (n + 1.0) if b == 1.0 else (1.0 - b) / (1.0 - b ** (n + 1.0))
    for i in range(m):
        for j in range(m):
            sample = innovation[i] * innovation[j] - predicted[i, j]
            estimate[i, j] += d * (sample - estimate[i, j])
    bound(estimate, nominal, own.lowest, own.highest, noise)
    return 0.0


class SageHusa(EstimatedNoise):
    """Recursive maximum-a-posteriori estimate of R from all innovations so far, with or without fading.

    Sage and Husa (1969), "Adaptive filtering with unknown prior statistics", Joint Automatic Control Conference;
    Mao, Wang and Fu (2025) compare with it. For the k-th innovation v of an instrument::

        R_k = (1 - d_k) R_(k-1) + d_k (v v' - H P H'),    d_k = (1 - b) / (1 - b^(k + 1)),

    and d_k = 1 / (k + 1) for b = 1; H P H' is the covariance of the prediction. The estimate may become indefinite. The
    recursion continues with it, so that it stays unbiased, and the filter uses the estimate limited to its bounds. Only
    R is estimated: Q and R together are not identifiable from one innovation sequence, and the comparison of Mao, Wang
    and Fu needs R.

    Mao, Wang and Fu do not print b. Their figures agree with a filter without fading (b = 1, the row
    ``sage-husa-paper``); a filter with fading is the fair comparison.

    Parameters
    ----------
    fading : float
        Forgetting factor b, in (0, 1]; 1: no fading. For an instrument of more than 1 Hz it is the factor over 1 s.
    prior : int
        Number of innovations to which the datasheet's noise is equivalent at the start; it fades like them. Of an
        instrument of more than 1 Hz, so many for each hertz.
    """

    rule = sage_husa_noise

    def __init__(
        self,
        fading: float = 0.96,
        prior: int = 10,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "all",
    ):
        super().__init__(lowest, highest, full, scope)
        if not 0.0 < fading <= 1.0:
            raise ValueError(f"fading = {fading:g}: it must lie in (0, 1]")
        if prior < 0:
            raise ValueError(f"prior = {prior}: it must not be negative")
        self.fading, self.prior = fading, prior

    def settings_of(self, per_second: float) -> Array:
        """As `EstimatedNoise.settings_of`."""
        return filled(
            SETTINGS, fading=self.fading ** (1.0 / per_second), lowest=self.lowest**2, highest=self.highest**2
        )

    def begun(self, per_second: float, m: int) -> Array:
        """As `EstimatedNoise.begun`."""
        return filled(MEMORY, count=round(self.prior * per_second))

    def choose(self, innovation: Innovation) -> Array:
        """The bounded estimate of a full matrix, this innovation included."""
        nominal = innovation.noise
        self.ask(sage_husa_noise, innovation, np.empty_like(nominal))
        _, memory = self.memory_of(innovation.measurement.instrument)
        return self.bounded(memory.view(MEMORY)[0].estimate[: nominal.size].reshape(nominal.shape), nominal)
