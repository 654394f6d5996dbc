"""The full graph: no node leaves the window, and every step estimates the whole trajectory again.

In real time its cost grows with the square of the length of the run. It differs from a sliding window only by the new
linearisation and new weights of old measurements. At the end it is the batch solution: the maximum a posteriori
trajectory.
"""

from __future__ import annotations

import numpy as np

from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.models.chains import Chain
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.weightings.base import Isolation, Weighting
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements, NavigationStates

from .looking_back import estimate_of_node
from .smoother import smoother_gains
from .window import WindowEstimator

__all__ = ["FullGraph"]


class FullGraph(WindowEstimator):
    """A window that keeps all its nodes, and smooths.

    Parameters
    ----------
    model, adaptation, weighting, isolation, tolerance, iterations, spacing
        The pieces and settings of the window, as for `WindowEstimator`.

    Attributes
    ----------
    smoothed_covariance : (T, 9, 9) array
        Covariances of the trajectory that `smooth` returned.
    """

    slow = True
    incremental = False

    def __init__(
        self,
        model: ModelChoice | Chain,
        adaptation: Adaptation | None = None,
        weighting: Weighting | None = None,
        isolation: Isolation | None = None,
        *,
        tolerance: float = 1e-3,
        iterations: int = 10,
        spacing: float = 0.5,
    ):
        super().__init__(
            model, adaptation, weighting, isolation,
            window=None, tolerance=tolerance, iterations=iterations, spacing=spacing,
        )  # fmt: skip

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run."""
        super().reset(start, instruments)
        self._ends: list[int] = []

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements; the estimate at its end, which becomes a node."""
        estimate = super().update(measurements)
        if self.chain.ahead > 0.0:
            self._extend()
        self._ends.append(len(self.chain.nodes) - 1)
        return estimate

    def smooth(self) -> NavigationStates | None:
        """The whole trajectory at the ends of all steps; None before the first."""
        if not self._ends:
            return None
        self._converge(0)
        covariances = self._smoothed_covariances()
        series = np.full((3, len(self._ends), 3), np.nan)
        self.smoothed_covariance = np.full((len(self._ends), 9, 9), np.nan)
        for row, node in enumerate(self._ends):
            out = estimate_of_node(self.chain, node, covariances[node])
            for kind, vector in enumerate((out.position, out.velocity, out.attitude)):
                if vector is not None:
                    series[kind, row] = vector
            if out.covariance is not None:
                self.smoothed_covariance[row] = out.covariance
        return NavigationStates(self.chain.nodes["time"][self._ends].copy(), *series)

    def _smoothed_covariances(self) -> Array:
        """Of all nodes, from all measurements (`simnav.estimators.solvers.smoother`)."""
        motions = self.chain.motions
        count = len(self.chain.nodes)
        predicted, filtered = self.chain.nodes["predicted"], self.chain.nodes["filtered"]
        smoothed: Array = filtered.copy()
        gains = smoother_gains(filtered[:-1], motions["jacobian"], predicted[1:])
        for k in range(count - 2, -1, -1):
            s = filtered[k] + gains[k] @ (smoothed[k + 1] - predicted[k + 1]) @ gains[k].T
            smoothed[k] = 0.5 * (s + s.T)
        return smoothed
