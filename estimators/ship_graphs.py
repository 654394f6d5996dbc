"""The rows ``ship-fgo`` and ``ship-fgo-full``: factor graphs for a ship without an INS, after paper 002."""

from __future__ import annotations

from typing import Any

from simnav.estimator import register
from simnav.estimators.models.ship import ShipModel
from simnav.estimators.models.ship_chain import ShipChain
from simnav.estimators.ship_row import ShipRow
from simnav.estimators.solvers.full_graph import FullGraph
from simnav.estimators.solvers.window import WindowEstimator

__all__ = ["ShipFgo", "ShipFgoFull"]


class _ShipGraph(ShipRow):
    """A ship's row whose solver is a graph."""

    def _given(self, model: ShipModel) -> Any:
        return ShipChain(model)


@register("ship-fgo")
class ShipFgo(_ShipGraph, WindowEstimator):
    """Sliding-window factor graph on GNSS, compass and log, for a ship without an INS: the states of ``ship-ekf``.

    After the FGO of paper 002: GNSS factors, DR factors (the motion between epochs, driven by log and compass), DR
    error factors, and the marginalization factor that older epochs leave behind. The DR error factor, a random walk of
    the log and compass biases in the paper, is the Gauss-Markov motion of the bias states that the datasheets ask for
    (`simnav.estimators.models.ship`); a bias that they call constant does not walk.

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


@register("ship-fgo-full")
class ShipFgoFull(_ShipGraph, FullGraph):
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
