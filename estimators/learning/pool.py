"""Voyages that are prepared once and kept: the shared arrays that a bank of filters works on."""

from __future__ import annotations

import math
import warnings
from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from simnav.types import Array, InitialState, Instruments

from .environment import TaskOptions
from .features import CONTEXT
from .reference import Linear
from .voyage import Prepared, prepare

__all__ = ["Pool", "capacity_within"]


class Pool:
    """Prepared voyages of one task, by the seeds of their runs. The least recently used one is removed first.

    Parameters
    ----------
    options : TaskOptions
        Scenario and task of the voyages.
    capacity : int
        Largest number of voyages; `capacity_within` finds one.

    Attributes
    ----------
    linear : Linear
        The events of all of them.
    edges : (capacity, S + 1) int array
        Where the events of each step of each voyage begin.
    length : (capacity,) int array
        Steps of each voyage.
    end, context, error, oracle : (capacity, S, ...) arrays
        The arrays of each voyage, see `simnav.estimators.learning.voyage.Prepared`.
    faulty : (e,) bool array
        Whether a fault touches the measurement of each event.
    start : list of InitialState
        What a navigator is told at the start of each.
    instruments : list of Instruments
        The datasheets of each.
    n : int
        States of the filter.
    """

    @staticmethod
    def cost(options: TaskOptions) -> int:
        """Most memory of one prepared voyage [bytes], from the scenario and the task; nothing is prepared for it."""
        steps, events = _most(options)
        layout = options.layout
        a_step = 8 * (1 + 1 + CONTEXT - 1 + 9 + 3)  # edges, end, context, error, oracle
        return events * (Linear.bytes_each(layout.states) + 1) + steps * a_step

    def __init__(self, options: TaskOptions, capacity: int):
        self.options, self.capacity = options, capacity
        self.n = options.layout.states
        self._slots: OrderedDict[int, int] = OrderedDict()

    def slot(self, seed: int, used: set[int]) -> int:
        """The place of a voyage, which is prepared if it is not there; the places in ``used`` are not given up."""
        if seed in self._slots:
            self._slots.move_to_end(seed)
            return self._slots[seed]
        o = self.options
        voyage = prepare(o.scenario, seed, o.layout.watched, o.steps, oracle=o.oracle)
        if not self._slots:
            self._allocate(voyage)
        at = self._free(used)
        self._slots[seed] = at
        self._put(at, voyage)
        return at

    def _free(self, used: set[int]) -> int:
        if len(self._slots) < self.capacity:
            return len(self._slots)
        seed = next(seed for seed, slot in self._slots.items() if slot not in used)
        return self._slots.pop(seed)

    def _allocate(self, voyage: Prepared) -> None:
        """Room for the voyages; memory that is not used yet costs nothing."""
        o = self.options
        longest, room = _most(o)
        self._room = max(room, int(1.5 * len(voyage.faulty)))
        self._steps = max(longest, len(voyage.end)) + 1
        c, s = self.capacity, self._steps
        self.linear = Linear.empty(c * self._room, self.n)
        self.faulty = np.zeros(c * self._room, np.bool_)
        self.edges, self.length = np.zeros((c, s + 1), np.int64), np.zeros(c, np.int64)
        self.end, self.context = np.zeros((c, s)), np.zeros((c, s, voyage.context.shape[1]))
        self.error, self.oracle = np.zeros((c, s, 9)), np.zeros((c, s, 3))
        self.covariance = np.zeros((c, self.n, self.n))
        self.period = np.ones((c, len(o.layout.names)))
        self.start: list[InitialState | None] = [None] * c
        self.instruments: list[Instruments | None] = [None] * c

    def _put(self, at: int, voyage: Prepared) -> None:
        events, steps = len(voyage.faulty), len(voyage.end)
        if events > self._room or steps > self._steps:
            raise ValueError(f"a voyage of {steps} steps and {events} measurements is longer than its scenario says")
        begin = at * self._room
        small = voyage.linear.transition.shape[1]
        for mine, theirs in zip(self.linear, voyage.linear, strict=True):
            # States that this run does not have stay zero.
            place = tuple(slice(0, small) if n == self.n else slice(None) for n in mine.shape[1:])
            mine[begin : begin + events] = 0
            mine[(slice(begin, begin + events), *place)] = theirs
        self.faulty[begin : begin + events] = voyage.faulty
        self.edges[at, : steps + 1] = begin + voyage.edges
        self.length[at] = steps
        for mine, theirs in (
            (self.end, voyage.end), (self.context, voyage.context), (self.error, voyage.error),
            (self.oracle, voyage.oracle),
        ):  # fmt: skip
            mine[at, :steps] = theirs
        self.covariance[at] = 0.0
        self.covariance[at, :small, :small] = voyage.start_covariance
        self.period[at] = self.options.layout.periods(voyage.instruments)
        self.start[at], self.instruments[at] = voyage.start, voyage.instruments

    def rows(self, array: Array, slots: NDArray[np.int64], steps: NDArray[np.int64]) -> Array:
        """Of each of b filters: the numbers of its voyage at its step."""
        return np.ascontiguousarray(array[slots, steps])


def _most(options: TaskOptions) -> tuple[int, int]:
    """Largest numbers of steps and of events of a voyage."""
    longest = options.scenario.epochs + 1 if options.steps is None else options.steps
    # A measurement is an event, and so is the end of a step; a log may deliver some late.
    return longest, int(longest * (2.0 + options.layout.events)) + 64


def capacity_within(options: TaskOptions, least: int, wanted: int, fixed: bool, memory_gb: float) -> int:
    """The number of prepared voyages that are kept, so that they take no more memory than is allowed.

    Parameters
    ----------
    options : TaskOptions
        Scenario and task.
    least, wanted : int
        Number of voyages without which the vector form cannot work, and that would be kept if there were room.
    fixed : bool
        Whether the user asked for the wanted number: it is then not lowered.
    memory_gb : float
        Most memory of all of them [GB].

    Raises
    ------
    ValueError
        If they do not fit.

    Warns
    -----
    UserWarning
        If fewer than wanted are kept.
    """
    if not memory_gb > 0.0:
        raise ValueError(f"memory_gb = {memory_gb!r} should be positive")
    each = Pool.cost(options)
    needed = wanted if fixed else least
    making = 2  # the voyage that is being prepared is there twice
    fit = int(memory_gb * 1e9 / each) - making
    what = f"{options.scenario.id}: a prepared voyage takes up to {each / 1e6:.0f} MB"
    if fit < needed:
        raise ValueError(
            f"{what}, and {needed} of them do not fit into memory_gb = {memory_gb:g}; ask for fewer voyages side by "
            f"side (num_envs), shorter ones (steps) or a smaller cache, or say "
            f"memory_gb = {_rounded(needed + making, each):g}"
        )
    if fit < wanted:
        warnings.warn(
            f"{what}, so {fit} of {wanted} are kept in memory_gb = {memory_gb:g}, and the others are prepared again "
            f"each time that they are sailed; memory_gb = {_rounded(wanted + making, each):g} keeps all of them",
            stacklevel=3,
        )
    return min(fit, wanted)


def _rounded(voyages: int, each: int) -> float:
    """The memory of so many voyages [GB], rounded up to a tenth."""
    return math.ceil(voyages * each / 1e8) / 10.0
