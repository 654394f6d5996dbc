"""The rows ``ship-fgo`` and ``ship-fgo-full``: factor graphs for a ship without an INS, after paper 002."""

from __future__ import annotations

from math import radians
from typing import Any

from estimators.models.ship import ShipModel, require_ship_aids
from estimators.models.ship_chain import ShipChain
from estimators.solvers.full_graph import FullGraph
from estimators.solvers.window import WindowEstimator
from simnav.estimator import register
from simnav.types import InitialState, Instruments

__all__ = ["ShipFgo", "ShipFgoFull"]


class _ShipGraph(WindowEstimator):
    """What both share.

    Parameters
    ----------
    window, tolerance, iterations
        As for `WindowEstimator`.
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
    """

    def __init__(
        self,
        window: int | None,
        tolerance: float,
        iterations: int,
        *,
        acceleration: float = 0.05,
        turn_rate_deg: float = 0.6,
        turn_time: float = 10.0,
        current: float = 0.3,
        current_time: float = 3600.0,
        sway: float = 0.2,
    ):
        model = ShipModel(acceleration, radians(turn_rate_deg), turn_time, current, current_time, sway)
        super().__init__(ShipChain(model), window=window, tolerance=tolerance, iterations=iterations)

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; needs a heading, and a position or a speed."""
        require_ship_aids(instruments, self.name)
        super().reset(start, instruments)


@register("ship-fgo")
class ShipFgo(_ShipGraph):
    """Sliding-window factor graph on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    After the FGO of paper 002: GNSS factors, DR factors (the motion between epochs, driven by log and compass), DR
    error factors, and the marginalization factor that older epochs leave behind. The DR error factor, a random walk of
    the log and compass biases in the paper, is the Gauss-Markov motion of the bias states that the datasheets ask for
    (`estimators.models.ship`); a bias that they call constant does not walk.

    Parameters
    ----------
    window : int
        Epochs in the window.
    tolerance : float
        Largest component of a step, in its sigmas, at which the nodes have converged.
    iterations : int
        Most iterations an epoch.
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
    """

    def __init__(self, *, window: int = 20, tolerance: float = 1e-3, iterations: int = 10, **model: Any):
        super().__init__(window, tolerance, iterations, **model)


@register("ship-fgo-full")
class ShipFgoFull(FullGraph, _ShipGraph):
    """Full factor graph of a ship without an INS: every epoch since the start is estimated anew at every epoch.

    The graph of ``ship-fgo`` without a window (the baseline of paper 002's comparison of run times). It begins each
    epoch where it was at the last one, so that few iterations suffice; its cost still grows with the square of the
    length. After the run it returns the batch solution.

    Parameters
    ----------
    tolerance : float
        Largest component of a step, in its sigmas, at which the nodes have converged.
    iterations : int
        Most iterations an epoch.
    acceleration, turn_rate_deg, turn_time, current, current_time, sway : float
        Of the model, as for ``ship-ekf``.
    """

    slow = True

    def __init__(self, *, tolerance: float = 1e-3, iterations: int = 10, **model: Any):
        super().__init__(None, tolerance, iterations, **model)
