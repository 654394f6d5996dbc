"""What every estimator takes: peak memory over two and over ten minutes of the open sea, and the time of an epoch.

What counts is the estimator's own: from ``reset`` to the end of ``smooth``, with the measurements and the libraries
there already, as its author would see it in a process that does other things. Python and NumPy tell that to the byte,
and the same on every machine (`tracemalloc`). They do not see compiled code: a kernel's temporaries, a few matrices of
a state that are gone when it returns, nor GTSAM's graphs, which live in C++. For rows on GTSAM it is therefore what the
C library has given out, at the end of each epoch and of ``smooth`` (glibc only). The resident set of a process, which
campaigns limit and report, is coarser by megabytes: pages of libraries that are touched, freed memory that is kept.

Twice, for memory that grows with the run shows that way: smoothers and full graphs hold every epoch; nothing else may.

Run with ``pytest tests/benchmarks/test_bench_memory.py --benchmark-enable`` (``make bench``), which prints a table.
"""

from __future__ import annotations

import ctypes
import gc
import time
import tracemalloc
from collections.abc import Callable
from typing import ClassVar

import numpy as np
import pytest

from simnav.estimator import Estimator, describe, make, names
from simnav.estimators.solvers.kalman import KalmanEstimator
from simnav.scenario import load
from simnav.source import record

#: Seconds of the open sea, by whether the row is slow.
PIECES = {False: (120, 600), True: (30, 120)}
#: Without ``--benchmark-enable``: enough for a window of 20 epochs, and what it grows by, to fill.
SHORT = (45, 60)
#: What Python keeps of freed tuples and the like, and growth of the lists of a diagnostic [bytes].
FREE_LISTS = 128 << 10
ROWS = [name for name in names() if not describe(name).reference]


class _Mallinfo(ctypes.Structure):
    """``struct mallinfo2`` of glibc: ten sizes, of which the fifth and the eighth are in use."""

    _fields_: ClassVar = [(f"size_{i}", ctypes.c_size_t) for i in range(10)]


def given_out() -> int:
    """Bytes that the C library has given out and not got back: mapped one by one, and from its heap."""
    function = ctypes.CDLL(None).mallinfo2
    function.restype = _Mallinfo
    info = function()
    return info.size_4 + info.size_7


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
def test_peak_memory(benchmark, sea: Sea, table: list, name: str):
    slow, on_gtsam = describe(name).slow, name.startswith("gtsam-")
    if slow and not benchmark.enabled:
        pytest.skip("a slow row: with --benchmark-enable only")
    if on_gtsam and not hasattr(ctypes.CDLL(None), "mallinfo2"):
        pytest.skip("what GTSAM holds is known from glibc only")
    pieces = PIECES[slow] if benchmark.enabled else SHORT
    sea.run(make(name), 10)  # libraries, kernels, free lists
    peaks: dict[int, int] = {}
    milliseconds = 1e3 * benchmark.pedantic(sea.run, (make(name), pieces[0]), rounds=1)
    for seconds in pieces:
        peaks[seconds] = sea.native(name, seconds) if on_gtsam else sea.traced(name, seconds)
    kilobytes = {seconds: peak / 1024 for seconds, peak in peaks.items()}
    benchmark.extra_info |= {"ms_per_epoch": milliseconds} | {f"kB_{s}_s": kb for s, kb in kilobytes.items()}
    if benchmark.enabled:
        table.append((name, milliseconds, kilobytes))
    estimator = make(name)
    solver = getattr(estimator, "solver", estimator)  # a row that is no declaration is its own solver
    kalman = isinstance(solver, KalmanEstimator)
    if solver.smoother is None if kalman else type(solver).smooth is Estimator.smooth:  # no use for what is past
        assert peaks[pieces[1]] < 1.05 * peaks[pieces[0]] + FREE_LISTS
