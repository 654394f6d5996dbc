"""What an epoch costs: processor time and memory of several estimators over one recording.

**Time.** The estimators take turns of a few epochs each, so that what else the machine does slows all of them. The
recording is run several times, and an epoch counts with its least time. It is the time of ``update`` alone.

**Memory.** What counts is the estimator's own: from its construction to the end of ``smooth``, with the measurements
and the libraries there already. It is measured in two runs: Python and NumPy tell all of their memory
(`tracemalloc`), but do not see what a C++ library holds; the C library tells what it has given out (glibc only), the
interpreter's own use included. The second figure counts where it is clearly larger.
"""

from __future__ import annotations

import copy
import ctypes
import gc
import itertools
import math
import os
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import process_time
from typing import ClassVar, TypeAlias

import numpy as np

from simnav.estimator import Estimator, UnsuitableScenario, lacking
from simnav.recording import Recording
from simnav.types import Array, Measurements

__all__ = ["Cost", "measure"]

Factory: TypeAlias = Callable[[], Estimator]
Progress: TypeAlias = "Callable[..., None] | None"

#: Epochs of a turn. An estimator that follows another one at each epoch begins with the other's data in the caches,
#: which costs a window more than a filter.
TURN = 10
#: What the interpreter itself asks of the C library during a run [B]; less than this says nothing of an estimator.
ALLOCATOR = 128 << 10


@dataclass(frozen=True)
class Cost:
    """What an epoch of one estimator costs.

    Attributes
    ----------
    estimator : str
        Label: name and parameters.
    status : str
        ``ok``, ``unsuitable`` (it needs other instruments) or ``error``; NaN stands for what was not measured.
    reason : str
        Why the status is not ``ok``.
    update_median, update_mean, update_p95 : float
        Median, mean and 95th percentile of the processor time of an epoch [s].
    peak_memory : float
        Most memory that it held [B].
    memory_growth : float
        How much more it holds after each epoch of the second half of the run, on average [B]. About zero, unless it
        keeps every epoch as smoothers and full graphs do.
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
        What makes each estimator, by label.
    recording : Recording
        Left as it is: estimators get copies of the measurements.
    epochs : int
        Steps of the recording that are run; fewer if the recording has fewer.
    rounds : int
        Runs over them; an epoch counts with its least time.
    progress : callable, optional
        Called with how many of how many parts are done, and ``note=`` what is next.

    Returns
    -------
    list of Cost
        One for each estimator, in the order given. An estimator that fails has its reason, and the others go on.

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
    estimators: Mapping[str, Factory], recording: Recording, steps: Sequence[Measurements], least: Mapping[str, Array],
    failed: dict[str, Cost],
) -> None:  # fmt: skip
    """Run all estimators once in turns; lower ``least`` [s] where an epoch took less."""
    running: dict[str, tuple[Estimator, list[Measurements]]] = {}
    for label, factory in estimators.items():
        try:
            running[label] = (_reset(factory(), recording), [copy.deepcopy(packet) for packet in steps])
        except Exception as error:
            failed[label] = _failure(label, error)
    for first in range(0, len(steps), TURN):
        for label in list(running):
            estimator, packets = running[label]
            try:
                for k in range(first, min(first + TURN, len(steps))):
                    started = process_time()
                    estimator.update(packets[k])
                    least[label][k] = min(least[label][k], process_time() - started)
            except Exception as error:
                failed[label] = _failure(label, error)
                del running[label]


def _reset(estimator: Estimator, recording: Recording) -> Estimator:
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
    """Peak [B] and growth an epoch [B] of a run, by one meter."""
    packets = [copy.deepcopy(packet) for packet in steps]
    begin = copy.deepcopy(recording.start), copy.deepcopy(recording.instruments)
    half = len(packets) // 2
    gc.collect()
    with meter:
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


class _Traced:
    """What Python and NumPy hold [B], from entry to exit."""

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
        """Nothing to do: Python keeps the peak itself."""

    def settled(self) -> int:
        """What is held once the interpreter has dropped what it keeps for reuse (lists of free tuples and floats)."""
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - self._before

    def peak(self) -> int:
        """The most that was held."""
        return tracemalloc.get_traced_memory()[1] - self._before


class _GivenOut:
    """What the C library has given out since entry and not got back [B], at each look."""

    def __enter__(self) -> None:
        self._before = self._peak = _given_out()

    def __exit__(self, *_: object) -> None:
        pass

    @staticmethod
    def works() -> bool:
        """Whether the C library tells (glibc does)."""
        return hasattr(ctypes.CDLL(None), "mallinfo2") if os.name == "posix" else False

    def look(self) -> None:
        """Keep the largest value."""
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
    """Bytes that the C library has given out and not got back: mapped one by one, and from its heap."""
    function = ctypes.CDLL(None).mallinfo2
    function.restype = _Mallinfo
    info: _Mallinfo = function()
    return int(info.size_4 + info.size_7)
