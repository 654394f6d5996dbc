"""All measurements of a step of the inertial filter in one kernel, where nothing adapts between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from simnav.compiled import kernel
from simnav.types import Array, Integers, Measurement

from .base import NIS, RESULTS, SIZE, StepRule
from .inertial_update import assimilate_inertial
from .measurements import Aid
from .propagation import MOVING, SAMPLES, Moving, Samples, propagate_inertial

__all__ = ["STEP", "AidTable", "Matrices", "Measured", "Others", "Packet", "aid_of", "filter_inertial", "move_inertial"]

#: Of a model of n states: transition and process noise (15, 15), and covariance (n, n).
Matrices: TypeAlias = tuple[Array, Array, Array]
#: Calibration states (n - 15,), their rates of decay and densities of noise; and the correction (n,), overwritten.
Others: TypeAlias = tuple[Array, Array, Array, Array]
#: The instruments of a filter: their codes, numbers of components, and places of bias and scale factor (i, 4); lever
#: arms (i, 3) [m]; and the elements of their noise (i, 9).
AidTable: TypeAlias = tuple[Integers, Array, Array]
#: The k measurements of a step in order of their times: rows of their instruments (k,), times (k,) [s], values (k, 3);
#: overwritten, for each a row of results (`StepRule`).
Measured: TypeAlias = tuple[Integers, Array, Array, Array]


#: Types of the arguments of `filter_inertial`.
STEP = (
    f"{MOVING}, {SAMPLES}, i8, f8, f8[::1], UniTuple(f8[:, ::1], 3), UniTuple(f8[::1], 4), "
    "Tuple((Tuple((i8[:, ::1], f8[:, ::1], f8[:, ::1])), Tuple((i8[::1], f8[::1], f8[:, ::1], f8[:, ::1]))))"
)


@kernel()
def move_inertial(
    k: int, measured: Measured, state: Moving, samples: Samples, first: int, until: float, noise: Array,
    matrices: Matrices, others: Others,
) -> int:  # fmt: skip
    """Do `propagate_inertial` to the time of measurement k, or to the end of the step after the last one."""
    which, times, _, _ = measured
    time = min(times[k], until) if k < which.size else until
    elapsed = time - state[6][0]
    if elapsed > 0.0:
        calibrated = others[0], others[1], others[2]
        first = propagate_inertial(state, samples, first, time, noise, matrices, calibrated, elapsed)
    return first


@kernel()
def aid_of(row: int, aids: AidTable) -> tuple[Aid, Array]:
    """An instrument, and its noise (d, d)."""
    codes, arms, noises = aids
    d = codes[row, 1]
    return (codes[row, 0], arms[row], codes[row, 2], codes[row, 3]), noises[row, : d * d].reshape((d, d))


@kernel(f"i8({STEP})")
def filter_inertial(
    state: Moving, samples: Samples, first: int, until: float, noise: Array, matrices: Matrices, others: Others,
    packet: tuple[AidTable, Measured],
) -> int:  # fmt: skip
    """Do `propagate_inertial` and `assimilate_inertial` for each measurement of a step, and propagate to its end.

    Parameters
    ----------
    state, samples, first, noise
        As of `simnav.estimators.models.propagation.propagate_inertial`.
    until : float
        End of the step [s].
    matrices, others, packet : tuple of arrays
        See `Matrices` and `Others`; instruments and measurements, see `AidTable` and `Measured`.

    Returns
    -------
    int
        Index of the first sample that is not completely used.
    """
    aids, measured = packet
    which, _, values, results = measured
    position, velocity, dcm, _, bias, _, clock = state
    now = position, velocity, dcm, clock[12:15], bias, others[0]
    for k in range(which.size):
        first = move_inertial(k, measured, state, samples, first, until, noise, matrices, others)
        aid, nominal = aid_of(which[k], aids)
        results[k, NIS], results[k, SIZE] = assimilate_inertial(
            aid, values[k, : nominal.shape[0]], now, matrices[2], nominal, others[3]
        )
    return move_inertial(which.size, measured, state, samples, first, until, noise, matrices, others)


class Packet:
    """The measurements of a step as arrays, which are used again at the next step.

    Parameters
    ----------
    aids : tuple of arrays
        The instruments in the order of the rule, see `AidTable`.
    rule : StepRule
        How they are used.
    """

    def __init__(self, aids: AidTable, rule: StepRule):
        self.aids, self.rule = aids, rule
        self._row = {name: i for i, name in enumerate(rule.names)}
        self._make_room(8)

    def _make_room(self, count: int) -> None:
        self._room = np.zeros(count, np.int64), np.zeros(count), np.zeros((count, 3)), np.zeros((count, RESULTS))

    def fill(self, measurements: Sequence[Measurement]) -> Measured:
        """The measurements as arrays; those of the call before are overwritten."""
        count = len(measurements)
        if count > len(self._room[0]):
            self._make_room(2 * count)
        which, time, value, result = self._room
        for i, m in enumerate(measurements):
            which[i], time[i], value[i, : len(m.value)] = self._row[m.instrument], m.time, m.value
        return which[:count], time, value, result
