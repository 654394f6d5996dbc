"""States of earlier times: read from the nodes of a window, or computed by a fixed-lag smoother behind a filter.

A window holds the states of its epochs, and each optimisation moves them all. So the oldest node is an estimate from
all measurements up to now, and costs nothing. A window of W epochs of one step reaches back W - 1 steps.

A step can end later than its last node, when it has no measurement at its end. The state at the end of the step is then
the one that was predicted from the node, moved by what the node has moved since. The correction of the velocity counts
for the time between them. Rotations of the attitude are applied in the same way.

A filter needs a smoother (`simnav.estimators.solvers.smoother`). Its backward pass, from now to the earliest time, is
the fixed-lag smoother of J. B. Moore, *Discrete-time fixed-lag smoothing algorithms*, Automatica 9(2), 1973, in the
form of Rauch, Tung and Striebel. The gains are computed once for each stop.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from simnav.estimators.models.base import ErrorModel
from simnav.estimators.models.chain import Chain
from simnav.estimators.models.inertial_errors import ERROR, PART
from simnav.geometry.earth import displace, relative_position
from simnav.geometry.rotation import dcm_from_rpy, rpy_from_dcm
from simnav.types import Array, Estimate

__all__ = ["LooksBack", "StepEnd", "WindowReader", "estimate_of_node", "row_of", "smoothed_rows"]

_TOLERANCE = 1e-6  # s


def row_of(estimate: Estimate) -> Array:
    """Position, velocity and attitude of an estimate in one (9,) array, at `PART`; NaN for what it does not hold."""
    vectors = (estimate.position, estimate.velocity, estimate.attitude)
    return np.concatenate([np.full(3, np.nan) if v is None else v for v in vectors])


def estimate_of_node(chain: Chain, node: int, covariance: Array) -> Estimate:
    """The estimate that a node of a window is, with the (n, n) covariance of its error."""
    front = chain.front
    kept, time = front.snapshot(), front.time
    front.restore([chain.nodes[name][node] for name in front.state])
    front.time = float(chain.nodes["time"][node])
    try:
        return front.estimate(covariance)
    finally:
        front.restore(kept)
        front.time = time


@dataclass(frozen=True, slots=True)
class StepEnd:
    """What a window knew at the end of a step.

    Attributes
    ----------
    time, node_time : float
        End of the step, and time of the newest node [s].
    state, node : (9,) array
        States at these times, as they were then.
    """

    time: float
    node_time: float
    state: Array
    node: Array


class WindowReader:
    """Reads the nodes of a window at earlier times.

    Parameters
    ----------
    chain : Chain
        The nodes of the window.

    Attributes
    ----------
    nodes : Columns
        Of the run that is read.
    """

    def __init__(self, chain: Chain):
        self._chain, self.nodes = chain, chain.nodes
        self._ends: deque[StepEnd] = deque()

    def read(self, lags: Sequence[float]) -> Array:
        """The states at these times before the present, (k, 9).

        Parameters
        ----------
        lags : sequence of float
            [s].

        Raises
        ------
        ValueError
            If a lag is longer than the window.
        """
        chain, unknown = self._chain, np.zeros((self._chain.size, self._chain.size))
        times: Array = chain.nodes["time"]

        def at(node: int) -> Array:
            return row_of(estimate_of_node(chain, node, unknown))

        now = chain.time
        here = row_of(chain.estimate(unknown))
        newest = here if times[-1] >= now - _TOLERANCE else at(len(times) - 1)
        self._ends.append(StepEnd(now, float(times[-1]), here, newest))
        while self._ends[0].time < now - max(lags) - _TOLERANCE:
            self._ends.popleft()
        found = np.full((len(lags), 9), np.nan)
        for row, lag in enumerate(lags):
            end = next((e for e in self._ends if abs(e.time - (now - lag)) <= _TOLERANCE), None)
            if end is None:  # before the first step
                continue
            node = int(np.searchsorted(times, end.node_time - _TOLERANCE))
            if node == len(times) or abs(times[node] - end.node_time) > _TOLERANCE:
                reach = now - float(times[0])
                raise ValueError(
                    f"a lag of {lag:g} s is longer than the window, which holds the last {reach:g} s: "
                    f"set 'window' to more epochs"
                )
            found[row] = _moved(end, at(node))
        return found


class LooksBack:
    """What a solver with a ``chain`` of nodes inherits to look back."""

    chain: Chain
    _reader: WindowReader | None = None

    def earlier(self, lags: Sequence[float]) -> Array | None:
        """The states of earlier times in the window (`simnav.estimator.Estimator.earlier`)."""
        reader, chain = self._reader, self.chain
        if reader is None or reader.nodes is not chain.nodes:  # a run has begun
            reader = self._reader = WindowReader(chain)
        return reader.read(lags)


def _moved(end: StepEnd, node: Array) -> Array:
    """The state at the end of a step, moved as its newest node has moved since."""
    if end.time - end.node_time <= _TOLERANCE:
        return node
    state, change = end.state.copy(), node[PART.velocity] - end.node[PART.velocity]
    speeds = np.where(np.isfinite(change), change, 0.0)
    offset = relative_position(node[PART.position], end.node[PART.position]) + speeds * (end.time - end.node_time)
    state[PART.position] = displace(state[PART.position], offset)
    state[PART.velocity] += change
    if np.isfinite(node[PART.attitude]).all():
        turn = dcm_from_rpy(node[PART.attitude]) @ dcm_from_rpy(end.node[PART.attitude]).T
        state[PART.attitude] = rpy_from_dcm(turn @ dcm_from_rpy(state[PART.attitude]))
    elif np.isfinite(node[ERROR.heading]):
        state[ERROR.heading] += node[ERROR.heading] - end.node[ERROR.heading]
    return state


def smoothed_rows(
    model: ErrorModel,
    lags: Sequence[float],
    ends: Sequence[tuple[int, float]],
    corrections: Callable[[int], tuple[list[list[Array]], list[Array]]],
) -> Array:
    """States of earlier times from a filter's states and the corrections of a smoother, (k, 9).

    Parameters
    ----------
    model : ErrorModel
        At the present time; it is in the same state afterwards.
    lags : sequence of float
        [s].
    ends : sequence of (int, float)
        Stop and time of the end of each step.
    corrections : callable
        From the earliest stop to the states of the filter at this stop and all later ones, and their corrections.
    """
    now = model.time
    wanted: dict[int, int] = {}
    for row, lag in enumerate(lags):
        for stop, time in reversed(ends):
            if abs(time - (now - lag)) <= _TOLERANCE:
                wanted[row] = stop
                break
            if time < now - lag:
                break
    found = np.full((len(lags), 9), np.nan)
    if not wanted:
        return found
    first = min(wanted.values())
    states, shifts = corrections(first)
    kept, covariance = model.snapshot(), np.zeros((model.size, model.size))
    for row, stop in wanted.items():
        model.restore(states[stop - first])
        model.correct(shifts[stop - first])
        found[row] = row_of(model.estimate(covariance))
    model.restore(kept)
    return found
