"""One step of a window: each measurement becomes a factor, at its own time. Every window of simnav is this loop.

The functions that it calls are handed over. If all of them are kernels, the loop is compiled code; if not, the same
source runs in Python (``attach_readings.function``). What follows is the iteration
(`simnav.estimators.solvers.window_iteration`), and the nodes that leave (`simnav.estimators.models.marginalisation`).
"""

from __future__ import annotations

from simnav.compiled import kernel
from simnav.estimators.algebra.factors import NewRows, Rows
from simnav.estimators.models.filtering import Dynamics, Readings
from simnav.estimators.models.new_factors import FactorFunctions, Growing
from simnav.estimators.models.propagation import Samples

__all__ = ["attach_readings"]


@kernel
def attach_readings(
    functions: FactorFunctions, dynamics: Dynamics, growing: Growing, rows: Rows, readings: Readings, samples: Samples,
    count: int, until: float, spacing: float,
) -> NewRows:  # fmt: skip
    """Make the readings of a step factors, each at its own time.

    Parameters
    ----------
    functions : FactorFunctions
        The functions of the step.
    dynamics : Dynamics
        The state of the model at the front.
    growing : Growing
        The nodes and factors.
    rows : Rows
        Where the window is in its columns, which have room for ``count`` rows more.
    readings : Readings
        In order of their times; one that is later than ``until`` is used then. ``rejected`` is overwritten.
    samples : Samples
        The IMU samples of the step.
    count : int
        Number of readings.
    until : float
        End of the step [s].
    spacing : float
        A reading closer to the newest node than this [s] has no node of its own, unless it has the latest time.

    Returns
    -------
    NewRows
        How many rows were appended.
    """
    new = NewRows(0, 0, 0)
    for k in range(count):
        time = float(readings.time[k])
        functions.advance(dynamics, growing, samples, min(time, until))
        readings.rejected[k] = not functions.choose(dynamics, readings, k)
        if readings.rejected[k]:
            continue
        ahead = float(growing.since_node.elapsed[0])
        if ahead > 0.0 and (time == readings.time[count - 1] or ahead >= spacing):
            new = functions.make_node(dynamics, growing, rows, new)
        new = functions.attach(dynamics, growing, rows, new, readings, k)
    return new
