"""The cost of an epoch: processor time and memory of several estimators over one recording.

**Time.** The estimators run a few epochs each in turn, so that other work of the machine slows all of them alike. The
recording is run several times, and the smallest time of an epoch counts. It is the time of ``update`` alone.

**Memory.** It is the memory of the estimator alone, from its construction to the end of ``smooth``; measurements and
libraries are loaded before. It is measured in two runs. `tracemalloc` reports all memory of Python and NumPy, but not
that of a C++ library. The C library (glibc only) reports all memory that it has allocated, including that of the
interpreter. The second figure is used if it is clearly larger.
"""

from __future__ import annotations

import contextlib
import copy
import ctypes
import gc
import itertools
import math
import os
import tracemalloc
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from time import process_time
from typing import ClassVar, TypeAlias

import numpy as np

from simnav.estimator import Estimator, UnsuitableScenario, lacking
from simnav.recording import Recording
from simnav.types import Array, Measurements

__all__ = ["TURN", "Cost", "Factory", "measure", "started"]

Factory: TypeAlias = Callable[[], Estimator]
Progress: TypeAlias = "Callable[..., None] | None"

#: Number of epochs in a turn. After a change of the estimator the caches hold the data of the other one, which slows a
#: window more than a filter.
TURN = 10
#: Memory that the interpreter itself allocates from the C library during a run [B]; smaller figures mean nothing.
ALLOCATOR = 128 << 10


@dataclass(frozen=True)
class Cost:
    """Time and memory of an epoch of one estimator.

    Attributes
    ----------
    estimator : str
        Label: name and parameters.
    status : str
        ``ok``, ``unsuitable`` (it needs other instruments) or ``error``. Figures that were not measured are NaN.
    reason : str
        Why the status is not ``ok``.
    update_median, update_mean, update_p95 : float
        Median, mean and 95th percentile of the processor time of an epoch [s].
    peak_memory : float
        Largest memory that the estimator held [B].
    memory_growth : float
        Mean growth of its memory with each epoch of the second half of the run [B]. It is about zero, except for
        smoothers and full graphs, which keep every epoch.
    """

    estimator: str
    status: str
    reason: str = ""
    update_median: float = math.nan
    update_mean: float = math.nan
    update_p95: float = math.nan
    peak_memory: float = math.nan
    memory_growth: float = math.nan


def measure(
    estimators: Mapping[str, Factory],
    recording: Recording,
    *,
    epochs: int = 120,
    rounds: int = 3,
    progress: Progress = None,
) -> list[Cost]:
    """Measure time and memory of an epoch.

    Parameters
    ----------
    estimators : mapping of str to callable
        A function that makes each estimator, by label.
    recording : Recording
        The recording. Estimators get copies of its measurements.
    epochs : int
        Number of steps of the recording that are run; fewer if the recording has fewer.
    rounds : int
        Number of runs over the steps; the smallest time of an epoch counts.
    progress : callable, optional
        Called with the number of finished parts, the number of all parts, and the next part as ``note=``.

    Returns
    -------
    list of Cost
        One for each estimator, in the given order. If an estimator fails, its entry has the reason; the others
        continue.

    Raises
    ------
    ValueError
        If there are fewer than 2 epochs, or no round.

    Examples
    --------
    >>> from simnav import load, make, record
    >>> sea = record(load("ship-straight"))
    >>> (cost,) = measure({"gnss-only": lambda: make("gnss-only")}, sea, epochs=20, rounds=1)
    >>> cost.status, cost.update_median > 0.0, cost.peak_memory > 0.0
    ('ok', True, True)
    """
    steps = list(itertools.islice(recording.steps(), max(epochs, 0)))
    if len(steps) < 2:
        raise ValueError(f"epochs: {len(steps)} of the recording are too few; at least 2 are wanted")
    if rounds < 1:
        raise ValueError(f"rounds: {rounds} is too few; at least 1 is wanted")
    tell = progress or (lambda *_, **__: None)
    total = rounds + len(estimators)
    failed: dict[str, Cost] = {}
    least = {label: np.full(len(steps), np.inf) for label in estimators}
    for k in range(rounds):
        tell(k, total, note=f"time, round {k + 1}")
        _time_a_round(
            {label: f for label, f in estimators.items() if label not in failed}, recording, steps, least, failed
        )
    costs = []
    for k, (label, factory) in enumerate(estimators.items()):
        tell(rounds + k, total, note=f"memory of {label}")
        if label not in failed:
            try:
                peak, growth = _memory(factory, recording, steps)
            except Exception as error:
                failed[label] = _failure(label, error)
        if label in failed:
            costs.append(failed[label])
            continue
        seconds = least[label]
        p95 = float(np.percentile(seconds, 95))
        costs.append(Cost(label, "ok", "", float(np.median(seconds)), float(seconds.mean()), p95, peak, growth))
    tell(total, total)
    return costs


def _time_a_round(
    estimators: Mapping[str, Factory],
    recording: Recording,
    steps: Sequence[Measurements],
    least: Mapping[str, Array],
    failed: dict[str, Cost],
) -> None:
    """Run all estimators once in turns, and update the smallest times ``least`` [s] of the epochs."""
    running: dict[str, tuple[Estimator, list[Measurements]]] = {}
    for label, factory in estimators.items():
        try:
            running[label] = (started(factory(), recording), [copy.deepcopy(packet) for packet in steps])
        except Exception as error:
            failed[label] = _failure(label, error)
    for first in range(0, len(steps), TURN):
        for label in list(running):
            estimator, packets = running[label]
            try:
                for k in range(first, min(first + TURN, len(steps))):
                    before = process_time()
                    estimator.update(packets[k])
                    least[label][k] = min(least[label][k], process_time() - before)
            except Exception as error:
                failed[label] = _failure(label, error)
                del running[label]


def started(estimator: Estimator, recording: Recording) -> Estimator:
    """An estimator at the start of a recording.

    Raises
    ------
    simnav.estimator.UnsuitableScenario
        If it needs other instruments.
    """
    lack = lacking(estimator.needs, recording.instruments)
    if lack:
        raise UnsuitableScenario(lack)
    if estimator.reference:
        estimator.reveal(recording)
    estimator.reset(copy.deepcopy(recording.start), copy.deepcopy(recording.instruments))
    return estimator


def _failure(label: str, error: Exception) -> Cost:
    if isinstance(error, UnsuitableScenario):
        return Cost(label, "unsuitable", str(error))
    return Cost(label, "error", f"{type(error).__name__}: {error}")


def _memory(factory: Factory, recording: Recording, steps: Sequence[Measurements]) -> tuple[float, float]:
    """Peak [B] and growth an epoch [B]."""
    traced = _held(factory, recording, steps, _Traced())
    if not _GivenOut.works():
        return traced
    native = _held(factory, recording, steps, _GivenOut())
    return native if native[0] > traced[0] + ALLOCATOR else traced


def _held(
    factory: Factory, recording: Recording, steps: Sequence[Measurements], meter: _Traced | _GivenOut
) -> tuple[float, float]:
    """Peak [B] and growth an epoch [B] of a run, measured by one meter."""
    packets = [copy.deepcopy(packet) for packet in steps]
    begin = copy.deepcopy(recording.start), copy.deepcopy(recording.instruments)
    half = len(packets) // 2
    with _only_new_garbage(), meter:
        estimator = factory()
        if estimator.reference:
            estimator.reveal(recording)
        estimator.reset(*begin)
        for k, packet in enumerate(packets):
            estimator.update(packet)
            meter.look()
            if k + 1 == half:
                before = meter.settled()
        growth = (meter.settled() - before) / (len(packets) - half)
        estimator.smooth()
        meter.look()
        return float(meter.peak()), growth


@contextlib.contextmanager
def _only_new_garbage() -> Iterator[None]:
    """Collections look at nothing that was there before: in a large process each would take a tenth of a second."""
    gc.collect()
    others = gc.get_freeze_count()
    gc.freeze()
    try:
        yield
    finally:
        if not others:  # otherwise nobody can tell what somebody else froze from what was frozen here
            gc.unfreeze()


class _Traced:
    """Memory of Python and NumPy [B], from entry to exit."""

    def __enter__(self) -> None:
        self._others = tracemalloc.is_tracing()  # it was already on and stays on
        if not self._others:
            tracemalloc.start()
        tracemalloc.reset_peak()
        self._before = tracemalloc.get_traced_memory()[0]

    def __exit__(self, *_: object) -> None:
        if not self._others:
            tracemalloc.stop()

    def look(self) -> None:
        """Do nothing: `tracemalloc` records the peak itself."""

    def settled(self) -> int:
        """The memory in use, after the interpreter has released its lists of free tuples and floats."""
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - self._before

    def peak(self) -> int:
        """The most that was held."""
        return tracemalloc.get_traced_memory()[1] - self._before


class _GivenOut:
    """Memory allocated by the C library since entry and not freed [B], read at each call of `look`."""

    def __enter__(self) -> None:
        self._before = self._peak = _given_out()

    def __exit__(self, *_: object) -> None:
        pass

    @staticmethod
    def works() -> bool:
        """Whether the C library reports its memory (glibc does)."""
        return hasattr(ctypes.CDLL(None), "mallinfo2") if os.name == "posix" else False

    def look(self) -> None:
        """Read the memory, and keep the largest value."""
        self._peak = max(self._peak, _given_out())

    def settled(self) -> int:
        """What is held."""
        gc.collect()
        return _given_out()

    def peak(self) -> int:
        """The most that was held at a look."""
        return self._peak - self._before


class _Mallinfo(ctypes.Structure):
    """``struct mallinfo2`` of glibc: ten sizes, of which the fifth and the eighth are in use."""

    _fields_: ClassVar = [(f"size_{i}", ctypes.c_size_t) for i in range(10)]


def _given_out() -> int:
    """Memory allocated by the C library and not freed [B]: mapped blocks, and blocks of its heap."""
    function = ctypes.CDLL(None).mallinfo2
    function.restype = _Mallinfo
    info: _Mallinfo = function()
    return int(info.size_4 + info.size_7)
