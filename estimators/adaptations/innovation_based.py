"""Measurement noise from a window of innovations (IAE) or of residuals (RAE)."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np

from simnav.compiled import kernel
from simnav.types import Array, Instruments

from .base import Innovation
from .noise import EstimatedNoise, Posterior, Scope

__all__ = ["FixedWindow", "InnovationBased", "adaptive_window"]


@kernel("i8(f8, f8, f8, f8, i8, i8)")
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


#: Columns of a row of a window: v; then, each (m, m), v v', e e', and H P H' or minus H P+ H'.
@kernel("void(f8[:, ::1], i8, f8[::1], f8[::1], f8, f8[:, ::1])")
def _push(rows: Array, count: int, innovation: Array, residual: Array, sign: float, predicted: Array) -> None:
    """Overwrite the oldest row with that of the present epoch."""
    m, row = innovation.size, rows[count % rows.shape[0]]
    at = m
    for i in range(m):
        row[i] = innovation[i]
        for j in range(m):
            row[at] = innovation[i] * innovation[j]
            row[at + m * m] = residual[i] * residual[j]
            row[at + 2 * m * m] = sign * predicted[i, j]
            at += 1


@kernel("f8(f8[:, ::1], i8, i8, i8)")
def _sum(rows: Array, count: int, n: int, column: int) -> float:
    """Sum of a column over the last n of ``count`` rows."""
    total = 0.0
    for k in range(count - n, count):
        total += rows[k % rows.shape[0], column]
    return total


@kernel("i8(f8[:, ::1], i8, f8[:, ::1], f8[:, ::1], Tuple((i8, i8, f8, f8)), b1, f8, f8[:, ::1])")
def _average(
    rows: Array, count: int, predicted: Array, nominal: Array, window: tuple[int, int, float, float], newest: bool,
    forgetting: float, estimate: Array,
) -> int:  # fmt: skip
    """Noise from the last innovations (eqs. 16-20).

    Parameters
    ----------
    rows : (r, ...) array
        Ring buffer of the rows of `_push`, one row for each epoch.
    count : int
        Number of epochs so far; the last r of them are in the buffer.
    predicted, nominal : (m, m) arrays
        H P H' and R.
    window : (int, int, float, float)
        Smallest and largest length of the window (equal for a fixed one); bounds v_min and v_max of the ratio of
        variances between which the length is adapted.
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
    shortest, longest, low, high = window
    m, ring = nominal.shape[0], rows.shape[0]
    length = shortest
    if longest > shortest and count > 1:
        n = min(longest, count, ring)
        variance, trace = 0.0, 0.0
        for i in range(m):
            mean = _sum(rows, count, n, i) / n
            variance += _sum(rows, count, n, m + i * (m + 1)) / n - mean * mean
            trace += nominal[i, i] + predicted[i, i]
        length = adaptive_window(variance, trace, low, high, shortest, longest)
    n = min(length, count, ring)
    for i in range(m):
        for j in range(m):
            at = m + i * m + j
            subtracted = n * predicted[i, j] if newest else _sum(rows, count, n, at + 2 * m * m)
            mean = (_sum(rows, count, n, at + m * m) - subtracted + (length - n) * nominal[i, j]) / length
            estimate[i, j] += forgetting * (mean - estimate[i, j])
    return length


@cache
def _contradiction(length: int, significance: float) -> tuple[float, float]:
    """Lower and upper limit of the mean of ``length`` squared unit normals, each with the tail ``significance``."""
    if significance >= 1.0:
        return np.inf, 0.0
    from scipy.special import chdtri

    return float(chdtri(length, 1.0 - significance)) / length, float(chdtri(length, significance)) / length


class _Window:
    """Ring buffer of the last rows of one instrument, the number of all rows, and the last estimate, for eq. 18.

    Attributes
    ----------
    shortest, longest, forgetting
        Parameters of `InnovationBased` at the rate of the instrument.
    """

    __slots__ = ("count", "estimate", "forgetting", "longest", "rows", "shortest")

    def __init__(self, shortest: int, longest: int, forgetting: float, m: int):
        self.shortest, self.longest, self.forgetting = shortest, longest, forgetting
        self.rows, self.count = np.zeros((longest, m + 3 * m * m)), 0
        self.estimate: Array | None = None

    def push(self, innovation: Array, residual: Array, sign: float, predicted: Array) -> None:
        """Store a row in place of the oldest one."""
        _push(self.rows, self.count, innovation, residual, sign, predicted)
        self.count += 1


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
    """

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
    ):
        super().__init__(lowest, highest, full, scope)
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

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._windows: dict[str, _Window] = {}

    def estimate(self, innovation: Innovation) -> Array:
        """The bounded estimate."""
        name, nominal = innovation.measurement.instrument, innovation.noise
        window = self._windows.get(name)
        if window is None:
            window = self._windows[name] = self._begun(name, len(nominal))
        if self.source == "residual":
            noise = self._believed(self._mean(name, window, innovation), innovation)
            after = Posterior(innovation, noise)
            window.push(innovation.residual, after.residual, -1.0, after.predicted)
            return noise
        window.push(innovation.residual, innovation.residual, 1.0, innovation.predicted)
        return self._believed(self._mean(name, window, innovation), innovation)

    def _begun(self, name: str, m: int) -> _Window:
        """The empty window of an instrument."""
        longer = self.longer[name]
        forgetting = 1.0 - (1.0 - self.forgetting) ** (1.0 / longer)
        return _Window(round(self.shortest * longer), round(self.longest * longer), forgetting, m)

    def _believed(self, estimate: Array, innovation: Innovation) -> Array:
        """The bounded estimate, or the nominal noise if the innovations do not contradict it."""
        nominal = innovation.noise
        low, high = _contradiction(self._length, self.significance)
        variances = (m.diagonal().tolist() for m in (estimate, nominal, innovation.predicted))
        for found, noise, predicted in zip(*variances, strict=True):
            # Variance of the squared quantity: an innovation, or a residual, which is R S^-1 times the innovation.
            variance = noise + predicted if self.source == "innovation" else noise * noise / (noise + predicted)
            if not low <= 1.0 + (found - noise) / variance <= high:
                return self.bounded(estimate, nominal)
        return nominal

    def _mean(self, name: str, window: _Window, innovation: Innovation) -> Array:
        """Eqs. 16-20."""
        forgetting = window.forgetting
        if window.estimate is None:
            window.estimate, forgetting = np.zeros_like(innovation.noise), 1.0
        bounds = window.shortest, window.longest, self.low, self.high
        length = _average(
            window.rows, window.count, innovation.predicted, innovation.noise, bounds,
            self.newest and self.source == "innovation", forgetting, window.estimate,
        )  # fmt: skip
        self._length = length
        self.report(f"window.{name}", length)
        return window.estimate


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
