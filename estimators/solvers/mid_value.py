"""The middle one of three solutions: a plain filter, an adaptive filter and a window that isolates faults.

All three use the same measurements with the same model. They differ in what they assume of the measurements:

- the plain filter: every datasheet is right at all times;
- the adaptive filter: the noise of an instrument changes, and its error is not the same from one measurement to the
  next, unless another instrument is a witness that it is wrong (`simnav.estimators.adaptations.prediction`);
- the window: some measurements are wrong for a while, and those that are right agree with each other and the motion.

Each assumption fails in some runs, and nothing in one filter says that its own has failed. But a solution is far off by
itself only if its assumption fails alone. So the estimate is, component by component, the middle one of the three: it
is never the largest or the smallest, and it is wrong only if two of them are wrong to the same side. This is the
mid-value selection of redundant channels in flight control; here the channels are assumptions and not instruments.

The covariance is that of the mixture of the three, about the estimate, each as probable as the others: ::

    P = 1/3 sum(P_k + d_k d_k')

with the difference d_k of solution k from the estimate. So it grows where the solutions disagree, which none of the P_k
does. They come together again when the wrong one has pulled the others, or when the fault has ended and all have
followed it a little; that does not decide who was right. So their disagreement is remembered: the mean of the squared
d_k, which fades with a memory of `MEMORY` seconds, is added to the variances, to both horizontal components alike.

If all three are wrong in the same way the covariance does not grow: a lasting error of the only instrument that gives
the position is believed by all of them.

Sources: S. Osder, *Practical view of redundancy management application and theory*, J. Guidance, Control, and Dynamics
22(1), 1999 (mid-value selection); H. W. Sorenson and D. L. Alspach, *Recursive Bayesian estimation using Gaussian
sums*, Automatica 7(4), 1971 (moments of a mixture).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from math import cos, exp, hypot, inf, isfinite, remainder, sin, tau
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.composition import Solver
from simnav.estimators.models.inertial_errors import PART
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.weightings.base import Isolation, Weighting
from simnav.geometry.earth import radii_scalar
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

from .iterated import Iteration
from .kalman import KalmanEstimator
from .window import WindowEstimator

__all__ = ["MidValueSelection", "middle"]

#: Memory of the disagreement [s].
MEMORY = 60.0


def middle(estimates: Sequence[Estimate]) -> tuple[Estimate, Array]:
    """The middle value of each component of several estimates, with the covariance of their mixture about it.

    Parameters
    ----------
    estimates : sequence of Estimate
        Estimates of one time, with the same components and a covariance; of an even number the mean of the middle two.

    Returns
    -------
    estimate : Estimate
        The middle latitude, longitude, height, velocity, roll, pitch and yaw, and the covariance of the mixture.
    apart : (n, 9) array
        Each estimate minus the middle one [m, m/s, rad], to first order in the distance.
    """
    first, n = estimates[0], len(estimates)
    rows = np.array([_row(one, first) for one in estimates])
    ordered = np.sort(rows, axis=0)
    chosen = 0.5 * (ordered[(n - 1) // 2] + ordered[n // 2])
    apart = rows - chosen
    latitude, _, height, *velocity, roll, pitch, yaw = chosen.tolist()
    meridian, transverse = radii_scalar(sin(latitude))
    apart[:, PART.position] *= (meridian + height, (transverse + height) * cos(latitude), -1.0)
    c, s = cos(yaw), sin(yaw)
    turned = ((c * cos(pitch), s * cos(pitch), -sin(pitch)), (-s, c, 0.0), (0.0, 0.0, 1.0))
    apart[:, PART.attitude] = apart[:, PART.attitude] @ np.array(turned)
    covariance: Array = apart.T @ apart
    for one in estimates:
        assert one.covariance is not None
        covariance += one.covariance
    covariance /= n
    return Estimate(
        first.time,
        None if first.position is None else chosen[PART.position],
        None if first.velocity is None else np.array(velocity),
        None if first.attitude is None else np.array((roll, pitch, yaw)),
        covariance, first.estimated, states=first.states,
    ), apart  # fmt: skip


def _row(estimate: Estimate, first: Estimate) -> list[float]:
    """Position, velocity and attitude of an estimate; zeros for what it does not hold.

    Longitude, roll and yaw are on the same side of the circle as those of the first estimate.
    """
    row: list[float] = []
    for own, other, turning in (
        (estimate.position, first.position, _LONGITUDE),
        (estimate.velocity, first.velocity, ()),
        (estimate.attitude, first.attitude, _ROLL_YAW),
    ):
        values = [0.0, 0.0, 0.0] if own is None else own.tolist()
        if own is not None and other is not None and own is not other:
            for k in turning:
                start = float(other[k])
                values[k] = start + remainder(values[k] - start, tau)
        row += values
    return row


#: Components that go round the circle, of position and attitude.
_LONGITUDE, _ROLL_YAW = (1,), (0, 2)


class MidValueSelection(Solver):
    """The solver of the module.

    Diagnostics: ``apart``, the horizontal distance of the farthest of the three from the estimate [m];
    ``apart.plain``, ``apart.adaptive`` and ``apart.window``, that of each (infinite for one that has diverged); those
    of the window under their names. Flags are those of the window. It is ``inconsistent`` where two of the three are.

    Parameters
    ----------
    model : ErrorModel or ModelChoice
        The model of each of the three.
    adaptation : Adaptation
        The adaptation of the adaptive filter.
    weighting : Weighting
        The weighting of the window.
    isolation : Isolation, optional
        The isolation of faults in the window.
    iteration : Iteration, optional
        Repeated linearisation of both filters, as for `KalmanEstimator`.
    window : int
        Number of epochs in the window.
    tolerance, iterations, spacing
        As for `WindowEstimator`.
    """

    pieces: ClassVar[tuple[str, ...]] = ("model", "adaptation", "weighting", "isolation", "iteration")
    refuses: ClassVar[Mapping[str, str]] = {"smoother": "the estimate changes from one of its solutions to another"}

    def __init__(
        self,
        model: ModelChoice,
        adaptation: Adaptation,
        weighting: Weighting,
        isolation: Isolation | None = None,
        iteration: Iteration | None = None,
        *,
        window: int = 20,
        tolerance: float = 0.05,
        iterations: int = 15,
        spacing: float = 0.5,
    ):
        self._model_choice = model
        plain = KalmanEstimator(copy.deepcopy(model), iteration=iteration)
        adaptive = KalmanEstimator(copy.deepcopy(model), adaptation, copy.deepcopy(iteration))
        isolating = WindowEstimator(
            copy.deepcopy(model), weighting=weighting, isolation=isolation, window=window, tolerance=tolerance,
            iterations=iterations, spacing=spacing,
        )  # fmt: skip
        self._solutions: dict[str, KalmanEstimator | WindowEstimator] = {
            "plain": plain, "adaptive": adaptive, "window": isolating,
        }  # fmt: skip

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        """Begin a run; UnsuitableScenario if the model lacks an instrument."""
        for one in self._solutions.values():
            one.row, one.reports_all = self.label, self.reports_all
            one.reset(start, instruments)
        self._time, self._disagreement = start.time, np.zeros(9)

    def update(self, measurements: Measurements) -> Estimate:
        """Take one step's measurements, each at its own time."""
        found = {name: one.update(measurements) for name, one in self._solutions.items()}
        valid = {name: one for name, one in found.items() if _finite(one)} or found
        estimate, apart = middle(list(valid.values()))
        self._remember(estimate, apart)
        diagnostics: dict[str, float | Array] = dict(found["window"].diagnostics)
        distance = {name: hypot(*d[:2]) for name, d in zip(valid, apart.tolist(), strict=True)}
        diagnostics |= {f"apart.{name}": distance.get(name, inf) for name in found}
        diagnostics["apart"] = max(distance.values())
        votes = sorted(float(one.diagnostics["inconsistent"]) for one in found.values())
        diagnostics["inconsistent"] = votes[1]
        estimate.diagnostics, estimate.flagged = diagnostics, found["window"].flagged
        return estimate

    def _remember(self, estimate: Estimate, apart: Array) -> None:
        """Update the remembered disagreement, and add it to the covariance of the estimate in place."""
        assert estimate.covariance is not None
        fading = exp(-(estimate.time - self._time) / MEMORY)
        squares = (apart * apart).sum(axis=0)
        squares[:2] = 0.5 * (squares[0] + squares[1])
        self._disagreement = fading * self._disagreement + (1.0 - fading) / len(apart) * squares
        self._time = estimate.time
        estimate.covariance.flat[::10] += self._disagreement


def _finite(estimate: Estimate) -> bool:
    """Whether a solution has not diverged to numbers that are none."""
    position = estimate.position
    return (position is None or isfinite(position.sum())) and (
        estimate.covariance is None or isfinite(estimate.covariance.trace())
    )
