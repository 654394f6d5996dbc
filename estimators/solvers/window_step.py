"""One step of a window: each measurement becomes a factor, at its own time. Every window of simnav is this loop.

The functions that it calls are handed over in a `WindowStep`. If all of them are kernels, the loop is compiled code; if
not, the same source runs in Python (``attach_readings.function``). What follows, the solution and the nodes that leave,
is in `simnav.estimators.solvers.window.WindowEstimator.update`.
"""

from __future__ import annotations

from collections.abc import Callable

from simnav.compiled import kernel
from simnav.estimators.algebra.factors import NewRows, Rows
from simnav.estimators.models.filtering import Dynamics, Readings
from simnav.estimators.models.new_factors import Growing
from simnav.estimators.models.propagation import Samples
from simnav.records import Record

__all__ = ["WindowStep", "attach_readings"]


class WindowStep(Record):
    """The functions of a step of a window, and what they work on.

    Attributes
    ----------
    dynamics : Dynamics
        The state of the model at the front.
    growing : Growing
        The nodes and factors.
    advance : callable
        Propagates the front to a time.
    choose : callable
        Chooses the noise of a reading; False if it is not to be used.
    make_node : callable
        Makes the front a node, with a motion factor.
    attach : callable
        Makes a reading a factor of the newest node.
    """

    dynamics: Dynamics
    growing: Growing
    advance: Callable[[Dynamics, Growing, Samples, float], None]
    choose: Callable[[Dynamics, Readings, int], bool]
    make_node: Callable[[Dynamics, Growing, Rows, NewRows], NewRows]
    attach: Callable[[Dynamics, Growing, Rows, NewRows, Readings, int], NewRows]


@kernel
def attach_readings(
    step: WindowStep, rows: Rows, readings: Readings, samples: Samples, count: int, until: float, spacing: float
) -> NewRows:
    """Make the readings of a step factors, each at its own time.

    Parameters
    ----------
    step : WindowStep
        The functions, and what they work on.
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
    dynamics, growing = step.dynamics, step.growing
    for k in range(count):
        time = float(readings.time[k])
        step.advance(dynamics, growing, samples, min(time, until))
        readings.rejected[k] = not step.choose(dynamics, readings, k)
        if readings.rejected[k]:
            continue
        ahead = float(growing.since_node.elapsed[0])
        if ahead > 0.0 and (time == readings.time[count - 1] or ahead >= spacing):
            new = step.make_node(dynamics, growing, rows, new)
        new = step.attach(dynamics, growing, rows, new, readings, k)
    return new
