"""Adaptive robust factors (ADKF, Zhan et al. 2026): three statistics, three factor functions, two targets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import exp, sqrt
from typing import Literal, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.direct_update import normalised_square, posterior
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Vector
from simnav.structures import filled, structure
from simnav.types import Array, Instruments

from .base import Innovation
from .inflation import inflate_all, inflate_moving
from .noise import NoiseAdaptation
from .prediction import limited_inflation
from .robust import igg3
from .rules import copied

__all__ = ["FACTORS", "AdaptiveFactor", "exponential", "three_segment", "two_segment"]

Statistic = Literal["discrepancy", "residual", "ratio"]
Factor = Literal["two-segment", "three-segment", "exponential"]


@helper
def two_segment(s: float, c0: float, c1: float = 0.0, two: float = 2.0) -> float:
    """Eq. 34: 1 up to c0, then ``c0/s``; continuous.

    Examples
    --------
    >>> two_segment(0.5, 1.0), two_segment(4.0, 1.0)
    (1.0, 0.25)
    """
    return 1.0 if s <= c0 else c0 / s


@helper
def three_segment(s: float, c0: float, c1: float, two: float = 2.0) -> float:
    """Eq. 35, the same function as IGG-III: 1 up to c0, decreasing to 0 at c1; continuous."""
    return igg3(s, c0, c1, two)


@helper
def exponential(s: float, c0: float, c1: float = 0.0, two: float = 2.0) -> float:
    """Eq. 36: 1 up to c0, then ``exp(-(s - c0)^2)``; continuous. The exponent is an argument as in `igg3`."""
    return 1.0 if s <= c0 else exp(-min((s - c0) ** two, 700.0))


#: The factor functions of the paper, by name. Arguments: the statistic, c0 and c1. Result: the factor in [0, 1].
FACTORS: Mapping[str, Callable[[float, float, float], float]] = {
    "two-segment": two_segment,
    "three-segment": three_segment,
    "exponential": exponential,
}


#: Thresholds of the factor function and its exponent; the smallest factor.
SETTINGS = structure(c0=float, c1=float, two=float, smallest=float)


@helper
def _whitened(prediction: Prediction) -> float:
    """The residual statistic ``sqrt(v' S^-1 v / m)``; -1 if S is singular."""
    innovation, predicted, nominal = prediction.innovation, prediction.predicted, prediction.nominal
    nis = normalised_square(innovation, predicted, nominal)
    return -1.0 if nis < 0.0 else sqrt(nis / innovation.size)


@helper
def _printed(prediction: Prediction) -> float:
    """The residual statistic as printed, eq. 31: v'v / sqrt(tr S)."""
    innovation, predicted, nominal = prediction.innovation, prediction.predicted, prediction.nominal
    square, trace = 0.0, 0.0
    for i in range(innovation.size):
        square += innovation[i] * innovation[i]
        trace += predicted[i, i] + nominal[i, i]
    return square / sqrt(trace)


@helper
def _divide(prediction: Prediction, statistic: float, factor: float, smallest: float) -> float:
    """Divide the nominal noise by a factor. The result is the factor, or 0 for a singular S; R is then the nominal."""
    nominal, noise = prediction.nominal, prediction.noise
    copied(nominal, noise)
    if statistic < 0.0:
        return 0.0
    factor = max(factor, smallest)
    if factor != 1.0:
        for i in range(nominal.shape[0]):
            for j in range(nominal.shape[0]):
                noise[i, j] = nominal[i, j] / factor
    return factor


def _rule(name: str, statistic: Callable[[Prediction], float], factor: Callable[..., float]) -> Callable[..., float]:
    """The rule that divides R by a factor of the residual statistic, under the name that it has here."""

    def divided(
        settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
    ) -> float:
        """Divide R; the result is that of `_divide`."""
        own, found = settings.view(SETTINGS)[0], statistic(prediction)
        return _divide(prediction, found, factor(found, own.c0, own.c1, own.two), float(own.smallest))

    divided.__name__ = divided.__qualname__ = name
    return kernel(passed=True)(divided)


whitened_two_segment = _rule("whitened_two_segment", _whitened, two_segment)
whitened_three_segment = _rule("whitened_three_segment", _whitened, three_segment)
whitened_exponential = _rule("whitened_exponential", _whitened, exponential)
printed_two_segment = _rule("printed_two_segment", _printed, two_segment)
printed_three_segment = _rule("printed_three_segment", _printed, three_segment)
printed_exponential = _rule("printed_exponential", _printed, exponential)

#: The rules of the residual statistic, by its form and by the factor function.
WHITENED = dict(zip(FACTORS, (whitened_two_segment, whitened_three_segment, whitened_exponential), strict=True))
PRINTED = dict(zip(FACTORS, (printed_two_segment, printed_three_segment, printed_exponential), strict=True))


class _Preset(NamedTuple):
    c0: Mapping[str, float]
    c1: float


#: Thresholds (c0, c1): those of the paper, and those of simnav for whitened statistics, which seldom exceed 2 without
#: faults.
PRESETS = {
    "paper": _Preset({"two-segment": 1.0, "three-segment": 1.5, "exponential": 1.0}, 4.0),
    "default": _Preset({"two-segment": 2.0, "three-segment": 2.0, "exponential": 2.0}, 8.0),
}


class AdaptiveFactor(NoiseAdaptation):
    """Divides R or P by a factor ``a`` in (0, 1] that decreases when a statistic of the innovation increases.

    Zhan et al. (2026), PLoS One 21(2) e0342016, eqs. 23-36; Yang and Gao (2006), J. Geodesy 80. With the
    innovation v of m components, ``S = H P H' + R``, the correction dx and the residual e after the update:

    ===========  ============================  ==========================================================
    statistic    printed (``paper``)           default: whitened, 1 on average where the filter is right
    ===========  ============================  ==========================================================
    discrepancy  |dx| / sqrt(tr P)    (30)     sqrt(dx' P^-1 dx / r_x),  r_x = tr(S^-1 H P H')
    residual     v'v / sqrt(tr S)     (31)     sqrt(v' S^-1 v / m)
    ratio        s_x^2 / s_0^2     (32-33)     sqrt(s_x^2 / mean s_0^2)
    ===========  ============================  ==========================================================

    with ``s_x^2 = dx' P^-1 dx / r_x`` and ``s_0^2 = e' R^-1 e / r``, ``r = m - r_x``. H is the Jacobian, P the
    covariance of the prediction and R that of the measurement noise; tr is the trace.

    The defaults differ from the print for these reasons: eq. 30 compares the posterior with the prediction and adds
    metres to radians. Eq. 31 as printed is a length and nearly always exceeds its threshold. The ratio of one epoch is
    always 1 for m = 1, so the default compares with the mean s_0^2 of about the last 20 epochs. The factor functions
    are eqs. 34-36 (`FACTORS`). a is at least 1e-3, because eq. 35 gives 0 and eq. 28 divides by a.

    ``target="P"`` is eq. 28: P/a, for each measurement. ``target="R"`` follows the text of the paper ("the adaptive
    factor can be used to inflate the measurement noise"): R/a for each instrument; with the residual statistic and the
    three-segment function these are IGG-III weights. By default the prediction is tested, too. If a fix and a log have
    failed their tests ``together`` times in a row, the prediction is taken as wrong: R is not changed, and the
    covariance of position, velocity and attitude is inflated (`inflate_moving`). The covariance of the instruments'
    errors is not inflated, because these do not depend on the motion. `PredictionTest` also limits every inflation:
    eq. 28 with ten gross errors in a row would multiply the variances of unobserved states by 1e30. The covariance is
    updated in Joseph's form with the noise and P in use (the first line of eq. 29 lacks the factor).

    Parameters
    ----------
    statistic : "discrepancy", "residual" or "ratio"
        Statistic of the innovation, as in the table.
    factor : "two-segment", "three-segment" or "exponential"
        Function from the statistic to the factor: eq. 34, 35 or 36.
    target : "R" or "P"
        The matrix that is divided by the factor: the noise of the measurement, or the covariance of the prediction.
    preset : "default" or "paper"
        ``paper``: statistics and thresholds as printed, and no test of the prediction with target R.
    c0, c1 : float or None
        Thresholds of the factor function; None: those of the preset (paper: c = 1; c0 = 1.5, c1 = 4).
    together : int
        Number of times in a row that a fix and a log must fail before the prediction is taken as wrong; 0: never.
    """

    SMALLEST = 1e-3
    rule: Callable[..., float] = whitened_three_segment
    reported = "factor"

    def __init__(
        self,
        statistic: Statistic = "residual",
        factor: Factor = "three-segment",
        target: Literal["R", "P"] = "R",
        preset: Literal["default", "paper"] = "default",
        c0: float | None = None,
        c1: float | None = None,
        together: int = 3,
    ):
        for name, value, known in (
            ("statistic", statistic, ("discrepancy", "residual", "ratio")),
            ("factor", factor, tuple(FACTORS)),
            ("target", target, ("R", "P")),
            ("preset", preset, tuple(PRESETS)),
        ):
            if value not in known:
                raise ValueError(f"{name} = {value!r}: it must be one of {', '.join(known)}")
        self.statistic, self.target, self.as_published = statistic, target, preset == "paper"
        self.c0 = PRESETS[preset].c0[factor] if c0 is None else c0
        self.c1 = PRESETS[preset].c1 if c1 is None else c1
        if not (self.c0 > 0.0 and (factor != "three-segment" or self.c1 > self.c0)):
            raise ValueError(f"c0 = {self.c0:g} and c1 = {self.c1:g}: it must be 0 < c0 < c1")
        self.factor, self.rule = FACTORS[factor], (PRINTED if self.as_published else WHITENED)[factor]
        self.together = 0 if self.as_published or target == "P" else together
        self.inflates = target == "P"
        self.inflates_motion = not self.inflates
        self.inflate = inflate_all if self.inflates else inflate_moving

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._variance: dict[str, float] = {}

    @property
    def ruled(self) -> bool:
        """As `NoiseAdaptation.ruled`: with the residual statistic and target R."""
        return super().ruled and self.statistic == "residual" and self.target == "R"

    def settings_of(self, per_second: float) -> Array:
        """As `NoiseAdaptation.settings_of`."""
        return filled(SETTINGS, c0=self.c0, c1=self.c1, two=2.0, smallest=self.SMALLEST)

    def choose(self, innovation: Innovation) -> Array:
        """The noise to use: R divided by the factor if R is the target. Otherwise sets the inflation of P."""
        noise: Array = innovation.noise
        if self.statistic == "residual":
            noise = np.empty_like(innovation.noise)
            factor = self.ask(self.rule, innovation, noise)
        elif normalised_square(innovation.residual, innovation.predicted, innovation.noise) < 0.0:
            factor = 0.0
        else:
            factor = max(self.factor(self._statistic(innovation), self.c0, self.c1), self.SMALLEST)
            noise = innovation.noise / factor
        if factor == 0.0:  # singular: the solver leaves it out
            return innovation.noise
        P = innovation.covariance
        if self.target == "P" and P is not None:
            self.inflation = limited_inflation(1.0 / factor, P, self.prediction_test.record(len(P)).first)
        self.report_number(innovation.measurement.instrument, factor)
        return innovation.noise if self.target == "P" or factor == 1.0 else noise

    def _statistic(self, innovation: Innovation) -> float:
        m = len(innovation.residual)
        residual, predicted = np.empty(m), np.empty((m, m))
        posterior(innovation.residual, innovation.predicted, innovation.noise, residual, predicted)
        # y = S^-1 v = R^-1 e, and S^-1 H P H' = R^-1 H P+ H'
        solved = np.linalg.solve(innovation.noise, np.column_stack((residual, predicted)))
        y = solved[:, 0]
        if self.statistic == "discrepancy" and self.as_published:
            if innovation.covariance is None or innovation.cross is None:
                raise ValueError("the printed discrepancy (eq. 30) needs P and P H' in the innovation")
            return float(np.linalg.norm(innovation.cross @ y) / sqrt(float(np.trace(innovation.covariance))))
        share = min(max(float(np.trace(solved[:, 1:])), 1e-9), m - 1e-9)
        moved = max(float((innovation.residual - residual) @ y), 0.0) / share
        if self.statistic == "discrepancy":
            return sqrt(moved)
        left = max(float(residual @ y), 1e-12) / (m - share)
        if self.as_published:
            return moved / left
        name = innovation.measurement.instrument
        usual = self._variance.get(name, 1.0)
        self._variance[name] = 0.95 * usual + 0.05 * left
        return sqrt(moved / usual)
