"""The iteration of a window: Gauss-Newton steps until the nodes have converged, or until the weights are to be asked.

The functions that it calls are handed over by a chain (`simnav.estimators.models.chain.Chain.moves`). If all of them
are kernels, the iteration is compiled code; if not, the same source runs in Python (``move_nodes.function``). It stops
where something is to be done that is rare or not compiled: a weighting, a step that is large, a window without a finite
solution. What is done then is in `simnav.estimators.solvers.window.WindowEstimator`.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.block_tridiagonal import half_squares, solve_chain
from simnav.estimators.algebra.factors import Rows, Window
from simnav.estimators.models.inertial_chain import InertialWindow, Moves
from simnav.kernel_types import Vector

__all__ = ["CHECKED_STEP", "DAMPING_FACTOR", "FIRST_DAMPING", "Limits", "Progress", "Weighed", "move_nodes"]

#: For a step that is larger than this the cost is checked [sigma].
CHECKED_STEP = 1.0
#: Initial damping after a rejected step, and the factor of its changes.
FIRST_DAMPING, DAMPING_FACTOR = 1e-2, 10.0


class Limits(NamedTuple):
    """When an iteration ends, and how it begins.

    Attributes
    ----------
    tolerance : float
        Size of a step at which the nodes have converged [sigma].
    iterations : int
        Largest number of steps in an epoch.
    incremental : bool
        Whether a step takes the older nodes as they were eliminated before.
    """

    tolerance: float
    iterations: int
    incremental: bool


class Weighed(NamedTuple):
    """What a weighting has said.

    Attributes
    ----------
    asked : bool
        Whether there is a weighting, which is asked before each step.
    settled : bool
        Whether the weights are those that are wanted.
    first : int
        The first node that has to do with a weight that is new; the number of nodes if there is none.
    """

    asked: bool
    settled: bool
    first: int


class Progress(NamedTuple):
    """The progress of the iteration in an epoch.

    Attributes
    ----------
    first : int
        First node that must be eliminated again.
    contraction : float
        Ratio of the size of the step after a new linearisation to the size of the steps before it.
    learned : float
        The last such ratio with the same weights, with which the next epoch begins.
    solved : int
        Number of linear systems that were solved.
    damping : float
        Damping lambda of the next step.
    latest : float
        Size of the last step.
    since : float
        Size of the steps since the last linearisation.
    before : float
        Size of the steps up to the last linearisation, where the last step led to one; else 0.
    linear : bool
        Whether linearising anew would move no node by more than the tolerance.
    cost : float
        Half the weighted sum of squares; known once the iteration is done.
    done : bool
        Whether the nodes have converged, or no further step is allowed.
    large : bool
        Whether the last step is larger than `CHECKED_STEP`, and not taken yet.
    lost : bool
        Whether there is no finite step.
    """

    first: int
    contraction: float
    learned: float
    solved: int = 0
    damping: float = 0.0
    latest: float = 0.0
    since: float = 0.0
    before: float = 0.0
    linear: bool = False
    cost: float = 0.0
    done: bool = False
    large: bool = False
    lost: bool = False


@helper
def _ratio(size: float, before: float, damping: float) -> float:
    """By how much a step, without damping, is smaller than what went before; 1 at most, and where nothing did."""
    return min(1.0, size / before) if before > 0.0 and damping == 0.0 else 1.0


@helper
def _solve(moves: Moves, window: Window, rows: Rows, damping: float, first: int) -> tuple[float, float]:
    """One step of all nodes; its largest component in sigmas, of all nodes and of those before ``first``."""
    prior = window.prior
    if first > 0:
        return solve_chain(window, rows, prior.covariance, prior.shift, damping, first)  # neither is used
    linear, mean = np.empty_like(prior.covariance), np.empty_like(prior.shift)
    moves.reference.at_node(prior.covariance, prior.shift, linear, mean)
    return solve_chain(window, rows, linear, mean, damping, first)


@kernel
def move_nodes(
    moves: Moves, graph: InertialWindow, rows: Rows, limits: Limits, weighed: Weighed, now: Progress, moved: Vector
) -> Progress:
    """Move the nodes towards the minimum of the cost, until it is reached or somebody is to be asked.

    Parameters
    ----------
    moves : Moves
        The functions that linearise and move the window.
    graph : InertialWindow
        The window.
    rows : Rows
        Where it is.
    limits : Limits
        When the iteration ends.
    weighed : Weighed
        What the weighting has said. If there is one, at most one step is made.
    now : Progress
        How far the iteration is.
    moved : (n,) array
        Shift of the newest node in this epoch so far; updated.

    Returns
    -------
    Progress
        How far it is now.
    """
    begin, end, window = rows.first_node, rows.first_node + rows.nodes, graph.window
    step, first, contraction, learned = window.nodes.step, min(now.first, weighed.first), now.contraction, now.learned
    solved, damping, latest, since, before = now.solved, now.damping, now.latest, now.since, now.before
    linear, cost, done, large, lost = now.linear, now.cost, False, False, False
    while True:
        if first == rows.nodes and weighed.settled and linear:  # the weights are as they were
            step[begin:end] = 0.0
            cost, done = half_squares(window, rows), True
            break
        size, older = _solve(moves, window, rows, damping, first)
        if not older <= CHECKED_STEP:  # too far from where the older nodes were linearised
            moves.linearise(graph, rows, 0)
            size, older = _solve(moves, window, rows, damping, 0)
        lost = not isfinite(size)
        if lost:
            break
        solved += 1
        if before > 0.0:
            contraction = _ratio(size, before, damping)
            if weighed.first == rows.nodes:  # other weights would have their share in it
                learned = contraction
        since += size
        final = not weighed.asked or (weighed.settled and _ratio(size, latest, damping) * size < limits.tolerance)
        linear = contraction * since < limits.tolerance
        latest, before = size, 0.0
        large = size > CHECKED_STEP
        if large:
            break
        done = (final and linear) or solved == limits.iterations
        keep = done or (not final and damping == 0.0 and limits.incremental)
        if keep:
            cost = moves.take_step(graph, rows)
            first = rows.nodes
        else:
            moves.retract(graph, rows, step[begin:end])
            moves.linearise(graph, rows, 0)
            first, before, since = 0, since, 0.0
            damping = damping / DAMPING_FACTOR if damping > FIRST_DAMPING else 0.0
        moved += step[end - 1]
        if done or weighed.asked:
            break
    return Progress(
        first, contraction, learned, solved, damping, latest, since, before, linear, cost, done, large, lost
    )
