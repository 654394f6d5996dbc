"""A ship's sliding window against its full graph: Jiang et al. (2026) print 23.8 s and 381.4 s.


Run with ``pytest tests/benchmarks/test_bench_ship_graphs.py --benchmark-enable`` (``make bench``); the factors are
printed with ``-s`` and kept in the benchmark's ``extra_info``.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest

from simnav.estimator import Estimator, make
from simnav.estimators.rows.windows import ShipFgo, ShipFgoFull
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record

#: Of the piece and of the whole run [s].
PIECE, WHOLE = 300, 1500


def voyage(duration: int) -> Recording:
    return record(load("ship-dead-reckoning").model_copy(update={"duration": float(duration)}), 1)


def run(estimator: Estimator, recording: Recording) -> np.ndarray:
    """Seconds of computing from the start to the end of each epoch."""
    steps = list(recording.steps())
    estimator.reset(recording.start, recording.instruments)
    ends = np.empty(len(steps))
    begin = perf_counter()
    for k, step in enumerate(steps):
        estimator.update(step)
        ends[k] = perf_counter() - begin
    return ends


def test_sliding_window_against_full_graph(benchmark):
    """A whole run of each, side by side; the full graph's time, in the table, grows with the square of the length."""
    recording = voyage(WHOLE if benchmark.enabled else 30)
    sliding = np.minimum(run(ShipFgo(), recording), run(ShipFgo(), recording))
    full = benchmark.pedantic(run, args=(ShipFgoFull(), recording), rounds=1)
    assert len(full) == len(sliding) == recording.data.end
    if benchmark.enabled:
        piece, whole = PIECE - 1, WHOLE - 1
        figures = {
            "sliding_seconds": sliding[whole],
            "full_seconds": full[whole],
            "factor_at_300_s": full[piece] / sliding[piece],
            "factor": full[whole] / sliding[whole],
            "growth_sliding": sliding[whole] / sliding[piece],
            "growth_full": full[whole] / full[piece],
        }
        benchmark.extra_info.update(figures)
        print("\n" + ", ".join(f"{name} {value:.3g}" for name, value in figures.items()))
        # Five times the length: the window takes five times as long, the full graph up to 25 times.
        assert figures["growth_sliding"] < 7.0
        assert figures["growth_full"] > 10.0
        assert figures["factor"] > 5.0


@pytest.mark.parametrize("name", ["ship-ekf", "ship-fgo"])
def test_epoch(benchmark, name: str):
    """One epoch of a second: GNSS, compass, log."""
    recording = voyage(PIECE if benchmark.enabled else 30)
    steps = list(recording.steps())
    estimator = make(name)
    estimator.reset(recording.start, recording.instruments)
    results = []
    todo = iter(steps)
    benchmark.pedantic(lambda: results.append(estimator.update(next(todo))), rounds=len(steps) - 25, warmup_rounds=25)
    assert np.isfinite(results[-1].covariance).all()
    assert results[-1].diagnostics["skipped"] == 0
