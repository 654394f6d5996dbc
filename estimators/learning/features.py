"""The observation of a running filter, scaled to numbers of order one by the constants of this module.

For each instrument for which the agent decides (`PER_INSTRUMENT` numbers, then `PER_MEASUREMENT` for each of the at
most K measurements of a step):

====================== =============================================================================================
mean innovation        fading mean over `MEMORY` seconds of the innovation below
mean, by component     fading mean of the whitened innovation, three numbers: an error that lasts shows here
size of the mean       ``ln(1 + norm of these three)``
age                    ``ln(1 + seconds since the last measurement / its period)``
number                 measurements in the step over K
setting                logarithm of the noise scale that is in use, over that of `LARGEST_SCALE`
innovation             ``ln(1 + sqrt(v' S^-1 v / m))`` with the noise of the datasheet
by component           ``v_i / sqrt(S_ii)`` over `WHITE`, three numbers
====================== =============================================================================================

Then `CONTEXT` numbers on the voyage: decimal logarithm of the filter's horizontal sigma [m]; of the plain filter's
sigma of velocity over 0.1 m/s and of heading over 1 deg; speed over `SPEED`, cosine and sine of the heading, turn rate
over `TURN_RATE`; ``ln(1 + t / 60 s)`` over 5; and of the start: decimal logarithms of its sigmas of position [m], of
velocity over 0.1 m/s and of heading over 1 deg, and its speed over `SPEED`.

Everything is clipped to +-`LIMIT`. Numbers that a filter does not have (a heading without a compass) are zero.
"""

from __future__ import annotations

from math import atan2, cos, hypot, log10, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, Estimate, InitialState

__all__ = [
    "CONTEXT",
    "GUIDANCE",
    "LARGEST_SCALE",
    "LIMIT",
    "MEMORY",
    "PER_INSTRUMENT",
    "PER_MEASUREMENT",
    "SPEED",
    "TURN_RATE",
    "WHITE",
    "Context",
    "Numbers",
    "observation_names",
    "observation_size",
]

#: Observations and actions, of any type of number.
Numbers = NDArray[Any]

#: Bound of every number of an observation.
LIMIT = 10.0
#: Time constant of the fading means [s].
MEMORY = 10.0
#: Unit of the whitened innovations [sigma], of speeds [m/s], of turn rates [rad/s].
WHITE, SPEED, TURN_RATE = 3.0, 10.0, 0.05
#: Largest factor on a sigma that an agent may set; the smallest is its inverse.
LARGEST_SCALE = 30.0

PER_INSTRUMENT, PER_MEASUREMENT, CONTEXT = 8, 4, 12

#: Names of what an agent of Guidance sees instead (`simnav.estimators.learning.guidance` explains them).
GUIDANCE = (
    "aside", "sin_course", "cos_course", "turn_10_s", "turn_30_s", "turn_60_s", "speed", "planned_speed", "turn_rate",
    "sigma_position", "sigma_heading", "age", "left", "half_width", "start_sigma_position", "start_sigma_heading",
)  # fmt: skip


def observation_size(instruments: int, most: int) -> int:
    """Length of the observation for so many instruments, of at most so many measurements a step."""
    return instruments * (PER_INSTRUMENT + PER_MEASUREMENT * most) + CONTEXT


def observation_names(instruments: list[str], most: int) -> list[str]:
    """A name for each number of the observation."""
    names = []
    for name in instruments:
        own = ["mean_innovation", "mean_0", "mean_1", "mean_2", "size_of_mean", "age", "number", "setting"]
        for j in range(most):
            own += [f"{what}[{j}]" for what in ("innovation", "white_0", "white_1", "white_2")]
        names += [f"{name}.{what}" for what in own]
    start = ["start_sigma_position", "start_sigma_velocity", "start_sigma_heading", "start_speed"]
    motion = ["sigma_velocity", "sigma_heading", "speed", "cos_heading", "sin_heading", "turn_rate", "time"]
    return [*names, "sigma_position", *motion, *start]


class Context:
    """The numbers on the voyage, step by step, from the plain filter; the first of `CONTEXT` is left to the bank.

    Parameters
    ----------
    start : InitialState
        What the filter is told at the start of the voyage.
    step : float
        Length of a step [s].
    """

    def __init__(self, start: InitialState, step: float):
        variance = np.diag(start.covariance)
        self._start = np.array([
            _log(variance[0] + variance[1], 1.0), _log(variance[3] + variance[4], 0.1),
            _log(variance[8], radians(1.0)), hypot(start.velocity[0], start.velocity[1]) / SPEED,
        ])  # fmt: skip
        self._step, self._last = step, float(start.attitude[2])
        self._time, self._turn = start.time, 0.0
        self._velocity, self._heading, self._variance = start.velocity, self._last, variance

    def numbers(self) -> Array:
        """(11,) array: all but the first."""
        variance = self._variance
        motion = [
            _log(variance[3] + variance[4], 0.1), _log(variance[8], radians(1.0)),
            hypot(self._velocity[0], self._velocity[1]) / SPEED, cos(self._heading), sin(self._heading),
            self._turn / TURN_RATE, np.log1p(self._time / 60.0) / 5.0,
        ]  # fmt: skip
        numbers: Array = np.nan_to_num(np.concatenate([motion, self._start]))
        return numbers

    def move(self, estimate: Estimate) -> None:
        """Take the plain filter's estimate at the end of a step."""
        if estimate.velocity is not None:
            self._velocity = estimate.velocity
        if estimate.attitude is not None:
            heading = float(estimate.attitude[2])
            turned = heading - self._heading
            self._turn = atan2(sin(turned), cos(turned)) / self._step
            self._heading = heading
        if estimate.covariance is not None:
            self._variance = np.diag(estimate.covariance)
        self._time = estimate.time


def _log(variance: float, unit: float) -> float:
    """Decimal logarithm of a sigma in a unit, from its variance."""
    return 0.5 * log10(max(variance, 1e-18)) - log10(unit)
