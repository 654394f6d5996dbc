"""The ship model of a filter that does not use dead reckoning: without a fix the ship stands still.

Jiang et al. (2026) print errors of 200 to 500 m at the end of outages of 60 s for their EKF and UKF, on ships of
6.5 m/s with compass and log. A filter that stays where the last fix was is off by the distance that the ship makes,
390 m. This model is that filter, for comparison. It is one reading of the printed figures, and not what the authors
say they did.
"""

from __future__ import annotations

import numpy as np

from simnav.types import Array, InitialState, Instruments, Measurement

from .base import Linearised
from .equations import equation_of
from .ship import POSITIONS, E, N, ShipModel
from .ship_kernels import U

__all__ = ["StandingShip"]


class StandingShip(ShipModel):
    """`ShipModel` whose position stays where it is while there are no fixes.

    The variance of the position then grows as if the speed were its error, so that the next fix is used.

    Parameters
    ----------
    patience : float
        Time without a fix after which the position stays where it is [s].
    """

    fused = False
    memory = ("_last_fix",)

    def __init__(self, patience: float = 1.5):
        if not patience > 0.0:
            raise ValueError(f"patience is {patience:g}; it must be a time above 0 s")
        super().__init__()
        self.patience = patience

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario if there is nothing that gives a speed and a heading."""
        self._last_fix = np.array(start.time, dtype=np.float64)
        return super().begin(start, instruments)

    def propagate(self, covariance: Array, until: float) -> None:
        """Advance the state and its covariance."""
        begin, place = self.time, self.position.copy()
        super().propagate(covariance, until)
        still_from = max(begin, float(self._last_fix) + self.patience)
        if until <= still_from:
            return
        self.position[:] = place
        waited, waited_before = until - float(self._last_fix), begin - float(self._last_fix)
        grown = float(self.x[U]) ** 2 * (waited**2 - waited_before**2)
        covariance[N, N] += grown
        covariance[E, E] += grown

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement; a fix ends the standing."""
        if equation_of(self.instruments[measurement.instrument]).name in POSITIONS:
            self._last_fix[...] = measurement.time
        return super().measure(measurement)
