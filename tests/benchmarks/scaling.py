"""How the time of a campaign grows: with runs, their length, rows, nodes of a window, and workers of a Dask cluster.

    python -m tests.benchmarks.scaling           # measure, keep the figures in scaling.csv, draw and print them
    python -m tests.benchmarks.scaling --draw    # draw and print what is kept

Run it on a quiet machine. The time of a campaign is wall-clock time, with one worker and without confinement, the least
of `REPEATS`: processor time would miss processes that go on after a campaign. What a campaign takes without work (one
run of `IDLE` seconds) is measured, too: the exponents are those of the time without it. Windows and rankings, in this
process, are measured in processor time.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from simnav.estimator import make
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results import store
from simnav.scenario import load
from simnav.source import record
from tests.audit.cluster import Cluster, cost
from tests.benchmarks import many_results

__all__ = ["FILE", "Figures", "exponent", "model", "read"]

FILE = Path(__file__).with_suffix(".csv")
FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "scaling.png"
SCENARIO = "open-sea"
#: Rows that cost the same: one with different parameters.
ROWS = [EstimatorRequest("gated-ekf", {"patience": 10.0 + k}) for k in range(8)]
#: Rows on a cluster.
CLUSTER_ROWS = ("ekf", "sw-fgo", "iae", "gnc-fgo")
RUNS, SOME, LENGTH = 4, 2, 150.0  # what is not varied: runs, rows, and the length of a run [s]
IDLE = 2.0  # a run with hardly any work [s]
SIZES = (1, 2, 4, 8)
NODES = (5, 10, 20, 40, 80)
EPOCHS = 60
REPEATS = 3
CLUSTER_RUNS = 8
WORKERS = (1, 2, 4)
RESULTS = (320, 640, 1280)
WALL = "wall clock"
ASKED = (1, 2, 4, 10, 30, 100, 300)

#: Value of each quantity at each size of each series [s, kB].
Figures = dict[str, dict[str, dict[float, float]]]


def campaign_seconds(runs: int = RUNS, rows: int = SOME, length: float = LENGTH) -> float:
    """Time of a campaign with one worker; the least of some [s]."""
    scenario = load(SCENARIO).model_copy(update={"duration": length})
    found = []
    for _ in range(REPEATS):
        with tempfile.TemporaryDirectory() as folder:
            begun = time.perf_counter()
            run_campaign([scenario], ROWS[:rows], range(runs), folder, workers=1, confinement="none")
            found.append(time.perf_counter() - begun)
    return min(found)


def epoch_seconds(nodes: int) -> float:
    """Mean processor time of an epoch of ``sw-fgo`` with a full window; the least of three runs [s]."""
    recording = record(load(SCENARIO).model_copy(update={"duration": float(max(NODES) + EPOCHS)}), 1)
    steps, found = list(recording.steps()), []
    for _ in range(3):
        estimator = make("sw-fgo", window=nodes)
        estimator.reset(recording.start, recording.instruments)
        for step in steps[: nodes + 1]:
            estimator.update(step)
        begun = time.process_time()
        for step in steps[nodes + 1 : nodes + 1 + EPOCHS]:
            estimator.update(step)
        found.append((time.process_time() - begun) / EPOCHS)
    return min(found)


def ranking_seconds(results: int) -> float:
    """Processor time of reading a folder of results and ranking them [s]."""
    from simnav.leaderboard.ranking.ranking import rank

    with tempfile.TemporaryDirectory() as folder:
        many_results.make(Path(folder), results, scenarios=4, estimators=20)
        begun = time.process_time()
        rank(store.load(folder))
        return time.process_time() - begun


def cluster_figures() -> Iterator[tuple[str, int, str, float]]:
    """What a run of `CLUSTER_ROWS` rows costs on a cluster of local workers, for each number of workers."""
    requests = [EstimatorRequest(row) for row in CLUSTER_ROWS]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cluster = Cluster(folder)
        try:
            for workers in WORKERS:
                while len(cluster.workers) < workers:
                    cluster.add()
                cluster.warm()
                if workers == WORKERS[0]:  # the scheduler loads simnav with the first campaign
                    cost(cluster, requests, folder / "first", range(1))
                found = cost(cluster, requests, folder / str(workers), range(CLUSTER_RUNS))
                size = sum(p.stat().st_size for p in (folder / str(workers)).rglob("*.parquet"))
                for quantity, value in (
                    (WALL, found.wall), ("worker", found.workers), ("scheduler", found.scheduler),
                    ("campaign", found.campaign), ("kB", size / 1e3),
                ):  # fmt: skip
                    yield "workers", workers, quantity, value / CLUSTER_RUNS
        finally:
            cluster.close()


def measured() -> Iterator[tuple[str, float, str, float]]:
    """Series, size, quantity, value."""
    campaign_seconds(runs=1, rows=len(ROWS), length=IDLE)  # kernels are compiled and loaded, files are read
    yield "start", 1, "campaign", campaign_seconds(runs=1, rows=1, length=IDLE)
    for k in SIZES:
        yield "runs", k * RUNS, "campaign", campaign_seconds(runs=k * RUNS)
        yield "length", k * LENGTH, "campaign", campaign_seconds(length=k * LENGTH)
        yield "rows", k, "campaign", campaign_seconds(rows=k)
    for nodes in NODES:
        yield "nodes", nodes, "epoch", epoch_seconds(nodes)
    for results in RESULTS:
        yield "results", results, "ranking", ranking_seconds(results)
    yield from cluster_figures()


def read(path: Path = FILE) -> Figures:
    """The figures that are kept."""
    figures: Figures = {}
    with path.open(newline="") as file:
        for line in csv.DictReader(file):
            series = figures.setdefault(line["series"], {}).setdefault(line["quantity"], {})
            series[float(line["size"])] = float(line["value"])
    return figures


def exponent(times: dict[float, float], start: float = 0.0) -> float:
    """The power of the size with which the time without the start grows: a straight line through the logarithms."""
    sizes = np.array(sorted(times))
    return float(np.polyfit(np.log(sizes), np.log([times[s] - start for s in sizes]), 1)[0])


def slope(times: dict[float, float]) -> float:
    """Time for each further unit of size: a straight line through the times."""
    sizes = np.array(sorted(times))
    return float(np.polyfit(sizes, [times[s] for s in sizes], 1)[0])


def model(figures: Figures, workers: int) -> tuple[float, str]:
    """Runs a second on a cluster of so many workers with a core each, and what limits them.

    Workers record and run side by side; the scheduler, and the process of the campaign, which receives and writes the
    results, do so one run after the other. The costs of a run are those with one worker.
    """
    parts = {what: figures["workers"][what][1.0] for what in ("worker", "scheduler", "campaign")}
    rates = {
        "the workers": workers / parts["worker"],
        "the scheduler": 1.0 / parts["scheduler"],
        "the results, which one process receives and writes": 1.0 / parts["campaign"],
    }
    limit = min(rates, key=rates.__getitem__)
    return rates[limit], limit


def say(figures: Figures) -> None:
    """Print exponents, costs and the model."""
    start = figures["start"]["campaign"][1.0]
    print(f"a campaign without work: {start:.2f} s")
    for series, quantity, without in (
        ("runs", "campaign", start), ("length", "campaign", start), ("rows", "campaign", start),
        ("nodes", "epoch", 0.0), ("results", "ranking", 0.0),
    ):  # fmt: skip
        times = figures.get(series, {}).get(quantity, {})
        if len(times) < 2:
            continue
        listed = ", ".join(f"{size:g}: {1e3 * value:.3g}" for size, value in times.items())
        print(f"{series:8} exponent {exponent(times, without):5.2f}; {1e3 * slope(times):.3g} ms each; {listed} ms")
    if "workers" not in figures:
        return
    for workers in WORKERS:
        own = {what: times[float(workers)] for what, times in figures["workers"].items()}
        listed = ", ".join(f"{what} {v:.0f}" if what == "kB" else f"{what} {1e3 * v:.1f} ms" for what, v in own.items())
        print(f"a run of {len(CLUSTER_ROWS)} rows with {workers} workers: {listed}")
    for workers in ASKED:
        rate, limit = model(figures, workers)
        print(f"{workers:4d} workers: {rate:6.2f} runs a second, limited by {limit}")


def draw(figures: Figures, path: Path = FIGURE) -> None:
    """The figure of the page on performance."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    start = figures["start"]["campaign"][1.0]
    known = "workers" in figures
    fig, axes = plt.subplots(1, 1 + known, figsize=(9.0 if known else 5.0, 3.8), layout="constrained", squeeze=False)
    left = axes[0, 0]
    for (series, quantity, without, unit), marker in zip(
        (
            ("runs", "campaign", start, float(RUNS)), ("length", "campaign", start, LENGTH),
            ("rows", "campaign", start, 1.0), ("nodes", "epoch", 0.0, float(NODES[0])),
        ),
        "osD^", strict=True,
    ):  # fmt: skip
        times = figures[series][quantity]
        first = times[min(times)] - without
        name = {"length": "length of a run", "nodes": "nodes of a window"}.get(series, series)
        left.loglog(
            [size / unit for size in times], [(t - without) / first for t in times.values()], marker=marker,
            label=f"{name}: exponent {exponent(times, without):.2f}",
        )  # fmt: skip
    left.loglog([1, 16], [1, 16], color="grey", lw=0.8, ls=":", label="in proportion")
    left.set(xlabel="Size, relative to the smallest", ylabel="Time, relative to the smallest")
    if known:
        _draw_cluster(figures, axes[0, 1])
    left.legend(frameon=False, fontsize=8)
    left.grid(alpha=0.3)
    fig.savefig(path, dpi=120)
    plt.close(fig)


def _draw_cluster(figures: Figures, right: Any) -> None:
    asked = np.unique(np.geomspace(1, 1000, 60).round().astype(int))
    right.loglog(asked, [model(figures, int(n))[0] for n in asked], color="grey", lw=1.0, label="model")
    walls = figures["workers"][WALL]
    right.loglog(list(walls), [1.0 / t for t in walls.values()], "o", label="measured, on two cores")
    right.set(xlabel="Workers of a Dask cluster", ylabel=f"Runs of {len(CLUSTER_ROWS)} rows a second")
    right.legend(frameon=False, fontsize=8)
    right.grid(alpha=0.3)


def main() -> None:
    """The command of the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draw", action="store_true", help="measure nothing")
    given = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not given.draw:
        with FILE.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("series", "size", "quantity", "value"))
            for series, size, quantity, value in measured():
                print(series, size, quantity, value, flush=True)
                writer.writerow((series, size, quantity, f"{value:.4g}"))
                file.flush()  # what was measured is kept if the rest is not
    say(read())
    draw(read())


if __name__ == "__main__":
    main()
