"""All measurements of a step of the inertial filter in one kernel, where nothing adapts between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from simnav.compiled import kernel
from simnav.kernel_types import IntegerMatrix, IntegerVector, Matrix, Vector
from simnav.types import Array, Integers, Measurement

from .base import NIS, RESULTS, SIZE, AidTable, StepRule
from .inertial_update import assimilate_inertial
from .propagation import MOVING, SAMPLES, propagate_inertial

__all__ = ["STEP", "Matrices", "Measured", "Others", "Packet", "filter_inertial"]

#: Of a model of n states: transition and process noise (15, 15), and covariance (n, n).
Matrices: TypeAlias = tuple[Array, Array, Array]
#: Calibration states (n - 15,), their rates of decay and densities of noise; and the correction (n,), overwritten.
Others: TypeAlias = tuple[Array, Array, Array, Array]
#: The k measurements of a step in order of their times: rows of their instruments (k,), times (k,) [s], values (k, 3);
#: overwritten, for each a row of results (`StepRule`).
Measured: TypeAlias = tuple[Integers, Array, Array, Array]


#: Types of the arguments of `filter_inertial`.
STEP = (
    f"{MOVING}, {SAMPLES}, i8, f8, f8[::1], UniTuple(f8[:, ::1], 3), UniTuple(f8[::1], 4), "
    "Tuple((Tuple((i8[:, ::1], f8[:, ::1], f8[:, ::1])), Tuple((i8[::1], f8[::1], f8[:, ::1], f8[:, ::1]))))"
)


@kernel
def filter_inertial(
    state: tuple[Vector, Vector, Matrix, Vector, Vector, Vector, Vector],
    samples: tuple[Vector, Vector, Matrix, Matrix],
    first: int,
    until: float,
    noise: Vector,
    matrices: tuple[Matrix, Matrix, Matrix],
    others: tuple[Vector, Vector, Vector, Vector],
    packet: tuple[tuple[IntegerMatrix, Matrix, Matrix], tuple[IntegerVector, Vector, Matrix, Matrix]],
) -> int:
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
    (codes, arms, noises), (which, times, values, results) = packet
    position, velocity, dcm, _, bias, _, clock = state
    calibration, rate, density, correction = others
    calibrated, covariance = (calibration, rate, density), matrices[2]
    now = position, velocity, dcm, clock[12:15], bias, calibration
    for k in range(which.size + 1):
        time = min(times[k], until) if k < which.size else until
        if time > clock[0]:
            first = propagate_inertial(state, samples, first, time, noise, matrices, calibrated, time - clock[0])
        if k == which.size:
            break
        row = which[k]
        code, d, bias_at, scale_at = codes[row, 0], codes[row, 1], codes[row, 2], codes[row, 3]
        results[k, NIS], results[k, SIZE] = assimilate_inertial(
            (code, arms[row], bias_at, scale_at), values[k, :d], now, covariance,
            noises[row, : d * d].reshape((d, d)), correction,
        )  # fmt: skip
    return first


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
