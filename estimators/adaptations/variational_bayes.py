"""Variational-Bayes estimation of the measurement noise."""

from __future__ import annotations

from math import sqrt

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.direct_update import posterior
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .noise import EstimatedNoise, Scope

__all__ = ["VariationalBayes", "variational_bayes_noise", "variational_noise"]


@helper
def variational_noise(
    innovation: Vector,
    predicted: Matrix,
    nominal: Matrix,
    shape: float,
    iterations: int,
    lowest: float,
    highest: float,
    scales: Vector,
    noise: Matrix,
) -> None:
    """Compute the iteration of `VariationalBayes` for one measurement.

    Parameters
    ----------
    innovation : (m,) array
        Measurement minus its prediction.
    predicted, nominal : (m, m) arrays
        H P H' and R.
    shape : float
        Shape parameter a of the inverse gamma densities, including this measurement.
    iterations : int
        Number of alternating updates of state and noise.
    lowest, highest : float
        Bounds of the estimated variances, as multiples of the nominal ones.
    scales : (m,) array
        Scale parameters b of the densities before the measurement, in units of the nominal variances; overwritten by
        those after it.
    noise : (m, m) array
        Overwritten with the estimate of R.
    """
    m = innovation.size
    before, ratio, residual, after = scales.copy(), np.empty(m), np.empty(m), np.empty((m, m))
    for i in range(m):
        # The first update uses what was known before this measurement.
        ratio[i] = min(max(before[i] / (shape - 0.5), lowest), highest)
    for k in range(iterations + 1):
        for i in range(m):
            for j in range(m):
                noise[i, j] = nominal[i, j] * sqrt(ratio[i] * ratio[j])
        if k < iterations:
            posterior(innovation, predicted, noise, residual, after)
            for i in range(m):
                scales[i] = before[i] + 0.5 * (residual[i] * residual[i] + after[i, i]) / nominal[i, i]
                ratio[i] = min(max(scales[i] / shape, lowest), highest)


#: Forgetting factor, iterations, and bounds of the variance ratios.
SETTINGS = structure(forgetting=float, iterations=int, lowest=float, highest=float)
#: The shape of the gamma densities, and their scales.
MEMORY = structure(gamma_shape=float, scales=3)


@kernel(passed=True)
def variational_bayes_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Make one step of `VariationalBayes`, and write the noise of its last iteration into ``noise``; 0."""
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    own, kept = settings.view(SETTINGS)[0], memory.view(MEMORY)[0]
    kept.gamma_shape = own.forgetting * kept.gamma_shape + 0.5
    scales = kept.scales[: innovation.size]
    for i in range(innovation.size):
        scales[i] *= own.forgetting
    variational_noise(
        innovation, predicted, nominal, kept.gamma_shape, own.iterations, own.lowest, own.highest, scales, noise
    )
    return 0.0


class VariationalBayes(EstimatedNoise):
    """Estimates state and noise variances together; the variances are inverse-gamma distributed, with forgetting.

    Sarkka and Nummenmaa (2009), "Recursive noise adaptive Kalman filtering by variational Bayesian approximations",
    IEEE Trans. Automatic Control 54(3), algorithm 1. Component i of an instrument has variance ~ inverse gamma(a,
    b_i)::

        a  <- rho a + 1/2,    b_i- = rho b_i
        repeat:  R = diag(b_i / a);  update with R;  b_i = b_i- + 1/2 (e_i^2 + (H P+ H')_ii)

    with the shape a and the scale b_i of the density, the forgetting factor rho, and the residual e after the update;
    P+ is the covariance after it. If the state error is small and the residual is large, R increases in the same epoch,
    so a gross error gets a small weight without a test. The variances are stored in units of the nominal R, and its
    correlations are kept.

    Parameters
    ----------
    forgetting : float
        Forgetting factor rho, in (0, 1]; the memory is 1/(1 - rho) measurements. For an instrument of more than 1 Hz it
        is the factor over 1 s, so that the memory is the same in seconds.
    prior : float
        Number of measurements to which the datasheet's noise is equivalent at the start; of an instrument of more than
        1 Hz, so many for each hertz.
    iterations : int
        Number of alternating updates of state and noise for a measurement; at least 1.
    """

    rule = variational_bayes_noise

    def __init__(
        self,
        forgetting: float = 0.902,
        prior: float = 4.63,
        iterations: int = 2,
        lowest: float = 1.0,
        highest: float = 63.1,
        scope: Scope = "all",
    ):
        super().__init__(lowest, highest, scope=scope)
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting = {forgetting:g}: it must lie in (0, 1]")
        if not prior > 0.0:
            raise ValueError(f"prior = {prior:g}: it must be above 0")
        if iterations < 1:
            raise ValueError(f"iterations = {iterations}: it must be at least 1")
        self.forgetting, self.prior, self.iterations = forgetting, prior, iterations

    def settings_of(self, per_second: float) -> Array:
        """As `EstimatedNoise.settings_of`."""
        return filled(
            SETTINGS, forgetting=self.forgetting ** (1.0 / per_second), iterations=self.iterations,
            lowest=self.lowest**2, highest=self.highest**2,
        )  # fmt: skip

    def begun(self, per_second: float, m: int) -> Array:
        """As `EstimatedNoise.begun`: shape and scales of the datasheet's noise."""
        prior = 0.5 * self.prior * per_second
        return filled(MEMORY, gamma_shape=prior, scales=prior)
