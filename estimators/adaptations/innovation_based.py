"""Measurement noise from a window of innovations (IAE) or of residuals (RAE)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.direct_update import posterior
from simnav.estimators.models.filtering import Prediction, Readings
from simnav.kernel_types import Matrix, Vector
from simnav.structures import filled, length, structure
from simnav.types import Array

from .base import Innovation
from .noise import EstimatedNoise, Scope, as_prediction
from .rules import copied
from .scaled_noise import bound

__all__ = ["FixedWindow", "InnovationBased", "adaptive_window"]


@helper
def adaptive_window(variance: float, nominal: float, low: float, high: float, shortest: int, longest: int) -> int:
    """Length of the window after Mao, Wang and Fu (2025), eq. 20: the more the innovations scatter, the longer.

    Parameters
    ----------
    variance : float
        Mean squared distance of the innovations in the window from their mean (eq. 19).
    nominal : float
        Trace of the nominal innovation covariance, in the same unit.
    low, high : float
        v_min and v_max of eq. 20, as multiples of ``nominal``. The paper does not give them.
    shortest, longest : int
        M_min and M_max, the smallest and largest length of the window [innovations].
    """
    if variance > high * nominal:
        return longest
    return (shortest + longest) // 2 if variance > low * nominal else shortest


class _Epoch(NamedTuple):
    """What a window keeps of an innovation of m components, or its sums over some of them; matrices row by row.

    Attributes
    ----------
    innovation : (m,) array
        The innovation v.
    square, residual : (m m,) array
        v v', and e e' of the residual e.
    predicted : (m m,) array
        H P H', or minus H P+ H'.
    """

    innovation: Vector
    square: Vector
    residual: Vector
    predicted: Vector


@helper
def _width(m: int) -> int:
    """Number of elements of a row of a window, of innovations of m components."""
    return m + 3 * m * m


@helper
def _epoch(row: Vector, m: int) -> _Epoch:
    """The parts of a row of a window, or of the sums over its rows; views."""
    first, second, third = m, m + m * m, m + 2 * m * m
    return _Epoch(row[:first], row[first:second], row[second:third], row[third:])


@helper
def _push(rows: Matrix, count: int, innovation: Vector, residual: Vector, sign: float, predicted: Matrix) -> None:
    """Overwrite the oldest row with that of the present epoch."""
    m = innovation.size
    epoch = _epoch(rows[count % rows.shape[0]], m)
    for i in range(m):
        epoch.innovation[i] = innovation[i]
        for j in range(m):
            epoch.square[i * m + j] = innovation[i] * innovation[j]
            epoch.residual[i * m + j] = residual[i] * residual[j]
            epoch.predicted[i * m + j] = sign * predicted[i, j]


@helper
def _sums(rows: Array, count: int, n: int, sums: Array) -> None:
    """Overwrite with the sums of all columns over the last n of ``count`` rows."""
    ring, columns = rows.shape
    for c in range(columns):
        sums[c] = 0.0
    r = (count - n) % ring
    for _ in range(n):
        for c in range(columns):
            sums[c] += rows[r, c]
        r = r + 1 if r + 1 < ring else 0


#: Between them is the mean square of innovations that do not contradict the datasheet, in units of its variance.
LIMITS = structure(lower=float, upper=float)


@cache
def _contradiction(length: int, significance: float) -> Array:
    """`LIMITS` of the mean of ``length`` squared unit normals, each with the tail ``significance``."""
    if significance >= 1.0:
        return filled(LIMITS, lower=np.inf, upper=0.0)
    from scipy.special import chdtri

    lower, upper = (float(chdtri(length, p)) / length for p in (1.0 - significance, significance))
    return filled(LIMITS, lower=lower, upper=upper)


#: Smallest and largest length of the window; bounds v_min and v_max; weight of the new estimate; bounds of the variance
#: ratios; `LIMITS` of the shortest, the middle and the longest window.
SETTINGS = structure(
    shortest=int, longest=int, low=float, high=float, forgetting=float, lowest=float, highest=float,
    of_shortest=length(LIMITS), of_middle=length(LIMITS), of_longest=length(LIMITS),
)  # fmt: skip
#: Number of rows so far, whether there is an estimate, whether it contradicts the datasheet, and its elements. In the
#: memory the rows of `_push` follow.
MEMORY = structure(count=int, begun=int, contradicts=int, estimate=9)
_HEAD = length(MEMORY)


@helper
def _rows(settings: Array, memory: Array, m: int) -> Array:
    """The ring buffer in the memory."""
    count, width = settings.view(SETTINGS)[0].longest, _width(m)
    return memory[_HEAD : _HEAD + count * width].reshape((count, width))


class _Window(NamedTuple):
    """The last innovations, or residuals, of a window.

    Attributes
    ----------
    length : int
        Length of the window.
    rows : int
        Number of rows in it; less than the length until it is full.
    squares : (m m,) array
        Sum of v v', or of e e', row by row.
    prior : (m m,) array
        Sum of the H P H' that is subtracted, or of minus H P+ H'.
    """

    length: int
    rows: int
    squares: Vector
    prior: Vector


@kernel
def _window(settings: Vector, memory: Vector, prediction: Prediction) -> _Window:
    """The window with its length (eqs. 19 and 20), and its sums."""
    predicted, nominal = prediction.predicted, prediction.nominal
    own, count, m = settings.view(SETTINGS)[0], memory[:_HEAD].view(MEMORY)[0].count, nominal.shape[0]
    rows, shortest, longest = _rows(settings, memory, m), own.shortest, own.longest
    sums, length, n = np.zeros(rows.shape[1]), shortest, 0
    total = _epoch(sums, m)
    if longest > shortest and count > 1:
        n = min(longest, count)
        _sums(rows, count, n, sums)
        variance, trace = 0.0, 0.0
        for i in range(m):
            mean = total.innovation[i] / n
            variance += total.square[i * (m + 1)] / n - mean * mean
            trace += nominal[i, i] + predicted[i, i]
        length = adaptive_window(variance, trace, own.low, own.high, shortest, longest)
    if n != min(length, count):
        n = min(length, count)
        _sums(rows, count, n, sums)
    return _Window(length, n, total.residual, total.predicted)


@kernel
def _estimate(settings: Vector, memory: Vector, prediction: Prediction, window: _Window, variance: Vector) -> float:
    """Estimate the noise from a window (eqs. 16-18), and use it if the window contradicts the nominal one.

    Parameters
    ----------
    settings, memory : array
        As of a rule; the estimate in the memory is updated.
    prediction : Prediction
        Its noise is overwritten: with the estimate within its bounds, or with the nominal noise.
    window : _Window
        The window.
    variance : (m,) array
        Expected mean square of what is in the window, for each component.

    Returns
    -------
    float
        Length of the window.
    """
    nominal = prediction.nominal
    own, kept, m, n = settings.view(SETTINGS)[0], memory[:_HEAD].view(MEMORY)[0], nominal.shape[0], window.length
    forgetting = own.forgetting
    if not kept.begun:
        kept.begun, forgetting = 1, 1.0
    estimate = kept.estimate[: m * m].reshape((m, m))
    for i in range(m):
        for j in range(m):
            at = i * m + j
            mean = (window.squares[at] - window.prior[at] + (n - window.rows) * nominal[i, j]) / n
            estimate[i, j] += forgetting * (mean - estimate[i, j])
    limits = own.of_shortest if n == own.shortest else own.of_longest if n == own.longest else own.of_middle
    allowed, kept.contradicts = limits[:].view(LIMITS)[0], 0
    for i in range(m):
        if not allowed.lower <= 1.0 + (estimate[i, i] - nominal[i, i]) / variance[i] <= allowed.upper:
            kept.contradicts = 1
    if kept.contradicts:
        bound(estimate, nominal, own.lowest, own.highest, prediction.noise)
    else:
        copied(nominal, prediction.noise)
    return float(n)


@helper
def _add_innovation(settings: Vector, memory: Vector, prediction: Prediction) -> None:
    """Put an innovation into the window."""
    innovation, kept = prediction.innovation, memory[:_HEAD].view(MEMORY)[0]
    rows = _rows(settings, memory, innovation.size)
    _push(rows, kept.count, innovation, innovation, 1.0, prediction.predicted)
    kept.count += 1


@kernel
def _add_residual(settings: Vector, memory: Vector, prediction: Prediction) -> None:
    """Put the residual after an update with the noise of a prediction into the window."""
    innovation, predicted, noise = prediction.innovation, prediction.predicted, prediction.noise
    m, kept = innovation.size, memory[:_HEAD].view(MEMORY)[0]
    residual, after = np.empty(m), np.empty((m, m))
    posterior(innovation, predicted, noise, residual, after)
    _push(_rows(settings, memory, m), kept.count, innovation, residual, -1.0, after)
    kept.count += 1


@helper
def _of_innovations(prediction: Prediction) -> Vector:
    """Variances of the components of an innovation."""
    variance = np.empty(prediction.innovation.size)
    for i in range(variance.size):
        variance[i] = prediction.nominal[i, i] + prediction.predicted[i, i]
    return variance


@kernel(passed=True)
def from_innovations(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Estimate the noise from innovations, each with the H P H' of its own epoch; the result is that of `_estimate`."""
    _add_innovation(settings, memory, prediction)
    window = _window(settings, memory, prediction)
    return _estimate(settings, memory, prediction, window, _of_innovations(prediction))


@kernel(passed=True)
def from_innovations_as_printed(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Estimate the noise from innovations, all with the newest H P H'; the result is that of `_estimate`."""
    _add_innovation(settings, memory, prediction)
    window = _window(settings, memory, prediction)
    m = prediction.innovation.size
    for i in range(m):
        for j in range(m):
            window.prior[i * m + j] = window.rows * prediction.predicted[i, j]
    return _estimate(settings, memory, prediction, window, _of_innovations(prediction))


@kernel
def _from_earlier_residuals(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Estimate the noise from the residuals of earlier epochs; the result is that of `_estimate`."""
    variance = np.empty(prediction.innovation.size)
    for i in range(variance.size):  # a residual is R S^-1 times the innovation
        noise = prediction.nominal[i, i]
        variance[i] = noise * noise / (noise + prediction.predicted[i, i])
    return _estimate(settings, memory, prediction, _window(settings, memory, prediction), variance)


@kernel(passed=True)
def from_residuals(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Estimate the noise from the residuals of earlier epochs, and keep that of this one; as `_estimate`."""
    found = _from_earlier_residuals(settings, memory, common, readings, k, prediction)
    _add_residual(settings, memory, prediction)
    return found


class InnovationBased(EstimatedNoise):
    """Estimates R as a mean over a window of fixed or adaptive length.

    Mehra (1970), Mohamed and Schwarz (1999); Mao, Wang and Fu (2025), eqs. 16-20. For the M last innovations v::

        innovation:  R = 1/M sum(v v') - H P H'           (eqs. 16-17)
        residual:    R = 1/M sum(e e' + H P+ H')          e: residual after the update; always positive definite

    H P H' is the covariance of the prediction and H P+ H' that after the update. The residual of an epoch is known only
    after its noise, so with residuals the window ends one epoch earlier. Then ``R <- (1 - a) R_before + a R`` (eq. 18).
    The text of the paper suggests a long memory, but in the equation the new estimate has the weight a = 0.9. The
    figures of Table 2 agree with the equation, so it is used as printed. Eq. 17 subtracts the newest H P H'. The
    default subtracts from each v v' the H P H' of its own epoch; this is the same in steady state, and unbiased
    otherwise (after the start, in an outage). While the window is not full, the nominal R is used for the missing rows.
    Eq. 20 (`adaptive_window`) compares the scatter of the innovations with multiples of the nominal trace. The filter
    uses the estimate within bounds, because eq. 17 alone is often not positive definite.

    The datasheet is used until the innovations contradict it: for each component, if the mean square in the window is
    probable by chi-square with M degrees of freedom, the nominal R is used. An estimate from ten innovations scatters
    by 45 %, so its use without a fault would increase the error.

    Parameters
    ----------
    source : "innovation" or "residual"
        Data of the estimate: innovations, or residuals after the update.
    shortest, longest : int
        Smallest and largest length of the window [innovations], M_min and M_max of eq. 20; equal for a fixed window.
        An instrument of more than 1 Hz has so many for each hertz, so that the length is the same in seconds.
    low, high : float
        Bounds v_min and v_max of eq. 20, as multiples of the nominal trace.
    forgetting : float
        Weight a of the new estimate in eq. 18, in (0, 1]; over 1 s for an instrument of more than 1 Hz.
    newest : bool
        True: subtract the newest H P H' from all epochs, eq. 17 as printed.
    significance : float
        Probability that the test rejects the datasheet of a healthy instrument, for one component on one side, in
        (0, 1]; 1: the estimate is always used, as printed.
    always : bool
        True: every innovation counts, as printed: also one of a prediction that is less certain than the measurement
        (`EstimatedNoise`), and one of a wrong prediction (`PredictionTest`).
    """

    rule: Callable[..., float] = from_innovations
    reported = "window"

    def __init__(
        self,
        source: Literal["innovation", "residual"] = "innovation",
        shortest: int = 10,
        longest: int = 20,
        low: float = 2.0,
        high: float = 5.0,
        forgetting: float = 0.9,
        newest: bool = False,
        significance: float = 0.01,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "all",
        always: bool = False,
    ):
        super().__init__(lowest, highest, full, scope)
        if always:
            self.together, self.estimates = 0, False
        if source not in ("innovation", "residual"):
            raise ValueError(f"source = {source!r}: it must be 'innovation' or 'residual'")
        if not 1 <= shortest <= longest:
            raise ValueError(f"shortest = {shortest} and longest = {longest}: it must be 1 <= shortest <= longest")
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting = {forgetting:g}: it must lie in (0, 1]")
        if not 0.0 < significance <= 1.0:
            raise ValueError(f"significance = {significance:g}: it must lie in (0, 1]")
        self.significance = significance
        self.source, self.shortest, self.longest = source, shortest, longest
        self.low, self.high, self.forgetting, self.newest = low, high, forgetting, newest
        of_innovations = from_innovations_as_printed if newest else from_innovations
        self.rule = of_innovations if source == "innovation" else from_residuals

    def settings_of(self, per_second: float) -> Array:
        """As `EstimatedNoise.settings_of`."""
        shortest, longest = round(self.shortest * per_second), round(self.longest * per_second)
        return filled(
            SETTINGS, shortest=shortest, longest=longest, low=self.low, high=self.high,
            forgetting=1.0 - (1.0 - self.forgetting) ** (1.0 / per_second), lowest=self.lowest**2,
            highest=self.highest**2, of_shortest=_contradiction(shortest, self.significance),
            of_middle=_contradiction((shortest + longest) // 2, self.significance),
            of_longest=_contradiction(longest, self.significance),
        )  # fmt: skip

    def begun(self, per_second: float, m: int) -> Array:
        """As `EstimatedNoise.begun`: an empty window."""
        return np.concatenate([filled(MEMORY), np.zeros(round(self.longest * per_second) * _width(m))])

    def choose(self, innovation: Innovation) -> Array:
        """The bounded estimate of a full matrix, or the nominal noise."""
        name, nominal, noise = innovation.measurement.instrument, innovation.noise, np.empty_like(innovation.noise)
        residuals = self.rule is from_residuals
        found = self.ask(_from_earlier_residuals if residuals else self.rule, innovation, noise)
        self.report_number(name, found)
        settings, memory = self.memory_of(name)
        kept = memory[:_HEAD].view(MEMORY)[0]
        if kept.contradicts:
            noise = self.bounded(kept.estimate[: nominal.size].reshape(nominal.shape), nominal)
        if residuals:
            _add_residual(settings, memory, as_prediction(innovation, noise))
        return noise


class FixedWindow(InnovationBased):
    """Estimates R as the mean over a fixed number of innovations; in a graph, IAE-FGO-Fix of Mao, Wang and Fu (2025).

    Parameters
    ----------
    innovations : int
        Number of innovations in the window, M of eq. 17; of an instrument of more than 1 Hz, so many for each hertz.
    """

    def __init__(
        self,
        source: Literal["innovation", "residual"] = "innovation",
        innovations: int = 20,
        forgetting: float = 0.9,
        newest: bool = False,
        significance: float = 0.01,
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "all",
    ):
        super().__init__(
            source, innovations, innovations, forgetting=forgetting, newest=newest, significance=significance,
            lowest=lowest, highest=highest, full=full, scope=scope,
        )  # fmt: skip
