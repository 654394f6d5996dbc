"""The processor time of an estimator as a multiple of that of another one: many short turns, side by side.

An absolute time says as much about the machine, and about what else runs on it, as about the estimator. So two
estimators run over the same epochs of one recording in turns of a few milliseconds. Other work slows both alike, and
the ratio of their times hardly changes. The processor time is that of the process, with all its threads; waiting does
not count. Each round gives one ratio. The multiple is the median of the rounds, so that a disturbance of some rounds
does not move it; the quartiles say how much the rounds differ.
"""

from __future__ import annotations

import gc
import itertools
import math
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np

from simnav.estimator import Estimator
from simnav.recording import Recording
from simnav.testing.cost import TURN, Factory, started
from simnav.types import Measurements

__all__ = ["Multiple", "multiple"]

#: Rounds are repeated no more after this processor time [s], if there are at least `FEWEST`.
BUDGET = 3.0
FEWEST = 5
#: Share of the epochs that are run before those that are timed: a window is filled, and libraries are loaded.
SETTLING = 1.0 / 3.0


@dataclass(frozen=True)
class Multiple:
    """Processor time as a multiple of that of another estimator.

    Attributes
    ----------
    value : float
        Median of the rounds.
    low, high : float
        Quartiles of the rounds.
    rounds : int
        Number of rounds.
    """

    value: float
    low: float
    high: float
    rounds: int


def multiple(
    estimator: Factory,
    plain: Factory,
    recording: Recording,
    *,
    epochs: int = 120,
    rounds: int = 15,
    smooth: bool = False,
    clock: Callable[[], float] = process_time,
) -> Multiple:
    """Measure the processor time of an estimator as a multiple of that of a plain one.

    A first round is not counted: it compiles and loads what both need.

    Parameters
    ----------
    estimator, plain : callable
        Functions that make them.
    recording : Recording
        The recording. Estimators get copies of its measurements.
    epochs : int
        Number of steps of the recording that are run; fewer if the recording has fewer. The first third is not timed,
        except with ``smooth``.
    rounds : int
        Number of rounds; fewer, but at least 5, if they need more than some seconds.
    smooth : bool
        True: the time of all epochs and of ``smooth``. False: that of ``update`` alone.
    clock : callable
        Processor time [s].

    Raises
    ------
    ValueError
        If there are fewer than 2 epochs, or no round.
    simnav.estimator.UnsuitableScenario
        If one of the estimators needs other instruments.

    Examples
    --------
    >>> from simnav import load, make, record
    >>> sea = record(load("ship-straight"))
    >>> found = multiple(lambda: make("ship-ukf"), lambda: make("ship-ekf"), sea, epochs=60, rounds=5)
    >>> found.low <= found.value <= found.high, found.rounds
    (True, 5)
    """
    steps = list(itertools.islice(recording.steps(), max(epochs, 0)))
    if len(steps) < 2:
        raise ValueError(f"epochs: {len(steps)} of the recording are too few; at least 2 are wanted")
    if rounds < 1:
        raise ValueError(f"rounds: {rounds} is too few; at least 1 is wanted")
    turns = math.ceil(len(steps) / TURN)
    timed_from = 0 if smooth else TURN * int(SETTLING * turns)
    packets = pickle.dumps(steps)  # each round has its own: an estimator may write into them
    ratios: list[float] = []
    spent = 0.0
    for k in range(rounds + 1):
        mine, theirs = _round((estimator, plain), recording, packets, timed_from, smooth, clock, turned=bool(k % 2))
        if k == 0:
            continue
        spent += mine + theirs
        ratios.append(mine / max(theirs, 1e-9))
        if spent > BUDGET and len(ratios) >= FEWEST:
            break
    low, value, high = np.percentile(ratios, [25.0, 50.0, 75.0]).tolist()
    return Multiple(value, low, high, len(ratios))


def _round(
    pair: tuple[Factory, Factory], recording: Recording, packets: bytes, timed_from: int, smooth: bool,
    clock: Callable[[], float], *, turned: bool,
) -> tuple[float, float]:  # fmt: skip
    """Run both once over the steps in turns; the processor time [s] of each.

    ``turned``: the second begins. Who begins changes from turn to turn, because the caches hold the data of the other.
    """
    running: list[tuple[Estimator, list[Measurements]]] = [
        (started(factory(), recording), pickle.loads(packets)) for factory in pair
    ]
    seconds = [0.0, 0.0]
    collects = gc.isenabled()
    gc.disable()  # a collection would charge one of them with the objects of both
    try:
        for number, first in enumerate(range(0, len(running[0][1]), TURN)):
            for i in (1, 0) if turned ^ bool(number % 2) else (0, 1):
                estimator, own = running[i]
                turn = own[first : first + TURN]
                before = clock()
                for packet in turn:
                    estimator.update(packet)
                spent = clock() - before
                if first >= timed_from:
                    seconds[i] += spent
        if smooth:
            for i in (1, 0) if turned else (0, 1):
                before = clock()
                running[i][0].smooth()
                seconds[i] += clock() - before
    finally:
        if collects:
            gc.enable()
    return seconds[0], seconds[1]
