"""Make a folder of many results, and measure what it takes to read and rank them.

Run it in a process of its own, for the peak memory is the process's::

    python tests/benchmarks/many_results.py --results 100000 [--folder FOLDER]

The results look like those of a campaign: 60 scores and 26 kB of series each, in parts of a few thousand.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result, schema, to_table, write_tables
from simnav.scoring import SCORES

_PARTS = 16
_GROUP = 256


def make(folder: Path, results: int, scenarios: int = 24, estimators: int = 60) -> None:
    """Write a results folder of a finished campaign, seed by seed."""
    store.create(folder)
    rng = np.random.default_rng(0)
    time_ = np.linspace(0.0, 6000.0, 500, dtype=np.float32)
    series = {f"s{k}": time_ + np.float32(k) for k in range(12)} | {"time": time_, "horizontal": time_}
    template = to_table(Result("s0-v1", 0, "e0", {}, False, "ok", "", dict.fromkeys(SCORES, 1.0), series, key="k-0"))
    runs = [(f"s{s:02d}-v1", seed, f"e{e:02d}") for seed in range(-(-results // (scenarios * estimators)))
            for s in range(scenarios) for e in range(estimators)][:results]  # fmt: skip
    current: dict[str, tuple[str, dict[str, str]]] = {}
    for scenario, _, estimator in runs:
        current.setdefault(scenario, ("r", {}))[1][estimator] = f"{scenario}.{estimator}"
    store.select(folder, current)
    names = list(SCORES)

    def group(chosen: list[tuple[str, int, str]]) -> pa.Table:
        n = len(chosen)
        values = rng.lognormal(0.0, 0.3, (n, len(names)))
        columns: dict[str, Any] = {
            name: pa.chunked_array([template.column(name).chunk(0)] * n) for name in schema().names
        }
        columns["scenario"] = pa.array([s for s, _, _ in chosen])
        columns["seed"] = pa.array([k for _, k, _ in chosen])
        columns["estimator"] = pa.array([e for _, _, e in chosen])
        columns["key"] = pa.array([f"{s}.{e}-{k}" for s, k, e in chosen])
        columns["reference"] = pa.array([e == "e00" for _, _, e in chosen])
        offsets = pa.array(np.arange(n + 1, dtype=np.int32) * len(names))
        columns["scores"] = pa.MapArray.from_arrays(offsets, pa.array(names * n), pa.array(values.ravel()))
        return pa.table(columns, schema=schema())

    def groups(part: list[tuple[str, int, str]]) -> Iterator[pa.Table]:
        for k in range(0, len(part), _GROUP):
            yield group(part[k : k + _GROUP])

    size = -(-len(runs) // _PARTS)
    for p in range(0, len(runs), size):
        with open(folder / "compacted" / f"part-{p:08d}.parquet", "wb") as file:
            write_tables(file, groups(runs[p : p + size]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=int, default=100_000)
    parser.add_argument("--folder", type=Path, help="keep the results here; made if it is not there")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = given.folder or Path(name) / "results"
        if not folder.exists():
            import subprocess
            import sys

            code = (
                f"from many_results import make; from pathlib import Path; make(Path({str(folder)!r}), {given.results})"
            )
            subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parent)
        from simnav.leaderboard import interface

        started = time.perf_counter()
        stored = len(store.keys(folder))
        scanned = time.perf_counter()
        ranking = interface.rank(folder)
        ranked = time.perf_counter()
        megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        rows = sum(len(t.rows) for t in ranking.tracks)
        print(f"{stored} results: scan of a resumed campaign {scanned - started:.1f} s, read and ranked "
              f"{ranked - scanned:.1f} s ({rows} rows), peak memory {megabytes:.0f} MiB")  # fmt: skip


if __name__ == "__main__":
    main()
