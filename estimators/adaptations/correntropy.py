"""Maximum correntropy: a Gaussian kernel of the residuals in place of their square."""

from __future__ import annotations

from math import exp, sqrt
from typing import Literal

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.direct_update import posterior
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .noise import NoiseAdaptation

__all__ = ["MaximumCorrentropy", "from_prediction", "from_update"]


#: Bandwidth [sigma], smallest weight, and largest number of iterations.
SETTINGS = structure(bandwidth=float, smallest=float, iterations=int)


@helper
def _iterate(settings: Vector, prediction: Prediction, residual: Vector) -> float:
    """The fixed-point iteration of `MaximumCorrentropy` from a residual, which is overwritten; the smallest weight."""
    own = settings.view(SETTINGS)[0]
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    bandwidth, smallest, m = own.bandwidth, own.smallest, innovation.size
    weights, after = np.zeros(m), np.empty((m, m))
    least = 1.0
    for k in range(own.iterations):
        least, settled = 1.0, True
        for i in range(m):
            w = max(exp(-0.5 * residual[i] * residual[i] / (bandwidth * bandwidth * nominal[i, i])), smallest)
            settled = settled and abs(weights[i] - w) <= 0.02 * w
            weights[i] = w
            least = min(least, w)
        for i in range(m):
            for j in range(m):
                noise[i, j] = nominal[i, j] / sqrt(weights[i] * weights[j])
        if least > 0.7 or settled or k == own.iterations - 1:
            break  # a further iteration would hardly change the weights
        posterior(innovation, predicted, noise, residual, after)
    return least


@kernel(passed=True)
def from_update(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Divide R by the weights, from the residual after the plain update; the smallest weight of a component."""
    innovation, predicted, nominal = prediction.innovation, prediction.predicted, prediction.nominal
    residual, after = innovation.copy(), np.empty((innovation.size, innovation.size))
    posterior(innovation, predicted, nominal, residual, after)
    return _iterate(settings, prediction, residual)


@kernel(passed=True)
def from_prediction(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Divide R by the weights, from the innovation; the smallest weight of a component."""
    return _iterate(settings, prediction, prediction.innovation.copy())


class MaximumCorrentropy(NoiseAdaptation):
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

    rule = from_update
    reported = "weight"

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
        self.rule = from_update if begin == "update" else from_prediction

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(SETTINGS, bandwidth=self.bandwidth, smallest=self.smallest, iterations=self.iterations)
