"""Base classes of adaptations that change the noise: report of the sigma in use, bounds of an estimate, posterior."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from math import sqrt
from typing import ClassVar, Literal

import numpy as np

from simnav.compiled import Kernel, helper, kernel
from simnav.estimators.algebra.direct_update import posterior
from simnav.estimators.models.base import SIGMA, SIZE
from simnav.kernel_types import Matrix
from simnav.types import KINDS, Array, Instruments

from .base import Adaptation, Innovation
from .prediction import PredictionTest

__all__ = [
    "INFLATION", "OWN", "REJECT", "RULE", "TIME", "EstimatedNoise", "NoiseAdaptation", "Posterior", "Scope",
    "WeightedNoise", "bound", "copied", "scale", "scaled",
]  # fmt: skip

#: Signature of a kernel that chooses a noise, from settings and memory of an instrument (which it updates), what is
#: shared by all instruments, innovation (m,), H P H' (m, m) and the nominal R (m, m). It overwrites the last array
#: (m, m), and returns a number to be reported (`NoiseAdaptation.reported`), or 0.
RULE = "f8(f8[::1], f8[::1], f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])"
#: Places in what is shared: time of the measurement [s]; what a rule may overwrite, the factor on P (before it is 1)
#: and whether the measurement is rejected (0); and a number of its own, at first NaN.
TIME, INFLATION, REJECT, OWN = range(4)

Scope = Literal["fixes", "all"]


@kernel
def scale(noise: Matrix, f0: float, f1: float, f2: float, product: Matrix) -> None:
    r0, r1, r2 = sqrt(f0), sqrt(f1), sqrt(f2)
    for i in range(noise.shape[0]):
        a = r0 if i == 0 else r1 if i == 1 else r2
        for j in range(noise.shape[0]):
            product[i, j] = noise[i, j] * a * (r0 if j == 0 else r1 if j == 1 else r2)


@kernel
def bound(estimate: Matrix, nominal: Matrix, low: float, high: float, bounded: Matrix) -> None:
    for i in range(nominal.shape[0]):
        bounded[i, i] = sqrt(min(max(estimate[i, i] / nominal[i, i], low), high))
    for i in range(nominal.shape[0]):
        for j in range(i):
            bounded[i, j] = bounded[j, i] = nominal[i, j] * bounded[i, i] * bounded[j, j]
    for i in range(nominal.shape[0]):
        bounded[i, i] *= nominal[i, i] * bounded[i, i]


@helper
def copied(noise: Array, used: Array) -> None:
    """Copy an (m, m) array into another; a slice would take seconds to compile."""
    for i in range(noise.shape[0]):
        for j in range(noise.shape[0]):
            used[i, j] = noise[i, j]


@kernel
def _sigmas(noise: Matrix) -> tuple[float, float, float]:
    m = noise.shape[0]
    return sqrt(noise[0, 0]), sqrt(noise[1, 1]) if m > 1 else 0.0, sqrt(noise[2, 2]) if m > 2 else 0.0


def _trace(matrix: Array) -> float:
    """The trace of a small matrix: the method of an array takes several times as long."""
    total = 0.0
    for x in matrix.diagonal().tolist():
        total += x
    return total


class Posterior:
    """The result of an update with noise R, in the m components of the measurement.

    See `posterior`.

    Parameters
    ----------
    innovation : Innovation
        The innovation, with the covariance of its prediction.
    noise : (m, m) array
        Covariance R of the measurement noise in the update.

    Attributes
    ----------
    nis : float
        Normalised innovation squared; -1 if S is singular, and then there is no update.
    residual : (m,) array
        Measurement minus its prediction after the update.
    predicted : (m, m) array
        H P+ H', the covariance of the prediction after the update.
    """

    __slots__ = ("nis", "predicted", "residual")

    def __init__(self, innovation: Innovation, noise: Array):
        d = len(innovation.residual)
        self.residual, self.predicted = np.empty(d), np.empty((d, d))
        self.nis: float = posterior(innovation.residual, innovation.predicted, noise, self.residual, self.predicted)


def scaled(noise: Array, factors: list[float]) -> Array:
    """A covariance of up to three components with variance i times ``factors[i]`` and the same correlations."""
    if min(factors) == max(factors) == 1.0:
        return noise
    product: Array = np.empty((len(noise), len(noise)))
    first, second, third = (*factors, 1.0, 1.0)[:3]
    scale(noise, first, second, third, product)
    return product


class NoiseAdaptation(Adaptation):
    """An adaptation that reports the sigma that it used: ``sigma_<component>.<instrument>``, for example
    ``sigma_north.gnss``; a subclass defines `choose`.

    Before the first measurement of an instrument, the sigma of its datasheet is reported. If the prediction is wrong
    (`PredictionTest`), the nominal noise is used and `choose` is not called: the filter is then the plain one.

    Attributes
    ----------
    together : int
        Number of joint failures after which the prediction is taken as wrong, see `PredictionTest`; 0: never.
    inflates_motion : bool
        True if the covariance of the motion is also inflated when the prediction is wrong. Only `AdaptiveFactor` does
        this. It helps if an IMU is disturbed, and it is harmful if two instruments are wrong instead.
    """

    together = 3
    #: The kernel that chooses, or that estimates (`RULE`); None if there is none, as for a subclass that chooses in its
    #: own way.
    rule: ClassVar[Kernel[..., float] | None] = None
    #: What the number that the rule returns is reported as.
    reported: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if {"adapt", "choose", "estimate"} & vars(cls).keys() and "rule" not in vars(cls):
            cls.rule = None

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self.prediction = PredictionTest(instruments, self.together)
        self._labels = {n: [f"sigma_{e}.{n}" for e in KINDS[s.kind].errors] for n, s in instruments.items()}
        self._report: dict[str, float | Array] = {}
        self._noisy: dict[str, Array] = {}  # a noise found above zero, and the one reported last
        self._reported: dict[str, Array] = {}
        for name, sheet in instruments.items():
            self._report.update(zip(self._labels[name], map(float, sheet.sigma)))
        self._noted: dict[str, Sequence[float]] = {}
        self._further = {name: f"{self.reported}.{name}" for name in instruments}
        self.instruments, self.index = instruments, {name: i for i, name in enumerate(instruments)}
        self.longer = {name: max(sheet.rate, 1.0) for name, sheet in instruments.items()}
        self.rule_settings = np.array([self.settings_of(longer) for longer in self.longer.values()], dtype=np.float64)
        begun = [self.begun(longer, len(self._labels[name])) for name, longer in self.longer.items()]
        self.rule_first = np.cumsum([0, *map(len, begun)])
        self.rule_memory = np.concatenate([*begun, np.empty(0)])
        self.rule_shared = np.full(OWN + 1, np.nan)

    @property
    def ruled(self) -> bool:
        """Whether a rule does all that `choose` does, with the parameters of this adaptation."""
        return self.rule is not None

    def settings_of(self, longer: float) -> list[float]:
        """What the rule needs to know of an instrument with so many measurements in a second, at least 1."""
        return []

    def begun(self, longer: float, m: int) -> Array:
        """What the rule keeps of an instrument of m components, at the start of a run."""
        return np.empty(0)

    def memory_of(self, name: str) -> tuple[Array, Array]:
        """Settings and memory of an instrument, views."""
        i = self.index[name]
        return self.rule_settings[i], self.rule_memory[self.rule_first[i] : self.rule_first[i + 1]]

    def ask(self, rule: Kernel[..., float], innovation: Innovation, noise: Array) -> float:
        """What a rule returns for a measurement; it overwrites the noise, and its inflation is set."""
        m, residual, predicted, nominal, *_ = innovation
        shared = self.rule_shared
        shared[TIME], shared[INFLATION], shared[REJECT] = m.time, 1.0, 0.0
        found = rule(*self.memory_of(m.instrument), shared, residual, predicted, nominal, noise)
        self.inflation = float(shared[INFLATION])
        return found

    def in_scope(self, kind: str) -> bool:
        """Whether the noise of a kind of instrument is chosen; otherwise it is the nominal one."""
        return True

    def noted(self, name: str, row: Sequence[float]) -> None:
        """Report the sigmas that a kernel chose for an instrument, and the further number if it is not 0."""
        chosen = row[SIGMA:SIZE]
        if chosen[0] == chosen[0] and chosen != self._noted.get(name):
            self._noted[name] = chosen
            self._report.update(zip(self._labels[name], chosen))
            if chosen[-1] and self.reported:
                self._report[self._further[name]] = self.said(chosen[-1])

    def said(self, number: float) -> float:
        """The number that a rule returns, as it is reported."""
        return number

    @abstractmethod
    def choose(self, innovation: Innovation) -> Array | None:
        """The (m, m) noise to use, or None to reject the measurement."""

    def report(self, label: str, value: float) -> None:
        """Set a diagnostic. It keeps its value until the next call."""
        self._report[label] = value

    def adapt(self, innovation: Innovation) -> Array | None:
        """Call `choose` and record the sigma of its result. An instrument without noise is not adapted."""
        self.inflation = 1.0
        name = innovation.measurement.instrument
        if innovation.noise is not self._noisy.get(name):
            if min(innovation.noise.diagonal().tolist()) <= 0.0:
                return innovation.noise
            self._noisy[name] = innovation.noise
        if self.prediction.fails(innovation):
            noise: Array | None = innovation.noise
            if self.prediction.disturbed and (self.inflates or self.inflates_motion):
                self.inflation = self.prediction.inflation(innovation)
        else:
            noise = self.choose(innovation)
        if noise is not None and noise is not self._reported.get(name):
            self._reported[name] = noise
            self._report.update(zip(self._labels[name], _sigmas(noise)))
        return noise

    def diagnostics(self) -> dict[str, float | Array]:
        """The sigmas last used, and other reported values."""
        return self._report


class WeightedNoise(NoiseAdaptation):
    """Base of robust rules: the nominal noise divided by weights, of which the smallest is reported."""

    reported = "weight"

    def weighted(self, rule: Kernel[..., float], innovation: Innovation) -> Array:
        """The noise that a kernel (`RULE`) chooses for a measurement, and report its weight."""
        noise: Array = np.empty_like(innovation.noise)
        self.report(self._further[innovation.measurement.instrument], self.ask(rule, innovation, noise))
        return noise


class EstimatedNoise(NoiseAdaptation):
    """Base class of adaptations that estimate R and keep it within bounds. A subclass defines `estimate`.

    An innovation has the covariance ``H P H' + R``. It contains little information on R if the prediction is less
    certain than the measurement: after a start with a poor heading, in an outage, or with positions of centimetre
    accuracy. Then the last noise is kept, and the innovation is not used for the estimate. Without this rule
    ``iae-fgo`` has up to twice the error of ``sw-fgo`` on random voyages without faults.

    Parameters
    ----------
    lowest, highest : float
        Bounds of the estimated sigma, as multiples of the nominal one (for a full matrix: of the square roots of its
        eigenvalues, in units of the nominal variances). By default the estimate is never below the datasheet, which
        describes the instrument without faults; an estimate from ten innovations scatters by 45 % in both directions.
    full : bool
        False: only the variances are estimated, with the nominal correlations. By its datasheet the components of an
        instrument have independent errors, and the estimation of m (m - 1)/2 zero covariances costs accuracy.
    scope : "fixes" or "all"
        The instruments whose noise is estimated: GNSS positions and terrain fixes (as in Mao, Wang and Fu 2025), or
        all. With fixes only, a wrong log has its full weight, and the fixes that contradict it get a smaller weight.

    Raises
    ------
    ValueError
        If the bounds are not 0 < lowest <= highest, or the scope is unknown.
    """

    def __init__(self, lowest: float, highest: float, full: bool = False, scope: Scope = "all"):
        if not 0.0 < lowest <= highest:
            raise ValueError(f"lowest = {lowest:g} and highest = {highest:g}: it must be 0 < lowest <= highest")
        if scope not in ("fixes", "all"):
            raise ValueError(f"scope = {scope!r}: it must be 'fixes' or 'all'")
        self.lowest, self.highest, self.full, self.scope = lowest, highest, full, scope

    @property
    def ruled(self) -> bool:
        """As `NoiseAdaptation.ruled`; a full matrix is bounded by NumPy."""
        return super().ruled and not self.full

    @abstractmethod
    def estimate(self, innovation: Innovation) -> Array:
        """The (m, m) estimate of the noise within the bounds, including this innovation."""

    def in_scope(self, kind: str) -> bool:
        """Whether the noise of a kind of instrument is estimated, by the scope."""
        return self.scope == "all" or KINDS[kind].role == "fix"

    def choose(self, innovation: Innovation) -> Array:
        """The estimate; for an instrument out of scope the nominal noise; for a poor prediction the last noise."""
        if not self.in_scope(innovation.measurement.kind):
            return innovation.noise
        before = self._reported.get(innovation.measurement.instrument, innovation.noise)
        if _trace(innovation.predicted) > _trace(before):
            return before
        return self.estimate(innovation)

    def bounded(self, estimate: Array, nominal: Array) -> Array:
        """Limit an estimate of R, which may be indefinite, to the bounds; only its diagonal, if not ``full``.

        Parameters
        ----------
        estimate, nominal : (m, m) array
            Estimated covariance of the noise, and that of the datasheet.
        """
        low, high = self.lowest * self.lowest, self.highest * self.highest
        m = len(nominal)
        if self.full and m > 1:
            sigma = np.sqrt(nominal.diagonal())
            unit = sigma[:, None] * sigma
            values, axes = np.linalg.eigh(estimate / unit)
            return np.asarray((axes * np.clip(values, low, high)) @ axes.T * unit)
        bounded: Array = np.empty((m, m))
        bound(estimate, nominal, low, high, bounded)
        return bounded
