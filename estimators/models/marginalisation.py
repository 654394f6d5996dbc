"""What a window does when nodes leave: what they say about the first node that stays becomes its prior.

The elimination of a window (`simnav.estimators.algebra.block_tridiagonal`) has what all older nodes say about each
node: a covariance, and a mean relative to the node as it was linearised. The prior keeps the mean state and the
covariance there. In each iteration it is linearised again, at the node as it is then. How, depends on the model:
rotations compose.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from simnav.compiled import kernel
from simnav.estimators.algebra.factors import Rows, Window
from simnav.estimators.algebra.whitening import whitening
from simnav.kernel_types import Matrix, Vector
from simnav.records import Record

from .intermediate_states import IntermediateStates

__all__ = ["Leaving", "Reference", "keep_prior", "marginalise", "subtract_step"]


class Reference(Record):
    """How a model linearises a prior at another state.

    Attributes
    ----------
    at_node : callable
        From the covariance at the mean state and the shift of that state from a node, overwrites its last arguments
        with the covariance at the node and the mean as a step of it.
    at_mean : callable
        The inverse of ``at_node``, with the same order of covariances and vectors.
    relative_shift : callable
        Overwrites its third argument with a shift as seen from the state after a step.
    """

    at_node: Callable[[Matrix, Vector, Matrix, Vector], None]
    at_mean: Callable[[Matrix, Vector, Matrix, Vector], None]
    relative_shift: Callable[[Vector, Vector, Vector], None]


class Leaving(NamedTuple):
    """How many aiding factors and intermediate states leave with their nodes."""

    aids: int
    between: int


@kernel(passed=True)
def keep_prior(covariance: Matrix, shift: Vector, out: Matrix, out_shift: Vector) -> None:
    """The prior of a model without rotations, which is the same at any state."""
    for i in range(shift.size):
        out_shift[i] = shift[i]
        for j in range(shift.size):
            out[i, j] = covariance[i, j]


@kernel(passed=True)
def subtract_step(shift: Vector, step: Vector, out: Vector) -> None:
    """The shift of a model without rotations."""
    for j in range(shift.size):
        out[j] = shift[j] - step[j]


@kernel
def marginalise(leaving: int, window: Window, between: IntermediateStates, rows: Rows, reference: Reference) -> Leaving:
    """Make the prior of the first node that stays from what was predicted for it.

    Parameters
    ----------
    leaving : int
        Number of nodes that leave.
    window : Window
        The nodes and factors; the prior is overwritten.
    between : IntermediateStates
        The intermediate states.
    rows : Rows
        Where all of them are.
    reference : Reference
        How the model linearises a prior at another state.
    """
    stays, node, of_state = rows.first_node + leaving, window.aids.node, between.node
    prior, step = window.prior, window.nodes.step[stays]
    mean, shift = np.empty(prior.shift.size), np.empty(prior.shift.size)
    for j in range(mean.size):
        mean[j] = window.nodes.predicted_shift[stays, j] + step[j]
    reference.at_mean(window.nodes.predicted[stays], mean, prior.covariance, shift)
    reference.relative_shift(shift, step, prior.shift)
    whitening(prior.covariance, prior.whitener)
    aids, states, first = 0, 0, rows.base + leaving
    while aids < rows.aids and node[rows.first_aid + aids] < first:
        aids += 1
    while states < rows.between and of_state[rows.first_between + states] < first:
        states += 1
    return Leaving(aids, states)
