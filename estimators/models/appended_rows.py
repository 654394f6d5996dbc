"""New rows of a window: what a motion, an intermediate state and a measurement become in its columns.

A step of a window writes them here, whether it is compiled (`simnav.estimators.models.new_factors`) or made by methods
(`simnav.estimators.models.chain.Chain`). What the state of a model is, and where it is kept, its chain knows.
"""

from __future__ import annotations

from simnav.compiled import helper, kernel
from simnav.estimators.algebra.factors import AidingFactors, Motions
from simnav.estimators.algebra.whitening import whitening
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.records import Record
from simnav.types import Array

from .intermediate_states import IntermediateStates

__all__ = ["MotionSinceNode", "append_aid", "append_aids", "append_between", "append_motion"]


class MotionSinceNode(Record):
    """The motion from the newest node to the front.

    Attributes
    ----------
    transition, noise : (n, n) arrays
        Transition matrix and process noise.
    elapsed : (1,) array
        Its time [s].
    """

    transition: Matrix
    noise: Matrix
    elapsed: Vector


@kernel
def append_motion(motions: Motions, row: int, since: MotionSinceNode, time: float) -> None:
    """Make the motion since the newest node a factor, up to a node at a time [s]; after it there is no motion."""
    n = since.transition.shape[0]
    for i in range(n):
        for j in range(n):
            motions.transition[row, i, j] = motions.jacobian[row, i, j] = since.transition[i, j]
            motions.noise[row, i, j] = since.noise[i, j]
            since.transition[i, j], since.noise[i, j] = 1.0 if i == j else 0.0, 0.0
        motions.begin_shift[row, i], motions.end_shift[row, i] = 0.0, 0.0
    whitening(motions.noise[row], motions.whitener[row])
    motions.time[row], motions.weight[row] = time, 1.0
    since.elapsed[0] = 0.0


@kernel
def append_between(between: IntermediateStates, row: int, since: MotionSinceNode, node: int) -> None:
    """Make the motion since the newest node that of an intermediate state; ``node`` is the number of that node."""
    n = between.shift.shape[1]
    between.node[row] = node
    for i in range(n):
        between.shift[row, i] = 0.0
        for j in range(n):
            between.transition[row, i, j] = between.jacobian[row, i, j] = since.transition[i, j]
            between.noise[row, i, j] = since.noise[i, j]


@helper
def append_aid(
    aids: AidingFactors, row: int, node: int, between: int, instrument: int, time: float, noise: Array, value: Array
) -> None:
    """Make a measurement with its (m, m) noise a factor of a node, at an intermediate state or at none (-1).

    The noise of the motion between them is added at the first linearisation. Noise and value are extended to three
    components.
    """
    m = noise.shape[0]
    aids.node[row], aids.between[row], aids.bare[row], aids.instrument[row] = node, between, between >= 0, instrument
    aids.components[row], aids.time[row], aids.weight[row] = m, time, 1.0
    for i in range(3):
        aids.value[row, i] = value[i] if i < value.size else 0.0
        for j in range(3):
            aids.noise[row, i, j] = noise[i, j] if max(i, j) < m else 1.0 if i == j else 0.0
    whitening(aids.noise[row], aids.whitener[row])


@kernel
def append_aids(
    aids: AidingFactors,
    row: int,
    node: int,
    between: int,
    instrument: IntegerVector,
    time: Vector,
    noise: Stack,
    value: Matrix,
) -> None:
    """Do `append_aid` for k measurements, from a row on."""
    for k in range(time.size):
        append_aid(aids, row + k, node, between, instrument[k], time[k], noise[k], value[k])
