"""Maximum correntropy: a Gaussian kernel on the residuals in the place of their square."""

from __future__ import annotations

from math import exp
from typing import Literal

from estimators.adaptations.base import Innovation
from estimators.adaptations.noise import NoiseAdaptation, Posterior, scaled
from simnav.types import Array, Instruments

__all__ = ["MaximumCorrentropy"]


class MaximumCorrentropy(NoiseAdaptation):
    """Weights ``exp(-e^2 / (2 bandwidth^2))`` of the residuals after the update, by fixed-point iteration.

    Chen, Liu, Zhao and Principe (2017), "Maximum correntropy Kalman filter", Automatica 76, algorithm 1. A residual is
    standardised by R, which is divided by the weights; then the update, and the weights, are computed again.

    Two things differ from the print. It weights the components of the prediction error too; while the measurement is
    not believed, these are near zero and their weights one, so that they are left at one. And it starts from the
    prediction, which locks a filter out whose P is large against R (any measurement after an outage looks absurd next
    to R): the default starts from the plain Kalman update; ``begin="prediction"`` is as printed. P is that of the
    noise in use, not of the nominal one with the smaller gain, which would promise more than an ignored measurement
    gives.

    Parameters
    ----------
    bandwidth : float
        In sigma; the filter is the plain one as it grows.
    iterations : int
        At most.
    smallest : float
        Least weight.
    begin : "update" or "prediction"
    """

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

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._weights = {name: f"weight.{name}" for name in instruments}

    def choose(self, innovation: Innovation) -> Array:
        """The noise over the weights; reports the least of them."""
        nominal = innovation.noise
        inverse = [0.5 / (self.bandwidth**2 * r) for r in nominal.diagonal().tolist()]
        noise = nominal
        residual = _after(innovation, noise) if self.begin == "update" else innovation.residual.tolist()
        weights: list[float] = []
        for k in range(self.iterations):
            before = weights
            weights = [max(exp(-e * e * q), self.smallest) for e, q in zip(residual, inverse)]
            noise = scaled(nominal, [1.0 / w for w in weights])
            if min(weights) > 0.7 or (before and all(abs(a - b) <= 0.02 * b for a, b in zip(before, weights))):
                break  # another round would hardly change them
            if k < self.iterations - 1:
                residual = _after(innovation, noise)
        self.report(self._weights[innovation.measurement.instrument], min(weights))
        return noise


def _after(innovation: Innovation, noise: Array) -> list[float]:
    """The residual after an update with this noise."""
    if len(noise) == 1:
        p, r, v = float(innovation.predicted[0, 0]), float(noise[0, 0]), float(innovation.residual[0])
        return [v * r / (p + r)]
    listed: list[float] = Posterior(innovation, noise).residual.tolist()
    return listed
