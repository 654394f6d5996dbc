"""What every estimator takes: peak memory over two and over ten minutes of the open sea, and the time of an epoch.

What counts is the estimator's own: from ``reset`` to the end of ``smooth``, with the measurements and the libraries
there already, as its author would see it in a process that does other things. Python and NumPy tell that to the byte,
and the same on every machine (`tracemalloc`). They do not see compiled code: a kernel's temporaries, a few matrices of
a state that are gone when it returns, nor GTSAM's graphs, which live in C++. For rows on GTSAM it is therefore what the
C library has given out, at the end of each epoch and of ``smooth`` (glibc only). The resident set of a process, which
campaigns limit and report, is coarser by megabytes: pages of libraries that are touched, freed memory that is kept.

Smoothers and full graphs hold every epoch; nothing else may. Peaks do not show that: Python keeps freed tuples, up to
two thousand of each length, and a row that makes many of them fills these lists for a thousand epochs (`heading-bank`
by half a kilobyte an epoch, with nothing held). So what counts is what a row holds at some epochs of a run, after a
collection, which empties the lists, and it is compared with a peer in the same process: an estimator that keeps state
and covariance of each epoch, and nothing else. A quarter of that is left for windows that are not full yet. What
Python and NumPy keep for the next use fills up once, in some part of the run; what a row keeps grows in every part. So
the least growth of the parts counts.

Run with ``pytest tests/benchmarks/test_bench_memory.py --benchmark-enable`` (``make bench``), which prints a table.
"""

from __future__ import annotations

import ctypes
import gc
import itertools
import time
import tracemalloc
from collections.abc import Callable
from functools import cache
from typing import ClassVar

import numpy as np
import pytest

from simnav.estimator import Estimator, UnsuitableScenario, describe, make, names
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.scenario import load
from simnav.source import record
from simnav.types import Estimate, InitialState, Instruments, Measurements
from tests.cases.sorts_of_rows import first_of_each_solver

#: Seconds of the open sea, by whether the row is slow.
PIECES = {False: (120, 600), True: (30, 120)}
#: Without ``--benchmark-enable``: enough for windows, and for the innovations that adaptive rows keep, to fill.
SHORT = (90, 130)
#: Parts of a run, of equal length and one after the other, of which the least growth counts.
PARTS = 3
ROWS = [name for name in names() if not describe(name).reference]


def traced_now() -> int:
    """Bytes that Python and NumPy hold and that were asked for since the tracing began."""
    return tracemalloc.get_traced_memory()[0]


class _Mallinfo(ctypes.Structure):
    """``struct mallinfo2`` of glibc: ten sizes, of which the fifth and the eighth are in use."""

    _fields_: ClassVar = [(f"size_{i}", ctypes.c_size_t) for i in range(10)]


def given_out() -> int:
    """Bytes that the C library has given out and not got back: mapped one by one, and from its heap."""
    function = ctypes.CDLL(None).mallinfo2
    function.restype = _Mallinfo
    info = function()
    return info.size_4 + info.size_7


class KeepsEpochs(Estimator):
    """The peer: it keeps a state of nine numbers and its covariance for each epoch, the least that a smoother needs."""

    def reset(self, start: InitialState, instruments: Instruments) -> None:
        self.start, self.epochs = start, list[np.ndarray]()

    def update(self, measurements: Measurements) -> Estimate:
        start = self.start
        self.epochs += [np.concatenate([start.position, start.velocity, start.attitude]), start.covariance.copy()]
        return Estimate(measurements.time, start.position, start.velocity, start.attitude)


class Sea:
    """Ten minutes of the open sea."""

    def __init__(self) -> None:
        self.recording = record(load("open-sea").model_copy(update={"duration": 600.0}), 1)
        self.steps = list(self.recording.steps())
        self.took = np.empty(len(self.steps))

    def run(self, estimator: Estimator, seconds: int, each: Callable[[], object] = lambda: None) -> float:
        """Run over the first of it, call ``each`` after every epoch and the end; median seconds of an epoch."""
        estimator.reset(self.recording.start, self.recording.instruments)
        for k, packet in enumerate(self.steps[:seconds]):
            begun = time.perf_counter()
            estimator.update(packet)
            self.took[k] = time.perf_counter() - begun
            each()
        estimator.smooth()
        each()
        return float(np.median(self.took[:seconds]))

    def traced(self, name: str, seconds: int) -> int:
        """Peak of what Python and NumPy hold for the estimator [bytes]."""
        tracemalloc.start()
        try:
            self.run(make(name), seconds)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    def grown(self, estimator: Estimator, pieces: tuple[int, int], held: Callable[[], int]) -> int:
        """By how much it grows between the two numbers of epochs, or in a later part if that is less [bytes]."""
        first, second = pieces
        ends = range(first, min(first + PARTS * (second - first), len(self.steps)) + 1, second - first)
        amounts: list[int] = []
        epoch = 0

        def look() -> None:
            nonlocal epoch
            epoch += 1
            if epoch in ends:
                gc.collect()
                amounts.append(held())

        tracemalloc.start()
        try:
            self.run(estimator, ends[-1], look)
        finally:
            tracemalloc.stop()
        return min(later - earlier for earlier, later in itertools.pairwise(amounts))

    def native(self, name: str, seconds: int) -> int:
        """Peak of what the C library has given out since the start [bytes]."""
        gc.collect()
        peak = before = given_out()

        def look() -> None:
            nonlocal peak
            peak = max(peak, given_out())

        self.run(make(name), seconds, look)
        return peak - before


@pytest.fixture(scope="module")
def sea() -> Sea:
    return Sea()


@pytest.fixture(scope="module")
def peer(sea: Sea) -> Callable[[tuple[int, int]], int]:
    """By how much the peer grows between two epochs [bytes]."""
    return cache(lambda pieces: sea.grown(KeepsEpochs(), pieces, traced_now))


@pytest.fixture(scope="module")
def table(request):
    """Rows to print at the end: name, milliseconds, and kilobytes by seconds."""
    rows: list[tuple[str, float, dict[int, float]]] = []
    yield rows
    if rows:
        with request.config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
            print("\n\nestimator             ms/epoch   peak memory [kB]")
            for name, milliseconds, peaks in rows:
                print(f"{name:20s} {milliseconds:9.2f}  ", *(f"{kb:9.0f} ({s} s)" for s, kb in peaks.items()))


@pytest.mark.benchmark(group="memory")
@pytest.mark.parametrize("name", ROWS)
def test_peak_memory(benchmark, sea: Sea, peer: Callable[[tuple[int, int]], int], table: list, name: str):
    if not benchmark.enabled and name not in first_of_each_solver():
        pytest.skip("a row of the same pieces is there: with --benchmark-enable only")
    slow, on_gtsam = describe(name).slow, name.startswith("gtsam-")
    if slow and not benchmark.enabled:
        pytest.skip("a slow row: with --benchmark-enable only")
    if on_gtsam and not hasattr(ctypes.CDLL(None), "mallinfo2"):
        pytest.skip("what GTSAM holds is known from glibc only")
    pieces = PIECES[slow] if benchmark.enabled else SHORT
    try:
        sea.run(make(name), 10 if benchmark.enabled else SHORT[1])  # libraries, kernels, free lists
    except UnsuitableScenario as error:
        pytest.skip(str(error))
    peaks: dict[int, int] = {}
    seconds_of_run = pieces[0] if benchmark.enabled else 1
    milliseconds = 1e3 * benchmark.pedantic(sea.run, (make(name), seconds_of_run), rounds=1)
    for seconds in pieces if benchmark.enabled else ():
        peaks[seconds] = sea.native(name, seconds) if on_gtsam else sea.traced(name, seconds)
    kilobytes = {seconds: peak / 1024 for seconds, peak in peaks.items()}
    benchmark.extra_info |= {"ms_per_epoch": milliseconds} | {f"kB_{s}_s": kb for s, kb in kilobytes.items()}
    if benchmark.enabled:
        table.append((name, milliseconds, kilobytes))
    estimator = make(name)
    solver = getattr(estimator, "solver", estimator)  # a row that is no declaration is its own solver
    kalman = isinstance(solver, KalmanEstimator)
    if solver.smoother is None if kalman else type(solver).smooth is Estimator.smooth:  # no use for what is past
        # GTSAM keeps an empty place for each factor that has left its window. And its tree changes by 60 kB.
        spans, share = (PIECES[False], 0.75) if on_gtsam else (pieces, 0.25)
        assert sea.grown(make(name), spans, given_out if on_gtsam else traced_now) < share * peer(spans)


def test_a_row_that_keeps_what_is_past_is_found(sea: Sea, peer: Callable[[tuple[int, int]], int]):
    """The comparison can fail: a filter that keeps its estimates grows more than is allowed."""

    class Keeps(type(make("ekf"))):  # type: ignore[misc]
        def update(self, measurements: Measurements) -> Estimate:
            estimate = super().update(measurements)
            self.kept = [*getattr(self, "kept", []), estimate]
            return estimate

    least = 90 * 8 * (SHORT[1] - SHORT[0])
    assert sea.grown(make("ekf"), SHORT, traced_now) < 0.05 * least < 0.05 * peer(SHORT)
    assert sea.grown(Keeps(), SHORT, traced_now) > 0.25 * peer(SHORT)
