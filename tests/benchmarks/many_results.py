"""Make a folder of many results, and measure what it takes to rank them and to write their site.

Run it in a process of its own, for the peak memory is the process's::

    python tests/benchmarks/many_results.py [--results 288000] [--folder FOLDER] [--site SITE]

Scenarios and estimators are those of the catalogue. Scores and series are those of one real run, multiplied by random
factors, so that their columns and their size are real (30 kB of series a run). The folder is that of a campaign that
was run in 16 parts, a range of seeds each.
"""

from __future__ import annotations

import argparse
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from simnav.leaderboard.results import store
from simnav.leaderboard.results.provenance import BENCHMARK, Provenance
from simnav.leaderboard.results.result import Result, schema, to_table, write_tables

_SCENARIOS, _ESTIMATORS = 24, 60
_PARTS = 16
_GROUP = 256
_TIMES = ("time", "diagnostics_time")


def real_run() -> Result:
    """One run of a robust window, which has weights and residuals."""
    from simnav.estimator import make as made
    from simnav.scenario import load
    from simnav.scoring import score, series
    from simnav.source import record
    from simnav.trial import run_trial

    recording = record(load("harbour-multipath"), 0)
    trial = run_trial(made("gnc-fgo"), recording)
    curves = {name: np.asarray(v, dtype=np.float32) for name, v in series(trial, recording).items()}
    origin = Provenance(BENCHMARK, "c0ffee" * 6, False, "0", "3", "2", "0", "4", "Linux", "a processor", 2, "", "")
    return Result("s", 0, "e", {}, False, "ok", "", score(trial, recording), curves, seconds=1.5, peak_memory=2**27,
                  key="k-0", provenance=origin, draws=recording.draws)  # fmt: skip


def rows_of(scenarios: int, estimators: int) -> tuple[list[str], list[str]]:
    """Scenarios of the catalogue that are simulated, and estimators; oracles among them."""
    from simnav.estimator import names
    from simnav.scenario import headers, load

    chosen = [h.id for h in headers() if h.track != "training" and load(h.name).log is None]
    every = [n for n in names() if n.startswith("oracle")] + [n for n in names() if not n.startswith("oracle")]
    return sorted(chosen)[:scenarios], every[:estimators]


def make(folder: Path, results: int, scenarios: int = _SCENARIOS, estimators: int = _ESTIMATORS) -> None:
    """Write a results folder of a finished campaign."""
    store.create(folder)
    rng = np.random.default_rng(0)
    one = real_run()
    store.write(folder, one)  # its provenance
    next((folder / "results").glob("*.parquet")).unlink()
    chosen, labels = rows_of(scenarios, estimators)
    seeds = max(1, results // (len(chosen) * len(labels)))
    store.select(folder, {s: ("r", {e: f"{s}.{e}" for e in labels}) for s in chosen})
    template = to_table(one)
    score_names, score_values = list(one.scores), np.array(list(one.scores.values()))
    size = np.array([a.size for a in one.series.values()])
    shapes = pa.array([list(a.shape) for a in one.series.values()], pa.list_(pa.int64()))
    flat = np.concatenate([a.ravel() for a in one.series.values()])
    fixed = np.repeat([n in _TIMES or n.startswith("weight") for n in one.series], size)
    easy = dict(zip(labels, rng.lognormal(0.0, 0.4, len(labels)), strict=True))

    def group(runs: list[tuple[str, str, int]]) -> pa.Table:
        n = len(runs)
        factor = np.array([easy[e] for _, e, _ in runs]) * rng.lognormal(0.0, 0.3, n)
        values = (flat[None] * np.where(fixed[None], 1.0, factor[:, None])).astype(np.float32)
        columns: dict[str, Any] = {name: pa.repeat(template.column(name)[0], n) for name in schema().names}
        columns["scenario"] = pa.array([s for s, _, _ in runs])
        columns["estimator"] = pa.array([e for _, e, _ in runs])
        columns["seed"] = pa.array([k for _, _, k in runs])
        columns["key"] = pa.array([f"{s}.{e}-{k}" for s, e, k in runs])
        columns["reference"] = pa.array([e.startswith("oracle") for _, e, _ in runs])
        offsets = pa.array(np.arange(n + 1, dtype=np.int32) * len(score_names))
        scores = score_values[None] * factor[:, None]
        columns["scores"] = pa.MapArray.from_arrays(offsets, pa.array(score_names * n), pa.array(scores.ravel()))
        ends = np.concatenate([[0], np.cumsum(np.tile(size, n))]).astype(np.int32)
        items = pa.StructArray.from_arrays(
            [pa.array(list(one.series) * n), pa.concat_arrays([shapes] * n),
             pa.ListArray.from_arrays(pa.array(ends), pa.array(values.ravel()))],
            ["name", "shape", "values"],
        )  # fmt: skip
        columns["series"] = pa.ListArray.from_arrays(pa.array(np.arange(n + 1, dtype=np.int32) * len(size)), items)
        return pa.table(columns, schema=schema())

    def groups(runs: list[tuple[str, str, int]]) -> Iterator[pa.Table]:
        for k in range(0, len(runs), _GROUP):
            yield group(runs[k : k + _GROUP])

    for part, some in enumerate(np.array_split(np.arange(seeds), min(_PARTS, seeds))):
        # A part is sorted by the keys of its results, which are digests: scenarios and estimators are mixed.
        variants = list(product(chosen, labels))
        rng.shuffle(variants)
        with open(folder / "compacted" / f"part-{part:08d}.parquet", "wb") as file:
            write_tables(file, groups([(s, e, int(k)) for s, e in variants for k in some]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=int, default=_SCENARIOS * _ESTIMATORS * 200)
    parser.add_argument("--folder", type=Path, help="keep the results here; made if it is not there")
    parser.add_argument("--site", type=Path, help="write the site here, and measure that, too")
    parser.add_argument("--workers", type=int, default=2, help="processes that prepare the site")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = given.folder or Path(name) / "results"
        if not folder.exists():  # in another process, whose memory does not count
            code = (
                f"from many_results import make; from pathlib import Path; make(Path({str(folder)!r}), {given.results})"
            )
            subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parent)
        from simnav.leaderboard import interface

        def megabytes() -> float:
            own, others = (resource.getrusage(w).ru_maxrss for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
            return max(own, others) / 1024.0

        started, cpu = time.perf_counter(), time.process_time()
        stored = len(store.keys(folder))
        scanned = time.perf_counter()
        ranking = interface.rank(folder)
        ranked = time.perf_counter()
        cpu = time.process_time() - cpu
        rows = sum(len(t.rows) for t in ranking.tracks)
        print(f"{stored} results: scan of a resumed campaign {scanned - started:.1f} s, read and ranked "
              f"{ranked - scanned:.1f} s ({rows} rows; CPU {cpu:.1f} s), "
              f"peak memory {megabytes():.0f} MiB", flush=True)  # fmt: skip
        if given.site is None:
            return
        from simnav.leaderboard.site.site import build

        started, cpu = time.perf_counter(), time.process_time()
        found = interface.results_of(folder, series=True)
        read = time.perf_counter()
        ranking = interface.rank(found)
        ranked = time.perf_counter()
        build(found, ranking, given.site, workers=given.workers)
        built, cpu = time.perf_counter(), time.process_time() - cpu
        size = sum(f.stat().st_size for f in given.site.rglob("*") if f.is_file()) / 2**20
        largest = max(given.site.glob("*.html"), key=lambda f: f.stat().st_size)
        print(f"site: read {read - started:.1f} s, ranked {ranked - read:.1f} s, written {built - ranked:.1f} s, "
              f"all {built - started:.1f} s (CPU {cpu:.1f} s), peak memory {megabytes():.0f} MiB; "
              f"{math.ceil(size)} MiB, largest page {largest.name} {largest.stat().st_size / 1000:.0f} kB")  # fmt: skip


if __name__ == "__main__":
    main()
