"""Voyages that are prepared once and kept: the shared arrays that a bank of filters works on."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from numpy.typing import NDArray

from simnav.estimators.learning.environment import TaskOptions
from simnav.estimators.learning.reference import Linear
from simnav.estimators.learning.voyage import Prepared, prepare
from simnav.types import Array, InitialState, Instruments

__all__ = ["Pool"]


class Pool:
    """Prepared voyages of one task, by the seeds of their runs. The least recently used one is removed first.

    Parameters
    ----------
    options : TaskOptions
        Scenario and task of the voyages.
    capacity : int
        Largest number of voyages.

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
        longest = o.scenario.epochs + 1 if o.steps is None else o.steps
        # A measurement is an event, and so is the end of a step; a log may deliver some late.
        self._room = int(longest * (2.0 + o.layout.events)) + 64
        self._room = max(self._room, int(1.5 * len(voyage.faulty)))
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
