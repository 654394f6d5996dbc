"""Measurement noise from a window of innovations (IAE) or of residuals (RAE)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from estimators.adaptations.base import Innovation
from estimators.adaptations.noise import EstimatedNoise, Posterior, Scope
from simnav.compiled import kernel
from simnav.types import Array, Instruments

__all__ = ["InnovationBased", "Window", "adaptive_window"]


def adaptive_window(variance: float, nominal: float, low: float, high: float, shortest: int, longest: int) -> int:
    """Length of the window after paper 001, eq. 20: the more the innovations scatter, the longer.

    Parameters
    ----------
    variance : float
        Mean squared distance of the innovations in the window from their mean (eq. 19).
    nominal : float
        Trace of the nominal innovation covariance, in the same unit.
    low, high : float
        v_min and v_max, which the paper does not give, as multiples of ``nominal``.
    shortest, longest : int
        M_min and M_max.
    """
    if variance > high * nominal:
        return longest
    return (shortest + longest) // 2 if variance > low * nominal else shortest


@kernel("void(f8[:, ::1], i8, i8, f8[::1])")
def _sum_before(rows, end, count, total):  # type: ignore[no-untyped-def]
    """Sum of the ``count`` rows of a ring that end before ``end``."""
    length = rows.shape[0]
    for j in range(total.size):
        total[j] = 0.0
    for k in range(end - count, end):
        row = rows[k % length]
        for j in range(total.size):
            total[j] += row[j]


class Window:
    """The last rows of numbers of one instrument, in a ring.

    Parameters
    ----------
    length : int
        How many are kept.
    size : int
        Of a row.

    Attributes
    ----------
    count : int
        Rows added so far.
    smoothed : list of float or None
        The last estimate, for eq. 18.
    """

    __slots__ = ("_rows", "_total", "count", "length", "smoothed")

    def __init__(self, length: int, size: int):
        self.length, self.count = length, 0
        self._rows, self._total = np.zeros((length, size)), np.empty(size)
        self.smoothed: list[float] | None = None

    def add(self, row: list[float]) -> None:
        """Keep a row; the oldest goes."""
        self._rows[self.count % self.length] = row
        self.count += 1

    def sums(self, n: int) -> tuple[int, list[float]]:
        """How many the last n are, which may be fewer, and their sum."""
        n = min(n, self.count, self.length)
        _sum_before(self._rows, self.count, n, self._total)
        listed: list[float] = self._total.tolist()
        return n, listed


class InnovationBased(EstimatedNoise):
    """R as the mean over a window, of fixed or adaptive length.

    Mehra (1970), Mohamed and Schwarz (1999); paper 001, eqs. 16-20. For the M last innovations v::

        innovation:  R = 1/M sum(v v') - H P H'           (eqs. 16-17)
        residual:    R = 1/M sum(e e' + H P+ H')          e: residual after the update; positive definite always

    The residual of an epoch is known when its noise is: there the window ends one epoch earlier. Then
    ``R <- (1 - a) R_before + a R`` (eq. 18). The text of the paper suggests memory, the equation gives the new estimate
    the weight a = 0.9; the figures of its Table 2 agree with the equation, so it is built as printed. Eq. 17 subtracts
    the newest H P H'; the default subtracts from each v v' the H P H' of its own epoch, which is the same in steady
    state and unbiased outside of it (after the start, in an outage). While the window is not full, the nominal R stands
    for what it lacks. Eq. 20 (`adaptive_window`) compares the scatter of the innovations with multiples of the nominal
    trace. The filter uses the estimate within bounds; eq. 17 alone is often not positive definite.

    Parameters
    ----------
    source : "innovation" or "residual"
    shortest, longest : int
        M_min and M_max; equal for a fixed window.
    low, high : float
        v_min and v_max in units of the nominal trace.
    forgetting : float
        a, in (0, 1].
    newest : bool
        True: eq. 17 as printed.
    lowest, highest, full, scope
        See `EstimatedNoise`.
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
        lowest: float = 1.0,
        highest: float = 30.0,
        full: bool = False,
        scope: Scope = "fixes",
    ):
        super().__init__(lowest, highest, full, scope)
        if source not in ("innovation", "residual"):
            raise ValueError(f"source = {source!r}: it must be 'innovation' or 'residual'")
        if not 1 <= shortest <= longest:
            raise ValueError(f"shortest = {shortest} and longest = {longest}: it must be 1 <= shortest <= longest")
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting = {forgetting:g}: it must lie in (0, 1]")
        self.source, self.shortest, self.longest = source, shortest, longest
        self.low, self.high, self.forgetting, self.newest = low, high, forgetting, newest

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(instruments)
        self._windows: dict[str, Window] = {}

    def estimate(self, innovation: Innovation) -> Array:
        """The bounded estimate."""
        name, nominal = innovation.measurement.instrument, innovation.noise
        v: list[float] = innovation.residual.tolist()
        m = len(v)
        window = self._windows.get(name)
        if window is None:
            window = self._windows[name] = Window(self.longest, m + 3 * (m * m if self.full else m))
        if self.source == "residual":
            noise = self.bounded(self._mean(name, window, innovation), nominal)
            after = Posterior(innovation, noise)
            added = [-p for p in self.entries(after.predicted)]  # sums subtract it
            window.add([*v, *self.squares(innovation.residual), *self.squares(after.residual), *added])
            return noise
        squares = self.squares(innovation.residual)
        window.add([*v, *squares, *squares, *self.entries(innovation.predicted)])
        return self.bounded(self._mean(name, window, innovation), nominal)

    def _mean(self, name: str, window: Window, innovation: Innovation) -> list[float]:
        """Eqs. 16-18; the rows of a window are v, v v', e e' and H P H' (minus H P+ H' for residuals)."""
        nominal, now = self.entries(innovation.noise), self.entries(innovation.predicted)
        m, size = len(innovation.residual), len(nominal)
        length = self.shortest
        if self.longest > self.shortest and window.count > 1:
            n, total = window.sums(self.longest)
            squares = total[m : m + size : m + 1 if self.full else 1]
            # Mean of the squares less square of the mean
            variance = sum(squares) / n - sum(x * x for x in total[:m]) / n**2
            trace = sum(nominal[:: m + 1] + now[:: m + 1] if self.full else nominal + now)
            length = adaptive_window(variance, trace, self.low, self.high, self.shortest, self.longest)
        self.report(f"window.{name}", length)
        n, total = window.sums(length) if window.count else (0, [0.0] * (m + 3 * size))
        samples, predicted = total[m + size : m + 2 * size], total[m + 2 * size :]
        if self.newest and self.source == "innovation":
            predicted = [n * p for p in now]
        lacking = length - n
        mean = [(s - p + lacking * r) / length for s, p, r in zip(samples, predicted, nominal)]
        if window.smoothed is not None:
            a = self.forgetting
            mean = [(1.0 - a) * before + a * new for before, new in zip(window.smoothed, mean)]
        window.smoothed = mean
        return mean
