"""Base classes of adaptations that change the noise: report of the sigma in use, bounds of an estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import FunctionType
from typing import ClassVar, Literal

import numpy as np

from simnav.compiled import ready
from simnav.estimators.models.filtering import Prediction, Readings, clear_readings, room_for
from simnav.types import KINDS, Array, Instruments

from .base import Adaptation, Innovation
from .choice import Choice, choose_noise
from .noise_report import NoiseReport
from .prediction import PredictionTest
from .scaled_noise import bound

__all__ = ["EstimatedNoise", "NoiseAdaptation", "Scope", "as_prediction"]

Scope = Literal["fixes", "all"]
_NO_COVARIANCE = _NO_CROSS = np.empty((0, 0))


def as_prediction(innovation: Innovation, noise: Array) -> Prediction:
    """An innovation as a rule takes it, with the noise that it overwrites."""
    return Prediction(innovation.residual, _NO_CROSS, innovation.predicted, innovation.noise, noise)


class NoiseAdaptation(Adaptation):
    """An adaptation that reports the sigma that it used: ``sigma_<component>.<instrument>``, for example
    ``sigma_north.gnss``. A subclass says its rule, or defines `choose` in Python.

    Before the first measurement of an instrument, the sigma of its datasheet is reported. If the prediction is wrong
    (`PredictionTest`), the nominal noise is used and the rule is not asked: the filter is then the plain one.

    Attributes
    ----------
    together : int
        Number of joint failures after which the prediction is taken as wrong, see `PredictionTest`; 0: never.
    inflates_motion : bool
        True if the covariance of the motion is also inflated when the prediction is wrong. Only `AdaptiveFactor` does
        this. It helps if an IMU is disturbed, and it is harmful if two instruments are wrong instead.
    """

    together = 3
    #: The function that chooses (`simnav.estimators.adaptations.rules`), of the class or of the instance; None if there
    #: is none.
    rule: Callable[..., float] | None = None
    #: Whether a method of the class chooses in place of the rule of its base.
    chooses_by_method: ClassVar[bool] = False
    #: What the number that the rule returns is reported as.
    reported: ClassVar[str] = ""
    #: Whether the rule estimates the noise, so that the last one stands while a prediction is poor.
    estimates: bool = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        own = vars(cls)
        if own.keys() & {"rule", "adapt", "choose"}:
            cls.chooses_by_method = "rule" not in own
        if isinstance(rule := own.get("rule"), FunctionType):
            cls.rule = staticmethod(rule)  # a plain function would be a method of the instance

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self.prediction_test = PredictionTest(instruments, self.together)
        self.report = NoiseReport(instruments, list(instruments), self.reported)
        self.instruments, self.index = instruments, {name: i for i, name in enumerate(instruments)}
        self.per_second = {name: max(sheet.rate, 1.0) for name, sheet in instruments.items()}
        self.rule_settings = np.array([self.settings_of(n) for n in self.per_second.values()], dtype=np.float64)
        begun = [self.begun(n, len(KINDS[instruments[name].kind].errors)) for name, n in self.per_second.items()]
        self.rule_first = np.cumsum([0, *map(len, begun)])
        self.rule_memory = np.concatenate([*begun, np.empty(0)])
        self.rule_common = self.begun_together()
        self._noise_choice: Choice | None = None
        self._reading = room_for(1)

    @property
    def ruled(self) -> bool:
        """Whether a rule does all that `choose` does, with the parameters of this adaptation."""
        return self.rule is not None and not self.chooses_by_method

    def settings_of(self, per_second: float) -> Array:
        """What the rule needs to know of an instrument with so many measurements in a second, at least 1."""
        return np.empty(0)

    def begun(self, per_second: float, m: int) -> Array:
        """What the rule keeps of an instrument of m components, at the start of a run."""
        return np.empty(0)

    def begun_together(self) -> Array:
        """What the rule keeps of all instruments together, at the start of a run."""
        return np.empty(0)

    def memory_of(self, name: str) -> tuple[Array, Array]:
        """Settings and memory of an instrument, views."""
        i = self.index[name]
        return self.rule_settings[i], self.rule_memory[self.rule_first[i] : self.rule_first[i + 1]]

    def in_scope(self, kind: str) -> bool:
        """Whether the noise of a kind of instrument is chosen; otherwise it is the nominal one."""
        return True

    def noise_choice(self, names: Sequence[str], size: int) -> Choice:
        """How the noise of the readings of some instruments is chosen, in a model of so many states."""
        sheets = [self.instruments[name] for name in names]
        return Choice(
            rule=self.rule if self.rule is not None and self.ruled else self._ask, estimates=self.estimates,
            inflates_disturbed=self.inflates or self.inflates_motion,
            index=np.array([self.index[name] for name in names], dtype=np.int64),
            in_scope=np.array([self.in_scope(sheet.kind) for sheet in sheets], dtype=np.bool_),
            last=np.zeros((len(names), 9)), settings=self.rule_settings.reshape(len(self.index), -1),
            memories=self.rule_memory, first=self.rule_first, common=self.rule_common,
            test=self.prediction_test.record(size),
        )  # fmt: skip

    def adapt(self, innovation: Innovation) -> Array | None:
        """Choose the noise of one measurement (`choose_noise`). An instrument without noise is not adapted."""
        m, residual, predicted, nominal, covariance = (
            innovation.measurement, innovation.residual, innovation.predicted, innovation.noise, innovation.covariance,
        )  # fmt: skip
        if self._noise_choice is None:
            self._noise_choice = self.noise_choice(list(self.index), 0 if covariance is None else len(covariance))
        reading, row = self._reading, self.index[m.instrument]
        clear_readings.unchecked(reading, 1)
        reading.instrument[0], reading.time[0] = row, m.time
        reading.value[0, : len(m.value)] = m.value
        self._innovation, self.inflation = innovation, 1.0
        d = len(residual)
        prediction = Prediction(ready(residual), _NO_CROSS, ready(predicted), ready(nominal), np.empty((d, d)))
        choose = choose_noise.unchecked if self._noise_choice.compiled else choose_noise.function
        choose(self._noise_choice, _NO_COVARIANCE if covariance is None else ready(covariance), reading, 0, prediction)
        self.inflation = float(reading.inflation[0])
        if reading.rejected[0]:
            return None
        self.report.note(row, reading.sigma[0].tolist(), float(reading.reported[0]))
        return prediction.noise

    def _ask(
        self, settings: Array, memory: Array, common: Array, readings: Readings, k: int, prediction: Prediction
    ) -> float:
        """The rule of an adaptation that chooses in Python."""
        chosen = self.choose(self._innovation)
        readings.inflation[k], readings.rejected[k] = self.inflation, chosen is None
        if chosen is not None:
            prediction.noise[...] = chosen
        return 0.0

    def ask(self, rule: Callable[..., float], innovation: Innovation, noise: Array) -> float:
        """What a kernel of a rule returns for a measurement; it overwrites the noise."""
        memory = self.memory_of(innovation.measurement.instrument)
        return rule(*memory, self.rule_common, self._reading, 0, as_prediction(innovation, noise))

    def choose(self, innovation: Innovation) -> Array | None:
        """The (m, m) noise to use, or None to reject the measurement; for an adaptation without a rule."""
        raise NotImplementedError(f"{type(self).__name__} has neither a rule nor a method choose")

    def report_number(self, name: str, number: float) -> None:
        """Report a number of an instrument. It stays until the next one."""
        self.report.rows[self.index[name]].number = number

    def diagnostics(self) -> dict[str, float | Array]:
        """The sigmas last used, and other reported values."""
        return self.report.diagnostics()


class EstimatedNoise(NoiseAdaptation):
    """Base class of adaptations that estimate R and keep it within bounds.

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

    estimates = True

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

    def in_scope(self, kind: str) -> bool:
        """Whether the noise of a kind of instrument is estimated, by the scope."""
        return self.scope == "all" or KINDS[kind].role == "fix"

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
