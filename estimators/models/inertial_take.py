"""All measurements of a step into the chain of an inertial model, in one kernel, where nothing chooses between them."""

from __future__ import annotations

from simnav.compiled import helper, kernel
from simnav.kernel_types import IntegerVector, Matrix, Stack, Vector
from simnav.types import Array

from .chain import attach_one, begin_motion
from .columns import Selection
from .filtering import Dynamics, Readings
from .measurements import HEADING, has_heading
from .propagation import MOTION_NUMBERS, Motion, Samples, carry_errors, motion_of, propagate_inertial

__all__ = ["TAKEN", "take_inertial"]

_STATE = ("time", "position", "velocity", "dcm", "bias", "calibration", "raw_rate")
#: The columns of `simnav.estimators.models.chain.Chain` that new rows are written to.
TAKEN = Selection(
    ("nodes", _STATE),
    ("motions", ("transition", "jacobian", "noise", "whitener", "begin_shift", "end_shift", "time", "weight")),
    ("aids", ("node", "fold", "instrument", "components", "bare", "time", "weight", "value", "noise", "whitener")),
    ("folds", ("node", "transition", "noise", "jacobian", "shift")),
    ("folds", _STATE),
)


@helper
def _keep(
    moving: Motion, calibration: Array, kept: tuple[Vector, Matrix, Matrix, Stack, Matrix, Matrix, Matrix], row: int
) -> None:
    """Write the state into a row."""
    position, velocity, dcm, bias, clock = moving.position, moving.velocity, moving.dcm, moving.bias, moving.clock
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
    dynamics: Dynamics,
    samples: Samples,
    readings: Readings,
    count: int,
    times: tuple[float, float, float],
    motion_since: tuple[Matrix, Matrix],
    numbers: tuple[int, int, int, int, int, int, int],
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
) -> tuple[float, tuple[int, int, int, int]]:
    """Do `Chain.take` for the chain of an inertial model.

    Parameters
    ----------
    dynamics, samples, readings, count
        As of `simnav.estimators.solvers.filter_step.filter_step`.
    times : tuple of float
        End of the step, spacing of the nodes, and time from the newest node to the state [s].
    motion_since : two (n, n) arrays
        Transition matrix and process noise of the motion since the newest node; updated.
    numbers : tuple of int
        Row of the next node, motion, aiding factor and fold; number of the newest node, of the next fold, and of the
        folds in the window.
    columns : tuple of tuples of arrays
        Whole columns, see `TAKEN`.

    Returns
    -------
    ahead : float
        Time from the newest node to the state [s].
    counts : tuple of int
        Numbers of new nodes, of new aiding factors, and of new folds; and of measurements that cannot be used.
    """
    until, spacing, ahead = times
    state, aids_table = motion_of(dynamics.numbers), dynamics.aids
    codes, noises, calibration = aids_table.codes, aids_table.figures, dynamics.numbers[MOTION_NUMBERS:]
    which, stamps, values, clock = readings.instrument, readings.time, readings.value, state.clock
    transition, process_noise, decay = dynamics.transition, dynamics.process_noise, dynamics.decay
    motion, motion_noise = motion_since
    node_at, motion_at, aid_at, fold_at, newest, next_fold, folds = numbers
    kept, motions, aids, folded, fold_kept = columns
    factor, jacobian, factor_noise, whitener, begin_shift, end_shift, motion_time, motion_weight = motions
    node, fold, instrument, components, bare, time, weight, value, aid_noise, aid_whitener = aids
    fold_node, fold_transition, fold_noise, fold_jacobian, fold_shift = folded
    n, nodes, attached, added, unused = motion.shape[0], 0, 0, 0, 0
    for k in range(count):
        begin, end = clock[0], min(stamps[k], until)
        if end > begin:
            dynamics.next_sample[0] = propagate_inertial(
                state, samples, dynamics.next_sample[0], end, dynamics.constants,
                (transition, process_noise, motion_noise), (calibration, decay, dynamics.density), end - begin,
            )  # fmt: skip
            carry_errors(transition, decay, end - begin, motion)
            ahead += end - begin
        s = which[k]
        d = codes[s, 1]
        if codes[s, 0] == HEADING and not has_heading(state.dcm):
            unused += 1
            continue
        if ahead > 0.0 and (stamps[k] == stamps[count - 1] or ahead >= spacing):
            row = motion_at + nodes
            begin_motion(motion, motion_noise, factor[row], jacobian[row], factor_noise[row], whitener[row])
            for i in range(n):
                begin_shift[row, i], end_shift[row, i] = 0.0, 0.0
            motion_time[row], motion_weight[row] = clock[0], 1.0
            _keep(state, calibration, kept, node_at + nodes)
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
            _keep(state, calibration, fold_kept, row)
            added += 1
        row = aid_at + attached
        node[row], instrument[row], components[row], time[row], weight[row] = newest, s, d, stamps[k], 1.0
        fold[row], bare[row] = next_fold + added - 1 if ahead > 0.0 else -1, ahead > 0.0
        attach_one(noises[s, : d * d].reshape((d, d)), values[k, :d], aid_noise[row], aid_whitener[row], value[row])
        attached += 1
    return ahead, (nodes, attached, added, unused)
