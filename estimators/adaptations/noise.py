"""Base classes of adaptations of the noise: report of the sigma in use, bounds of an estimate, and the posterior."""

from __future__ import annotations

from abc import abstractmethod
from math import sqrt
from typing import Literal

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.adaptations.base import Adaptation, Innovation
from simnav.estimators.adaptations.prediction import PredictionTest
from simnav.estimators.algebra.joseph import joseph_update
from simnav.types import KINDS, Array, Instruments

__all__ = ["EstimatedNoise", "NoiseAdaptation", "Posterior", "Scope", "normalised_square", "posterior", "scaled"]

Scope = Literal["fixes", "all"]


@kernel("f8(f8[::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def posterior(innovation: Array, predicted: Array, noise: Array, residual: Array, after: Array) -> float:
    """Residual ``v - H P H' S^-1 v`` and ``H P+ H'`` after an update with ``S = H P H' + R``.

    A state of m components observed directly is the same problem, so the solver's own kernel computes it.

    Parameters
    ----------
    innovation : (m,) array
        Measurement minus its prediction.
    predicted, noise : (m, m) arrays
        H P H' and R.
    residual : (m,) array
        Overwritten.
    after : (m, m) array
        Overwritten.

    Returns
    -------
    float
        Normalised innovation squared; -1 where S is singular: then nothing is corrected.
    """
    m = innovation.size
    spread = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            after[i, j] = predicted[i, j]
            spread[i, j] = predicted[i, j] + noise[i, j]
    nis = joseph_update(after, predicted, spread, innovation, residual)
    for i in range(m):
        residual[i] = innovation[i] - residual[i] if nis >= 0.0 else innovation[i]
    return nis


@kernel("f8(f8[::1], f8[:, ::1], f8[:, ::1])")
def normalised_square(innovation: Array, predicted: Array, noise: Array) -> float:
    """Normalised innovation squared ``v' S^-1 v``, ``S = H P H' + R``; -1 where S is singular."""
    m = innovation.size
    return posterior(innovation, predicted, noise, np.empty(m), np.empty((m, m)))


@kernel("void(f8[:, ::1], f8, f8, f8, f8[:, ::1])")
def _scale(noise: Array, f0: float, f1: float, f2: float, product: Array) -> None:
    r0, r1, r2 = sqrt(f0), sqrt(f1), sqrt(f2)
    for i in range(noise.shape[0]):
        a = r0 if i == 0 else r1 if i == 1 else r2
        for j in range(noise.shape[0]):
            product[i, j] = noise[i, j] * a * (r0 if j == 0 else r1 if j == 1 else r2)


@kernel("void(f8[:, ::1], f8[:, ::1], f8, f8, f8[:, ::1])")
def _bound(estimate: Array, nominal: Array, low: float, high: float, bounded: Array) -> None:
    for i in range(nominal.shape[0]):
        bounded[i, i] = sqrt(min(max(estimate[i, i] / nominal[i, i], low), high))
    for i in range(nominal.shape[0]):
        for j in range(i):
            bounded[i, j] = bounded[j, i] = nominal[i, j] * bounded[i, i] * bounded[j, j]
    for i in range(nominal.shape[0]):
        bounded[i, i] *= nominal[i, i] * bounded[i, i]


@kernel("UniTuple(f8, 3)(f8[:, ::1])")
def _sigmas(noise: Array) -> tuple[float, float, float]:
    m = noise.shape[0]
    return sqrt(noise[0, 0]), sqrt(noise[1, 1]) if m > 1 else 0.0, sqrt(noise[2, 2]) if m > 2 else 0.0


class Posterior:
    """The result of an update with noise R, in the m components of the measurement.

    See `posterior`.

    Parameters
    ----------
    innovation : Innovation
        The innovation that is used.
    noise : (m, m) array
        Covariance of the measurement noise R.

    Attributes
    ----------
    nis : float
        -1 where S is singular; then nothing is corrected.
    residual : (m,) array
        Measurement minus its prediction after the update.
    predicted : (m, m) array
        H P+ H'.
    """

    __slots__ = ("nis", "predicted", "residual")

    def __init__(self, innovation: Innovation, noise: Array):
        d = len(innovation.residual)
        self.residual, self.predicted = np.empty(d), np.empty((d, d))
        self.nis: float = posterior(innovation.residual, innovation.predicted, noise, self.residual, self.predicted)


def scaled(noise: Array, factors: list[float]) -> Array:
    """A covariance of up to three components, the variance of the i-th times ``factors[i]``, correlations kept."""
    if min(factors) == max(factors) == 1.0:
        return noise
    product: Array = np.empty((len(noise), len(noise)))
    first, second, third = (*factors, 1.0, 1.0)[:3]
    _scale(noise, first, second, third, product)
    return product


class NoiseAdaptation(Adaptation):
    """An adaptation that reports the sigma that it used: ``sigma_<component>.<instrument>``, for example
    ``sigma_north.gnss``; a subclass gives `choose`.

    Before an instrument's first measurement its datasheet's sigma stands. Where the prediction is at fault
    (`PredictionTest`), the nominal noise is used, and the adaptation does not see the innovation: the filter is then
    the plain one.

    Attributes
    ----------
    together : int
        See `PredictionTest`; 0: the prediction is never at fault.
    inflates_motion : bool
        Whether the motion is inflated besides, where the prediction is at fault. Only `AdaptiveFactor` does: it helps
        where an IMU is disturbed, and does harm where it was two instruments after all.
    """

    together = 3

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._prediction = PredictionTest(instruments, self.together)
        self._labels = {n: [f"sigma_{e}.{n}" for e in KINDS[s.kind].errors] for n, s in instruments.items()}
        self._report: dict[str, float | Array] = {}
        self._noisy: dict[str, Array] = {}  # a noise found above zero, and the one reported last
        self._reported: dict[str, Array] = {}
        for name, sheet in instruments.items():
            self._report.update(zip(self._labels[name], map(float, sheet.sigma)))

    @abstractmethod
    def choose(self, innovation: Innovation) -> Array | None:
        """The (m, m) noise to use, or None to leave the measurement out."""

    def report(self, label: str, value: float) -> None:
        """Set a diagnostic; it keeps its value until it is set again."""
        self._report[label] = value

    def adapt(self, innovation: Innovation) -> Array | None:
        """Call `choose` and record its sigma; an instrument without noise keeps its noise."""
        self.inflation = 1.0
        name = innovation.measurement.instrument
        if innovation.noise is not self._noisy.get(name):
            if min(innovation.noise.diagonal().tolist()) <= 0.0:
                return innovation.noise
            self._noisy[name] = innovation.noise
        if self._prediction.fails(innovation):
            noise: Array | None = innovation.noise
            if self.inflates or self.inflates_motion:
                self.inflation = self._prediction.inflation(innovation)
        else:
            noise = self.choose(innovation)
        if noise is not None and noise is not self._reported.get(name):
            self._reported[name] = noise
            self._report.update(zip(self._labels[name], _sigmas(noise)))
        return noise

    def diagnostics(self) -> dict[str, float | Array]:
        """The sigmas last used, and other reported values."""
        return self._report


class EstimatedNoise(NoiseAdaptation):
    """Base of adaptations that estimate R: keeps the estimate within bounds. A subclass gives `estimate`.

    An innovation has the covariance ``H P H' + R``. It says little about R if the prediction is less certain than the
    measurement: after a start with a poor heading, in an outage, or with positions of centimetre accuracy. Then the
    noise used last is kept, and the innovation is not used for the estimate. Without this rule ``iae-fgo`` has up to
    twice the error of ``sw-fgo`` on random voyages without faults.

    Parameters
    ----------
    lowest, highest : float
        The estimated sigma stays between these multiples of the nominal one (for a full matrix: the roots of its
        eigenvalues, in units of the nominal variances). By default never below the datasheet: an instrument at its best
        is what that describes, and an estimate from ten innovations scatters by 45 %, half of it downwards.
    full : bool
        False: variances only, with the nominal correlations. An instrument's components err independently by its
        datasheet, and m (m - 1)/2 covariances that are zero cost accuracy to estimate.
    scope : "fixes" or "all"
        Whose noise is estimated: GNSS positions and terrain fixes (as in Mao, Wang and Fu 2025), or every instrument's.
        With fixes only, a log that is wrong is believed in full, and the fixes that contradict it are doubted.

    Raises
    ------
    ValueError
        If the bounds are not 0 < lowest <= highest, or the scope is none.
    """

    def __init__(self, lowest: float, highest: float, full: bool = False, scope: Scope = "all"):
        if not 0.0 < lowest <= highest:
            raise ValueError(f"lowest = {lowest:g} and highest = {highest:g}: it must be 0 < lowest <= highest")
        if scope not in ("fixes", "all"):
            raise ValueError(f"scope = {scope!r}: it must be 'fixes' or 'all'")
        self.lowest, self.highest, self.full, self.scope = lowest, highest, full, scope

    @abstractmethod
    def estimate(self, innovation: Innovation) -> Array:
        """The (m, m) noise estimated, within the bounds, this innovation included."""

    def choose(self, innovation: Innovation) -> Array:
        """The estimate; the nominal noise of an instrument out of scope; the last one after a poor prediction."""
        if self.scope == "fixes" and KINDS[innovation.measurement.kind].role != "fix":
            return innovation.noise
        before = self._reported.get(innovation.measurement.instrument, innovation.noise)
        if innovation.predicted.trace() > before.trace():
            return before
        return self.estimate(innovation)

    def bounded(self, estimate: Array, nominal: Array) -> Array:
        """An estimate of R, which may be indefinite, brought within the bounds; its diagonal alone, if not ``full``.

        Parameters
        ----------
        estimate, nominal : (m, m) array
            The estimated and the datasheet's covariance of the noise.
        """
        low, high = self.lowest * self.lowest, self.highest * self.highest
        m = len(nominal)
        if self.full and m > 1:
            sigma = np.sqrt(nominal.diagonal())
            unit = sigma[:, None] * sigma
            values, axes = np.linalg.eigh(estimate / unit)
            return np.asarray((axes * np.clip(values, low, high)) @ axes.T * unit)
        bounded: Array = np.empty((m, m))
        _bound(estimate, nominal, low, high, bounded)
        return bounded
