"""Maximum correntropy: a Gaussian kernel of the residuals in place of their square."""

from __future__ import annotations

from math import exp, sqrt
from typing import Literal

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.direct_update import posterior
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .noise import WeightedNoise

__all__ = ["MaximumCorrentropy", "correntropy_noise", "correntropy_rule"]


@helper
def correntropy_noise(
    innovation: Vector,
    predicted: Matrix,
    nominal: Matrix,
    bandwidth: float,
    smallest: float,
    iterations: int,
    from_update: bool,
    noise: Matrix,
) -> float:
    """The fixed-point iteration (see `MaximumCorrentropy`).

    Parameters
    ----------
    innovation : (m,) array
        Measurement minus its prediction.
    predicted, nominal : (m, m) arrays
        H P H' and R.
    bandwidth, smallest : float
        Bandwidth of the kernel [sigma], and the smallest weight of a measurement.
    iterations : int
        Largest number of fixed-point iterations.
    from_update : bool
        True: start from the residual after the plain update; False: from the innovation.
    noise : (m, m) array
        Overwritten with R divided by the weights.

    Returns
    -------
    float
        The smallest weight of a component.
    """
    m = innovation.size
    residual, weights, after = innovation.copy(), np.zeros(m), np.empty((m, m))
    if from_update:
        posterior(innovation, predicted, nominal, residual, after)
    least = 1.0
    for k in range(iterations):
        least, settled = 1.0, True
        for i in range(m):
            w = max(exp(-0.5 * residual[i] * residual[i] / (bandwidth * bandwidth * nominal[i, i])), smallest)
            settled = settled and abs(weights[i] - w) <= 0.02 * w
            weights[i] = w
            least = min(least, w)
        for i in range(m):
            for j in range(m):
                noise[i, j] = nominal[i, j] / sqrt(weights[i] * weights[j])
        if least > 0.7 or settled or k == iterations - 1:
            break  # a further iteration would hardly change the weights
        posterior(innovation, predicted, noise, residual, after)
    return least


#: Bandwidth [sigma], smallest weight, largest number of iterations, and whether the first follows the update.
SETTINGS = structure(bandwidth=float, smallest=float, iterations=int, from_update=int)


@kernel(passed=True)
def correntropy_rule(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Call `correntropy_noise`."""
    own = settings.view(SETTINGS)[0]
    innovation, _, predicted, nominal, noise = prediction
    return correntropy_noise(
        innovation, predicted, nominal, own.bandwidth, own.smallest, own.iterations, own.from_update > 0, noise
    )


class MaximumCorrentropy(WeightedNoise):
    """Weights ``exp(-e^2 / (2 bandwidth^2))`` of the residuals after the update, by fixed-point iteration.

    Chen, Liu, Zhao and Principe (2017), "Maximum correntropy Kalman filter", Automatica 76, algorithm 1. A residual is
    standardised by R, which is divided by the weights; then the update, and the weights, are computed again.

    There are three differences from the printed algorithm. The print also weights the components of the prediction
    error; while a measurement has a small weight these components are near zero and their weights are one, so they stay
    at one here. The print starts from the prediction. If P is much larger than R, as after an outage, every measurement
    then gets a small weight and the filter does not recover. So the default starts from the plain Kalman update;
    ``begin="prediction"`` is as printed. The updated P follows from the noise in use; with the nominal noise and the
    smaller gain it would be too small.

    Parameters
    ----------
    bandwidth : float
        Bandwidth of the Gaussian kernel [sigma]. With a large bandwidth the filter is the plain one.
    iterations : int
        Largest number of iterations for a measurement.
    smallest : float
        Smallest weight of a residual, in (0, 1].
    begin : "update" or "prediction"
        The first weights are those of the residual after the plain update, or those of the innovation.
    """

    rule = correntropy_rule

    def __init__(
        self,
        bandwidth: float = 4.0,
        iterations: int = 5,
        smallest: float = 1e-3,
        begin: Literal["update", "prediction"] = "update",
    ):
        if not bandwidth > 0.0:
            raise ValueError(f"bandwidth = {bandwidth:g}: it must be above 0")
        if iterations < 1:
            raise ValueError(f"iterations = {iterations}: it must be at least 1")
        if not 0.0 < smallest <= 1.0:
            raise ValueError(f"smallest = {smallest:g}: it must lie in (0, 1]")
        if begin not in ("update", "prediction"):
            raise ValueError(f"begin = {begin!r}: it must be 'update' or 'prediction'")
        self.bandwidth, self.iterations, self.smallest, self.begin = bandwidth, iterations, smallest, begin

    def settings_of(self, longer: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(
            SETTINGS, bandwidth=self.bandwidth, smallest=self.smallest, iterations=self.iterations,
            from_update=self.begin == "update",
        )  # fmt: skip
