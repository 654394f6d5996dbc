"""Variational-Bayes estimation of the measurement noise."""

from __future__ import annotations

from estimators.adaptations.base import Innovation
from estimators.adaptations.noise import EstimatedNoise, Posterior, Scope, scaled
from simnav.types import Array, Instruments

__all__ = ["VariationalBayes"]


class VariationalBayes(EstimatedNoise):
    """State and noise variances estimated together: inverse-gamma distributed variances that slowly forget.

    Sarkka and Nummenmaa (2009), "Recursive noise adaptive Kalman filtering by variational Bayesian approximations",
    IEEE Trans. Automatic Control 54(3), algorithm 1. Component i of an instrument has variance ~ inverse gamma(a,
    b_i)::

        a  <- rho a + 1/2,    b_i- = rho b_i
        repeat:  R = diag(b_i / a);  update with R;  b_i = b_i- + 1/2 (e_i^2 + (H P+ H')_ii)

    with e the residual after the update. Small state errors and a large residual together let R grow at once, within
    the same epoch: a gross error is given little weight without a test. The variances are kept in units of the
    nominal R, whose correlations stay.

    Parameters
    ----------
    forgetting : float
        rho, in (0, 1]: the memory is 1/(1 - rho) measurements.
    prior : float
        How many measurements the datasheet's noise counts for at the start.
    iterations : int
        At least 1.
    lowest, highest, scope
        See `EstimatedNoise`.
    """

    def __init__(
        self,
        forgetting: float = 0.96,
        prior: float = 10.0,
        iterations: int = 2,
        lowest: float = 1.0,
        highest: float = 30.0,
        scope: Scope = "fixes",
    ):
        super().__init__(lowest, highest, scope=scope)
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting = {forgetting:g}: it must lie in (0, 1]")
        if not prior > 0.0:
            raise ValueError(f"prior = {prior:g}: it must be above 0")
        if iterations < 1:
            raise ValueError(f"iterations = {iterations}: it must be at least 1")
        self.forgetting, self.prior, self.iterations = forgetting, prior, iterations

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._gammas: dict[str, tuple[float, list[float]]] = {}

    def estimate(self, innovation: Innovation) -> Array:
        """The noise of the last iteration, bounded."""
        name, nominal = innovation.measurement.instrument, innovation.noise
        variances = nominal.diagonal().tolist()
        shape, scales = self._gammas.get(name) or (0.5 * self.prior, [0.5 * self.prior] * len(variances))
        before = [self.forgetting * b for b in scales]
        shape = self.forgetting * shape + 0.5
        # The first update uses what was known before this measurement.
        noise = self._noise(nominal, [b / (shape - 0.5) for b in before])
        for _ in range(self.iterations):
            after = Posterior(innovation, noise)
            residual, predicted = after.residual.tolist(), after.predicted.diagonal().tolist()
            scales = [b + 0.5 * (e * e + p) / r for b, e, p, r in zip(before, residual, predicted, variances)]
            noise = self._noise(nominal, [b / shape for b in scales])
        self._gammas[name] = shape, scales
        return noise

    def _noise(self, nominal: Array, ratios: list[float]) -> Array:
        low, high = self.lowest * self.lowest, self.highest * self.highest
        return scaled(nominal, [min(max(x, low), high) for x in ratios])
