"""Equivalent weights: a measurement with a large innovation gets more noise."""

from __future__ import annotations

from simnav.compiled import helper, kernel
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Array

from .noise import NoiseAdaptation
from .prediction import standardised
from .rules import copied
from .scaled_noise import scale

__all__ = ["EquivalentWeights", "HuberWeights", "Igg3Weights", "huber", "huber_noise", "igg3", "igg3_noise"]


@helper
def huber(u: float, k: float = 1.345) -> float:
    """Huber's weight: 1 up to k, then ``k/|u|`` (Huber 1964); continuous.

    Examples
    --------
    >>> huber(1.0), huber(-2.69)
    (1.0, 0.5)
    """
    u = abs(u)
    return 1.0 if u <= k else k / u


@helper
def igg3(u: float, k0: float = 2.5, k1: float = 8.0, two: float = 2.0) -> float:
    """IGG-III weight: 1 up to k0, ``k0/|u| ((k1 - |u|)/(k1 - k0))^2`` up to k1, then 0 (Yang 1999); continuous.

    The exponent is an argument, because a compiler replaces a constant one by a product, which differs in the last bit.

    Examples
    --------
    >>> igg3(1.0), igg3(4.0, 2.0, 6.0), igg3(-9.0)
    (1.0, 0.125, 0.0)
    """
    u = abs(u)
    if u <= k0:
        return 1.0
    return k0 / u * ((k1 - u) / (k1 - k0)) ** two if u < k1 else 0.0


@helper
def _weigh(w0: float, w1: float, w2: float, smallest: float, nominal: Array, noise: Array) -> float:
    """Divide a noise by the weights of up to three components; the least, which is the weight of the largest one."""
    least = max(min(w0, w1, w2), smallest)
    if least == 1.0:
        copied(nominal, noise)
    else:
        scale(nominal, 1.0 / max(w0, smallest), 1.0 / max(w1, smallest), 1.0 / max(w2, smallest), noise)
    return least


#: Thresholds of the weights [sigma], the exponent of IGG-III, and the smallest weight.
HUBER, IGG3 = structure(k=float, smallest=float), structure(k0=float, k1=float, two=float, smallest=float)


@kernel(passed=True)
def huber_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Divide the nominal noise by Huber's weights; the least."""
    own = settings.view(HUBER)[0]
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    u0, u1, u2 = standardised(innovation, predicted, nominal)
    return _weigh(huber(u0, own.k), huber(u1, own.k), huber(u2, own.k), own.smallest, nominal, noise)


@kernel(passed=True)
def igg3_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Divide the nominal noise by IGG-III weights; the least."""
    own = settings.view(IGG3)[0]
    innovation, predicted, nominal, noise = (
        prediction.innovation, prediction.predicted, prediction.nominal, prediction.noise,
    )  # fmt: skip
    u0, u1, u2 = standardised(innovation, predicted, nominal)
    k0, k1, two = own.k0, own.k1, own.two
    return _weigh(
        igg3(u0, k0, k1, two), igg3(u1, k0, k1, two), igg3(u2, k0, k1, two), own.smallest, nominal, noise
    )  # fmt: skip


class EquivalentWeights(NoiseAdaptation):
    """Divides the variance of each component by the weight of its standardised innovation.

    Component i of an innovation v with covariance ``S = H P H' + R`` is standardised as ``u = v_i / sqrt(S_ii)``;
    ``R_ij`` becomes ``R_ij / sqrt(w(u_i) w(u_j))``, which keeps the correlations (the two-factor form of Yang, Song and
    Xu 2002). The innovation is standardised by S and not by R, so that an uncertain filter does not reject good
    measurements. A weight is at least `SMALLEST`, so that a filter with a wrong state is still corrected, though
    slowly. The smallest weight is reported.
    """

    SMALLEST = 1e-3
    reported = "weight"


class HuberWeights(EquivalentWeights):
    """Huber's equivalent weights: the influence of an innovation is bounded at k sigma.

    Huber's k = 1.345 has 95 % efficiency for each component; it increases the RMSE by up to 8 % on clean data.

    Parameters
    ----------
    k : float
        Innovation above which the weight is less than 1 [sigma], above 0.
    """

    rule = huber_noise

    def __init__(self, k: float = 2.0):
        if not k > 0.0:
            raise ValueError(f"k = {k:g}: it must be above 0")
        self.k = k

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(HUBER, k=self.k, smallest=self.SMALLEST)


class Igg3Weights(EquivalentWeights):
    """IGG-III equivalent weights: full weight up to k0 sigma, almost none from k1 sigma on.

    Parameters
    ----------
    k0, k1 : float
        Innovation above which the weight decreases, and innovation at which it is zero [sigma], ``0 < k0 < k1``.
    """

    rule = igg3_noise

    def __init__(self, k0: float = 2.5, k1: float = 8.0):
        if not 0.0 < k0 < k1:
            raise ValueError(f"k0 = {k0:g} and k1 = {k1:g}: it must be 0 < k0 < k1")
        self.k0, self.k1 = k0, k1

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(IGG3, k0=self.k0, k1=self.k1, two=2.0, smallest=self.SMALLEST)
