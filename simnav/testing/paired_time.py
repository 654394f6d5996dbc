"""The processor time of an estimator as a multiple of that of another one: many short turns, side by side.

An absolute time says as much about the machine, and about what else runs on it, as about the estimator. So two
estimators run over the same epochs of one recording in turns of a few milliseconds. Other work slows both alike, and
the ratio of their times hardly changes. The processor time is that of the process, with all its threads; waiting does
not count. Each turn is run in many rounds, and the median of its ratios counts, so that disturbances, which hit some of
the rounds, do not move it. The multiple is the mean of these medians over the turns, weighted by the time of the plain
estimator; so a turn in which both have much to do counts for more. Its 95 % interval is a bootstrap over the rounds.
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
from simnav.types import Array, Measurements

__all__ = ["Multiple", "multiple"]

#: Rounds are repeated no more after this processor time [s], if there are at least `FEWEST`.
BUDGET = 3.0
FEWEST = 5
#: Resamples of the bootstrap.
RESAMPLES = 1000
#: Share of the epochs that are run before those that are timed: a window is filled, and libraries are loaded.
SETTLING = 1.0 / 3.0


@dataclass(frozen=True)
class Multiple:
    """Processor time as a multiple of that of another estimator.

    Attributes
    ----------
    value : float
        The multiple.
    low, high : float
        95 % interval over the rounds.
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
    rounds: int = 21,
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
    times: list[Array] = []
    for k in range(rounds + 1):
        taken = _round((estimator, plain), recording, packets, timed_from, smooth, clock, turned=bool(k % 2))
        if k > 0:
            times.append(taken)
        if len(times) >= FEWEST and sum(float(t.sum()) for t in times) > BUDGET:
            break
    return _estimate(np.stack(times))


def _estimate(times: Array) -> Multiple:
    """The multiple from times [s] of shape (rounds, turns, 2), of which the last is the plain estimator's."""
    mine, theirs = times[..., 0], np.maximum(times[..., 1], 1e-9)
    ratios = mine / theirs
    weights = np.median(theirs, axis=0)
    rounds = len(ratios)
    drawn = np.random.default_rng(0).integers(rounds, size=(RESAMPLES, rounds))
    value = float(np.average(np.median(ratios, axis=0), weights=weights))
    means = np.average(np.median(ratios[drawn], axis=1), weights=weights, axis=1)
    low, high = np.percentile(means, [2.5, 97.5]).tolist()
    return Multiple(value, min(low, value), max(high, value), rounds)


def _round(
    pair: tuple[Factory, Factory],
    recording: Recording,
    packets: bytes,
    timed_from: int,
    smooth: bool,
    clock: Callable[[], float],
    *,
    turned: bool,
) -> Array:
    """Run both once over the steps in turns; the processor times [s], shape (turns, 2). The smoothers are one turn.

    ``turned``: the second begins. Who begins changes from turn to turn, because the caches hold the data of the other.
    """
    running: list[tuple[Estimator, list[Measurements]]] = [
        (started(factory(), recording), pickle.loads(packets)) for factory in pair
    ]
    seconds: list[list[float]] = []
    collects = gc.isenabled()
    gc.disable()  # a collection would charge one of them with the objects of both
    try:
        for number, first in enumerate(range(0, len(running[0][1]), TURN)):
            spent = [0.0, 0.0]
            for i in (1, 0) if turned ^ bool(number % 2) else (0, 1):
                estimator, own = running[i]
                turn = own[first : first + TURN]
                before = clock()
                for packet in turn:
                    estimator.update(packet)
                spent[i] = clock() - before
            if first >= timed_from:
                seconds.append(spent)
        if smooth:
            spent = [0.0, 0.0]
            for i in (1, 0) if turned else (0, 1):
                before = clock()
                running[i][0].smooth()
                spent[i] = clock() - before
            seconds.append(spent)
    finally:
        if collects:
            gc.enable()
    return np.array(seconds)
