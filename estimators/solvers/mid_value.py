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
from collections.abc import Mapping
from math import exp, hypot
from typing import ClassVar

import numpy as np

from simnav.estimators.adaptations.base import Adaptation
from simnav.estimators.composition import Solver
from simnav.estimators.models.suitable import ModelChoice
from simnav.estimators.weightings.base import Isolation, Weighting
from simnav.types import Array, Estimate, InitialState, Instruments, Measurements

from .iterated import Iteration
from .kalman import KalmanEstimator
from .state_difference import difference, displaced
from .window import WindowEstimator

__all__ = ["MidValueSelection", "middle"]

#: Memory of the disagreement [s].
MEMORY = 60.0


def middle(estimates: list[Estimate]) -> Estimate:
    """The middle value of each component of several estimates, with the covariance of their mixture about it.

    Parameters
    ----------
    estimates : list of Estimate
        Estimates of one time, with the same components and a covariance; of an even number the mean of the middle two.

    Returns
    -------
    Estimate
        The first one, with the middle state and the covariance of the mixture.
    """
    first = estimates[0]
    apart = np.stack([difference(one, first) for one in estimates])
    chosen = np.median(apart, axis=0)
    covariance = np.zeros((9, 9))
    for one, d in zip(estimates, apart - chosen, strict=True):
        assert one.covariance is not None
        covariance += (one.covariance + np.outer(d, d)) / len(estimates)
    return displaced(first, chosen, covariance)


class MidValueSelection(Solver):
    """The solver of the module.

    Diagnostics: ``apart``, the horizontal distance of the farthest of the three from the estimate [m];
    ``apart.plain``, ``apart.adaptive`` and ``apart.window``, that of each; those of the window under their names.
    Flags are those of the window. It is ``inconsistent`` where two of the three are.

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
        self._choice = model
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
        valid = [one for one in found.values() if _finite(one)]
        estimate = middle(valid or list(found.values()))
        self._remember(estimate, valid)
        diagnostics: dict[str, float | Array] = dict(found["window"].diagnostics)
        apart = {name: hypot(*difference(one, estimate)[:2].tolist()) for name, one in found.items()}
        diagnostics |= {f"apart.{name}": distance for name, distance in apart.items()}
        diagnostics["apart"] = max(apart.values())
        votes = [float(one.diagnostics["inconsistent"]) for one in found.values()]
        diagnostics["inconsistent"] = float(np.median(votes))
        estimate.diagnostics, estimate.flagged = diagnostics, found["window"].flagged
        return estimate

    def _remember(self, estimate: Estimate, valid: list[Estimate]) -> None:
        """Update the remembered disagreement, and add it to the covariance of the estimate in place."""
        assert estimate.covariance is not None
        squares = np.mean([difference(one, estimate) ** 2 for one in valid], axis=0) if valid else np.zeros(9)
        fading = exp(-(estimate.time - self._time) / MEMORY)
        self._disagreement = fading * self._disagreement + (1.0 - fading) * squares
        self._time = estimate.time
        added = self._disagreement.copy()
        added[:2] = added[:2].mean()
        estimate.covariance[np.diag_indices(9)] += added


def _finite(estimate: Estimate) -> bool:
    """Whether a solution has not diverged to numbers that are none."""
    vectors = (estimate.position, estimate.velocity, estimate.attitude, estimate.covariance)
    return all(v is None or bool(np.isfinite(v).all()) for v in vectors)
