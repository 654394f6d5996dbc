"""All measurements of a step into the chain of an inertial model, in one kernel, where nothing chooses between them."""

from __future__ import annotations

from typing import TypeAlias

from simnav.compiled import helper, kernel
from simnav.kernel_types import IntegerMatrix, IntegerVector, Matrix, Stack, Vector
from simnav.types import Array, Integers

from .chain import attach_one, begin_motion
from .columns import Selection
from .measurements import HEADING, has_heading
from .propagation import Moving, carry_errors, propagate_inertial

__all__ = ["TAKEN", "take_inertial"]

#: A state as a node and a fold keep it: time (K,); position, velocity (K, 3); rotation (K, 3, 3); biases (K, 6);
#: calibration states; angular rate (K, 3).
Kept: TypeAlias = tuple[Array, Array, Array, Array, Array, Array, Array]
_KEPT = "Tuple((f8[::1], f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1]))"
_STATE = ("time", "position", "velocity", "dcm", "bias", "calibration", "raw_rate")
Motions: TypeAlias = tuple[Array, Array, Array, Array, Array, Array, Array, Array]
_MOTIONS = (
    "Tuple((f8[:, :, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[::1]))"
)
Attached: TypeAlias = tuple[Integers, Integers, Integers, Integers, Integers, Array, Array, Array, Array, Array]
_ATTACHED = (
    "Tuple((i8[::1], i8[::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, :, ::1]))"
)
Folded: TypeAlias = tuple[Integers, Array, Array, Array, Array]
_FOLDED = "Tuple((i8[::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1]))"
#: The columns of `simnav.estimators.models.chain.Chain` that new rows are written to.
TAKEN = Selection(
    ("nodes", _STATE),
    ("motions", ("transition", "jacobian", "noise", "whitener", "begin_shift", "end_shift", "time", "weight")),
    ("aids", ("node", "fold", "instrument", "components", "bare", "time", "weight", "value", "noise", "whitener")),
    ("folds", ("node", "transition", "noise", "jacobian", "shift")),
    ("folds", _STATE),
)


@helper
def _keep(moving: Moving, calibration: Array, kept: Kept, row: int) -> None:
    """Write the state into a row."""
    position, velocity, dcm, _, bias, _, clock = moving
    kept[0][row] = clock[0]
    for i in range(3):
        kept[1][row, i], kept[2][row, i], kept[6][row, i] = position[i], velocity[i], clock[12 + i]
        for j in range(3):
            kept[3][row, i, j] = dcm[i, j]
    for i in range(6):
        kept[4][row, i] = bias[i]
    for i in range(calibration.size):
        kept[5][row, i] = calibration[i]


@kernel
def take_inertial(
    moving: tuple[Vector, Vector, Matrix, Vector, Vector, Vector, Vector],
    samples: tuple[Vector, Vector, Matrix, Matrix],
    times: tuple[float, float, float],
    noise: Vector,
    matrices: tuple[Matrix, Matrix, Matrix, Matrix],
    others: tuple[Vector, Vector, Vector],
    packet: tuple[tuple[IntegerMatrix, Matrix, Matrix], tuple[IntegerVector, Vector, Matrix, Matrix]],
    numbers: tuple[int, int, int, int, int, int, int, int],
    columns: tuple[
        tuple[Vector, Matrix, Matrix, Stack, Matrix, Matrix, Matrix],
        tuple[Stack, Stack, Stack, Stack, Matrix, Matrix, Vector, Vector],
        tuple[
            IntegerVector,
            IntegerVector,
            IntegerVector,
            IntegerVector,
            IntegerVector,
            Vector,
            Vector,
            Matrix,
            Stack,
            Stack,
        ],
        tuple[IntegerVector, Stack, Stack, Stack, Matrix],
        tuple[Vector, Matrix, Matrix, Stack, Matrix, Matrix, Matrix],
    ],
) -> tuple[int, float, tuple[int, int, int, int]]:
    """Do `Chain.take` for the chain of an inertial model.

    Parameters
    ----------
    moving, samples, noise, others
        As of `simnav.estimators.models.propagation.propagate_inertial`.
    times : tuple of float
        End of the step, spacing of the nodes, and time from the newest node to the state [s].
    matrices : two (15, 15) and two (n, n) arrays
        Transition matrix and process noise of the last propagation; of the motion since the newest node. Overwritten.
    packet : tuple of tuples
        The instruments and the measurements, see `simnav.estimators.models.inertial_step`.
    numbers : tuple of int
        Index of the first sample that is not completely used; row of the next node, motion, aiding factor and fold;
        number of the newest node, of the next fold, and of the folds in the window.
    columns : tuple of tuples of arrays
        Whole columns, see `TAKEN`.

    Returns
    -------
    first : int
        Index of the first sample that is not completely used.
    ahead : float
        Time from the newest node to the state [s].
    counts : tuple of int
        Numbers of new nodes, of new aiding factors, and of new folds; and of measurements that cannot be used.
    """
    until, spacing, ahead = times
    (codes, _, noises), (which, stamps, values, _) = packet
    calibration, decay, _ = others
    dcm, clock = moving[2], moving[6]
    transition, process_noise, motion, motion_noise = matrices
    propagated = transition, process_noise, motion_noise
    first, node_at, motion_at, aid_at, fold_at, newest, next_fold, folds = numbers
    kept, motions, aids, folded, fold_kept = columns
    factor, jacobian, factor_noise, whitener, begin_shift, end_shift, motion_time, motion_weight = motions
    node, fold, instrument, components, bare, time, weight, value, aid_noise, aid_whitener = aids
    fold_node, fold_transition, fold_noise, fold_jacobian, fold_shift = folded
    n, nodes, attached, added, unused = motion.shape[0], 0, 0, 0, 0
    for k in range(which.size):
        begin, end = clock[0], min(stamps[k], until)
        if end > begin:
            first = propagate_inertial(moving, samples, first, end, noise, propagated, others, end - begin)
            carry_errors(transition, decay, end - begin, motion)
            ahead += end - begin
        s = which[k]
        d = codes[s, 1]
        if codes[s, 0] == HEADING and not has_heading(dcm):
            unused += 1
            continue
        if ahead > 0.0 and (stamps[k] == stamps[which.size - 1] or ahead >= spacing):
            row = motion_at + nodes
            begin_motion(motion, motion_noise, factor[row], jacobian[row], factor_noise[row], whitener[row])
            for i in range(n):
                begin_shift[row, i], end_shift[row, i] = 0.0, 0.0
            motion_time[row], motion_weight[row] = clock[0], 1.0
            _keep(moving, calibration, kept, node_at + nodes)
            nodes += 1
            newest += 1
            ahead = 0.0
        row = fold_at + added
        if ahead > 0.0 and (folds + added == 0 or fold_node[row - 1] != newest or fold_kept[0][row - 1] != clock[0]):
            fold_node[row] = newest
            for i in range(n):
                fold_shift[row, i] = 0.0
                for j in range(n):
                    fold_transition[row, i, j] = fold_jacobian[row, i, j] = motion[i, j]
                    fold_noise[row, i, j] = motion_noise[i, j]
            _keep(moving, calibration, fold_kept, row)
            added += 1
        row = aid_at + attached
        node[row], instrument[row], components[row], time[row], weight[row] = newest, s, d, stamps[k], 1.0
        fold[row], bare[row] = next_fold + added - 1 if ahead > 0.0 else -1, ahead > 0.0
        attach_one(noises[s, : d * d].reshape((d, d)), values[k, :d], aid_noise[row], aid_whitener[row], value[row])
        attached += 1
    return first, ahead, (nodes, attached, added, unused)
