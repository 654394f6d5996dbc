"""Graduated non-convexity: the robust cost is convex at first, and becomes non-convex while the window is solved.

H. Yang, P. Antonante, V. Tzoumas and L. Carlone, "Graduated non-convexity for robust spatial perception: from
non-minimal solvers to global outlier rejection", *IEEE Robotics and Automation Letters* 5(2), 2020. With
``u^2 = v' R^-1 v / c^2``, the weights are

- truncated least squares (``"tls"``, eq. 14; mu grows from ``1 / (2 u_max^2 - 1)``): 1 where ``u^2 <= mu / (mu + 1)``,
  0 where ``u^2 >= (mu + 1) / mu``, ``sqrt(mu (mu + 1)) / u - mu`` between;
- Geman-McClure (``"gm"``, eq. 12; mu falls from ``2 u_max^2`` to 1): ``(mu / (u^2 + mu))^2``.

v is the residual, R the covariance of the noise, c the constant of the cost, u_max the largest u, and mu the parameter
of convexity. Here mu changes by a factor at each Gauss-Newton iteration. A sliding window changes little from epoch to
epoch. So if no new measurement is an outlier (u > 1 after the window has been solved with it), mu keeps its final
value. Only an outlier starts a new schedule of mu, in which every measurement of the window is weighted again.

A channel that its siblings contradict, such as a satellite, is left out without a schedule
(`simnav.estimators.weightings.channel_vote`). At the mu with which a large outlier begins, all measurements have a
weight near zero, and the window follows the motion. From there it comes to exclude healthy ones that it would use if it
began with their full weight, and now and then it does not come back. While one of eight satellites was spoofed, the
schedules left out healthy ones twice as often as the window does without that satellite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import IntegerVector, Vector
from simnav.records import Record
from simnav.types import Array, Instruments

from .base import Factors
from .channel_vote import ChannelVote
from .m_estimators import constants, geman_mcclure, truncated
from .robust_weighting import RobustWeighting

__all__ = ["GraduatedNonConvexity", "softened_geman_mcclure", "softened_truncated"]

#: Value of mu at which truncated least squares ends: only between u = 0.95 and 1.05 the weights are not 0 or 1.
HARD = 10.0


@kernel(passed=True)
def softened_truncated(square: float, mu: float) -> float:
    """Weights of truncated least squares of u^2, softened by mu (Yang et al. 2020, eq. 14)."""
    root: float = np.sqrt(mu * (mu + 1.0) / np.maximum(square, 1e-12)) - mu
    weight: float = np.minimum(np.maximum(root, 0.0), 1.0)
    return weight


@kernel(passed=True)
def softened_geman_mcclure(square: float, mu: float) -> float:
    """Geman-McClure weights of u^2, softened by mu (Yang et al. 2020, eq. 12)."""
    return (mu / (square + mu)) ** 2


@kernel
def _squares(
    time: Vector, seen: float, norm: Vector, components: IntegerVector, scale: Vector, square: Vector
) -> tuple[int, float, float]:
    """Overwrite ``square`` with u^2 of each measurement.

    Returns
    -------
    int, float, float
        Index of the first measurement after the time ``seen``; largest u^2 from there on, and of all; 0 if there is
        none.
    """
    first, newest, largest = time.size, 0.0, 0.0
    while first > 0 and time[first - 1] > seen:
        first -= 1
    for i in range(norm.size):
        square[i] = norm[i] * norm[i] * scale[components[i]]
        largest = np.maximum(largest, square[i])
        if i >= first:
            newest = np.maximum(newest, square[i])
    return first, newest, largest


class _Softened(Record):
    """The weight of a cost, softened by mu, as a function of u^2 and mu."""

    weight: Callable[[float, float], float]


@kernel
def _soften(softened: _Softened, square: Vector, mu: float, weight: Vector) -> None:
    """Overwrite the weights of measurements with those of a cost that is softened by mu."""
    function = softened.weight
    for i in range(square.size):
        weight[i] = function(square[i], mu)


class GraduatedNonConvexity(RobustWeighting):
    """The weighting of the module.

    Parameters
    ----------
    cost : "tls" or "gm"
        Truncated least squares, or the cost of Geman and McClure.
    growth : float
        Factor of mu from one iteration to the next, above 1; 1.4 in the paper, which allows more iterations.
    efficiency : float
        Asymptotic efficiency of the final cost on Gaussian noise, from which c follows. For truncated least squares and
        95 %, c^2 is near the 99 % quantile of chi-square.
    """

    def __init__(
        self,
        cost: Literal["tls", "gm"] = "tls",
        growth: float = 3.0,
        efficiency: float = 0.95,
        smallest: float = 1e-3,
    ):
        if cost not in ("tls", "gm"):
            raise ValueError(f"cost = {cost!r}: it must be 'tls' or 'gm'")
        if not growth > 1.0:
            raise ValueError(f"growth = {growth:g}: it must be above 1")
        super().__init__(smallest)
        self.cost, self.growth = cost, growth
        tuned = constants(truncated if cost == "tls" else geman_mcclure, efficiency)
        self._scale = np.array([1.0, *tuned]) ** -2.0
        self._softened = _Softened(weight=softened_truncated if cost == "tls" else softened_geman_mcclure)
        self._vote = ChannelVote()

    def reset(self, instruments: Instruments) -> None:
        """Begin a run."""
        self._mu = self._hard = HARD if self.cost == "tls" else 1.0
        self._seen = self._newest = -np.inf
        self._fresh = True
        self._vote.reset(instruments)

    def begin(self) -> None:
        """Start an epoch."""
        self._vote.begin()
        self._seen, self._fresh = self._newest, True

    def choose(self, factors: Factors) -> bool:
        """Set the weights of the measurements; return False while mu still changes."""
        square = np.empty(len(factors.norm))
        first, newest, largest = _squares.unchecked(
            factors.time, self._seen, factors.norm, factors.components, self._scale, square
        )
        if self._fresh:
            self._fresh, self._mu = False, self._hard
            if first < len(square):
                self._newest = float(factors.time[-1])
                if newest > 1.0:
                    self._mu = self._softest(largest)
            if self._mu != self._hard and self._vote.ask(factors, square, first):
                return False
        elif self._vote.asked:
            settled = self._vote.answer(factors, square)
            if settled is None:
                return False
            if settled:
                self._mu = self._hard
        elif self._mu != self._hard:
            self._harden()
        _soften.unchecked(self._softened, square, self._mu, factors.weight)
        return self._mu == self._hard

    def _softest(self, largest: float) -> float:
        """The mu with which a schedule begins, from the largest u^2."""
        return 1.0 / (2.0 * largest - 1.0) if self.cost == "tls" else max(2.0 * largest, 1.0)

    def _harden(self) -> None:
        if self.cost == "tls":
            self._mu = min(self._mu * self.growth, self._hard)
        else:
            self._mu = max(self._mu / self.growth, self._hard)

    def diagnostics(self) -> dict[str, float | Array]:
        """The value of ``mu`` at the end of the epoch."""
        return {"mu": self._mu}
