"""Sage-Husa estimation of the measurement noise."""

from __future__ import annotations

from simnav.compiled import kernel
from simnav.types import Array, Instruments

from .base import Innovation
from .noise import EstimatedNoise, Scope

__all__ = ["SageHusa"]


@kernel("void(f8[:, ::1], f8, f8[::1], f8[:, ::1])")
def _fade(estimate: Array, d: float, innovation: Array, predicted: Array) -> None:
    """Update the estimate by the recursion of `SageHusa`, in place."""
    for i in range(innovation.size):
        for j in range(innovation.size):
            sample = innovation[i] * innovation[j] - predicted[i, j]
            estimate[i, j] += d * (sample - estimate[i, j])


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

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._estimates: dict[str, tuple[int, Array]] = {}

    def estimate(self, innovation: Innovation) -> Array:
        """The bounded estimate, this innovation included."""
        name = innovation.measurement.instrument
        longer = self.longer[name]
        k, estimate = self._estimates.get(name) or (round(self.prior * longer), innovation.noise.copy())
        k += 1
        b = self.fading ** (1.0 / longer)
        d = 1.0 / (k + 1) if b == 1.0 else (1.0 - b) / (1.0 - b ** (k + 1))
        _fade(estimate, d, innovation.residual, innovation.predicted)
        self._estimates[name] = k, estimate
        return self.bounded(estimate, innovation.noise)
