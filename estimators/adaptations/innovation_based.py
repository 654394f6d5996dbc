"""Measurement noise from a window of innovations (IAE) or of residuals (RAE)."""

from __future__ import annotations

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
from .noise import EstimatedNoise, Scope
from .rules import copied
from .scaled_noise import bound

__all__ = ["FixedWindow", "InnovationBased", "adaptive_window", "innovation_noise"]


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
    """What a window keeps of an innovation of m components, or its sums over some of them.

    Attributes
    ----------
    innovation : (m,) array
        The innovation v.
    square, residual : (m, m) array
        v v', and e e' of the residual e.
    predicted : (m, m) array
        H P H', or minus H P+ H'.
    """

    innovation: Vector
    square: Matrix
    residual: Matrix
    predicted: Matrix


@helper
def _width(m: int) -> int:
    """Number of elements of a row of a window, of innovations of m components."""
    return m + 3 * m * m


@helper
def _epoch(row: Vector, m: int) -> _Epoch:
    """The parts of a row of a window, or of the sums over its rows; views."""
    first, second, third = m, m + m * m, m + 2 * m * m
    return _Epoch(
        row[:first], row[first:second].reshape((m, m)), row[second:third].reshape((m, m)), row[third:].reshape((m, m))
    )


@helper
def _push(rows: Matrix, count: int, innovation: Vector, residual: Vector, sign: float, predicted: Matrix) -> None:
    """Overwrite the oldest row with that of the present epoch."""
    m = innovation.size
    epoch = _epoch(rows[count % rows.shape[0]], m)
    for i in range(m):
        epoch.innovation[i] = innovation[i]
        for j in range(m):
            epoch.square[i, j] = innovation[i] * innovation[j]
            epoch.residual[i, j] = residual[i] * residual[j]
            epoch.predicted[i, j] = sign * predicted[i, j]


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


class _Window(NamedTuple):
    """The length of a window.

    Attributes
    ----------
    shortest, longest : int
        Smallest and largest length; equal for a fixed one.
    low, high : float
        Bounds v_min and v_max of the ratio of variances between which the length is adapted.
    """

    shortest: int
    longest: int
    low: float
    high: float


@helper
def _average(
    rows: Matrix,
    count: int,
    predicted: Matrix,
    nominal: Matrix,
    window: _Window,
    newest: bool,
    forgetting: float,
    estimate: Matrix,
) -> int:
    """Noise from the last innovations (eqs. 16-20).

    Parameters
    ----------
    rows : (r, ...) array
        Ring buffer of the rows of `_push`, one `_Epoch` each.
    count : int
        Number of epochs so far; the last r of them are in the buffer.
    predicted, nominal : (m, m) arrays
        H P H' and R.
    window : _Window
        The lengths that it may have.
    newest : bool
        True: subtract the newest H P H' from all epochs; False: from each epoch its own.
    forgetting : float
        Weight of the mean in the new estimate (a of eq. 18).
    estimate : (m, m) array
        The last estimate of R; updated.

    Returns
    -------
    int
        Length of the window.
    """
    shortest, longest = window.shortest, window.longest
    m, ring, sums = nominal.shape[0], rows.shape[0], np.zeros(rows.shape[1])
    total, length, n = _epoch(sums, m), shortest, 0
    if longest > shortest and count > 1:
        n = min(longest, count, ring)
        _sums(rows, count, n, sums)
        variance, trace = 0.0, 0.0
        for i in range(m):
            mean = total.innovation[i] / n
            variance += total.square[i, i] / n - mean * mean
            trace += nominal[i, i] + predicted[i, i]
        length = adaptive_window(variance, trace, window.low, window.high, shortest, longest)
    if n != min(length, count, ring):
        n = min(length, count, ring)
        _sums(rows, count, n, sums)
    for i in range(m):
        for j in range(m):
            subtracted = n * predicted[i, j] if newest else total.predicted[i, j]
            mean = (total.residual[i, j] - subtracted + (length - n) * nominal[i, j]) / length
            estimate[i, j] += forgetting * (mean - estimate[i, j])
    return length


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


#: Smallest and largest length of the window; bounds v_min and v_max; weight of the new estimate; whether the newest
#: H P H' is subtracted, the data are residuals, and NumPy bounds the estimate; bounds of the variance ratios; `LIMITS`
#: of the shortest, the middle and the longest window.
SETTINGS = structure(
    shortest=int, longest=int, low=float, high=float, forgetting=float, newest=int, residual=int, full=int,
    lowest=float, highest=float, of_shortest=length(LIMITS), of_middle=length(LIMITS), of_longest=length(LIMITS),
)  # fmt: skip
#: Number of rows so far, whether there is an estimate, and its elements. In the memory the rows of `_push` follow.
MEMORY = structure(count=int, begun=int, estimate=9)
_HEAD = length(MEMORY)


@helper
def _rows(settings: Array, memory: Array, m: int) -> Array:
    """The ring buffer in the memory."""
    count, width = settings.view(SETTINGS)[0].longest, _width(m)
    return memory[_HEAD : _HEAD + count * width].reshape((count, width))


@kernel
def _remember(settings: Vector, memory: Vector, innovation: Vector, predicted: Matrix, noise: Matrix) -> None:
    """Store the residual after an update with the noise."""
    m = innovation.size
    residual, after = np.empty(m), np.empty((m, m))
    posterior(innovation, predicted, noise, residual, after)
    kept = memory[:_HEAD].view(MEMORY)[0]
    _push(_rows(settings, memory, m), kept.count, innovation, residual, -1.0, after)
    kept.count += 1


@helper
def _contradicted(limits: Array, residual: int, estimate: Array, nominal: Array, predicted: Array) -> bool:
    """Whether the innovations, or residuals, contradict the nominal noise in a component: beyond some `LIMITS`."""
    allowed = limits[:].view(LIMITS)[0]
    for i in range(nominal.shape[0]):
        noise, prior = nominal[i, i], predicted[i, i]
        # Variance of the squared quantity: an innovation, or a residual, which is R S^-1 times the innovation.
        variance = noise * noise / (noise + prior) if residual else noise + prior
        if not allowed.lower <= 1.0 + (estimate[i, i] - noise) / variance <= allowed.upper:
            return True
    return False


@kernel(passed=True)
def innovation_noise(
    settings: Vector, memory: Vector, common: Vector, readings: Readings, k: int, prediction: Prediction
) -> float:
    """Estimate the noise (`InnovationBased`), and write it into ``noise`` within its bounds, or the nominal one.

    Returns
    -------
    float
        Length of the window; its negative if the innovations contradict the nominal noise.
    """
    innovation, _, predicted, nominal, noise = prediction
    m = innovation.size
    own, kept = settings.view(SETTINGS)[0], memory[:_HEAD].view(MEMORY)[0]
    rows = _rows(settings, memory, m)
    if not own.residual:
        _push(rows, kept.count, innovation, innovation, 1.0, predicted)
        kept.count += 1
    forgetting = own.forgetting
    if not kept.begun:
        kept.begun, forgetting = 1, 1.0
    estimate = kept.estimate[: m * m].reshape((m, m))
    window = _Window(own.shortest, own.longest, own.low, own.high)
    n = _average(rows, kept.count, predicted, nominal, window, own.newest > 0, forgetting, estimate)
    limits = own.of_shortest if n == own.shortest else own.of_longest if n == own.longest else own.of_middle
    contradicted = _contradicted(limits, own.residual, estimate, nominal, predicted)
    if contradicted:
        bound(estimate, nominal, own.lowest, own.highest, noise)
    else:
        copied(nominal, noise)
    if own.residual and not own.full:
        _remember(settings, memory, innovation, predicted, noise)
    return -float(n) if contradicted else float(n)


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

    rule = innovation_noise
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

    def settings_of(self, longer: float) -> Array:
        """As `EstimatedNoise.settings_of`."""
        shortest, longest = round(self.shortest * longer), round(self.longest * longer)
        residual = self.source == "residual"
        return filled(
            SETTINGS, shortest=shortest, longest=longest, low=self.low, high=self.high,
            forgetting=1.0 - (1.0 - self.forgetting) ** (1.0 / longer), newest=self.newest and not residual,
            residual=residual, full=self.full, lowest=self.lowest**2, highest=self.highest**2,
            of_shortest=_contradiction(shortest, self.significance),
            of_middle=_contradiction((shortest + longest) // 2, self.significance),
            of_longest=_contradiction(longest, self.significance),
        )  # fmt: skip

    def begun(self, longer: float, m: int) -> Array:
        """As `EstimatedNoise.begun`: an empty window."""
        return np.concatenate([filled(MEMORY), np.zeros(round(self.longest * longer) * _width(m))])

    def estimate(self, innovation: Innovation) -> Array:
        """The bounded estimate of a full matrix, or the nominal noise."""
        m, residual, predicted, nominal, *_ = innovation
        own, noise = self.memory_of(m.instrument), nominal
        found = self.ask(innovation_noise, innovation, np.empty_like(nominal))
        self.report_number(m.instrument, found)
        if found < 0.0:
            elements = own[1][:_HEAD].view(MEMORY)[0].estimate[: nominal.size]
            noise = self.bounded(elements.reshape(nominal.shape), nominal)
        if self.source == "residual":
            _remember(*own, residual, predicted, noise)
        return noise

    def said(self, numbers: Array) -> Array:
        """The length of the window; the number has a sign."""
        return np.floor(np.abs(numbers))


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
