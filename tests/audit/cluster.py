"""What a Dask cluster costs: the throughput of one and of two workers, and the work of the scheduler for each run.

Scheduler and workers are processes of their own on this machine. The second worker needs a core of its own, so the
ratio means nothing on a machine with other work.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from simnav.leaderboard.campaign.campaign import Progress, run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.scenario import load

__all__ = ["Cluster", "Cost", "cost", "rows"]

SCENARIO = "gnss-outage"
ROWS = ("ekf", "gated-ekf", "iae", "sw-fgo")
RUNS, WAITS = 16, 8
IDLE = 5.0  # for which the scheduler is watched without work [s]

#: Stands for an estimator that has a core of its own, on a machine that has none free.
WAITING = """
import time
from simnav import Estimate, Estimator, register

@register("waiting")
class Waiting(Estimator):
    def reset(self, start, instruments):
        self.position = start.position
        time.sleep(8.0)

    def update(self, measurements):
        return Estimate(measurements.time, position=self.position)
"""
_TICKS = 100.0  # of /proc/PID/stat in a second


class Cluster:
    """A scheduler and workers."""

    def __init__(self, folder: Path):
        self.folder, self.file = folder, folder / "scheduler.json"
        self.scheduler = self._start("dask_scheduler", "--port", "0", "--host", "127.0.0.1", "--no-dashboard")
        self.workers: list[subprocess.Popen[bytes]] = []
        while not (self.file.exists() and self.file.stat().st_size):
            time.sleep(0.1)
        self.address = str(json.loads(self.file.read_text())["address"])

    def _start(self, module: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-c", f"from distributed.cli.{module} import main; main()", "--scheduler-file",
                   str(self.file), *words]  # fmt: skip
        return subprocess.Popen(command, cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def add(self) -> None:
        self.workers.append(
            self._start("dask_worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1",
                        "--local-directory", str(self.folder / f"scratch-{len(self.workers)}"))
        )  # fmt: skip

    def warm(self) -> None:
        """Let each worker import simnav and load the kernels."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(len(self.workers))
            client.run(exec, "import simnav.leaderboard.campaign.cluster\nfrom simnav.warmup import warmup\nwarmup()")

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait(10.0)


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no worker is left behind
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "waiting.py").write_text(WAITING)
        computing = [EstimatorRequest(row) for row in ROWS]
        waiting = [EstimatorRequest(str(folder / "waiting.py"), label="waiting")]
        cluster = Cluster(folder)
        try:
            cluster.add()
            cluster.warm()
            one = cost(cluster, computing, folder / "one", range(RUNS))
            one_waits = cost(cluster, waiting, folder / "one-waits", range(WAITS))
            cluster.add()
            cluster.warm()
            two = cost(cluster, computing, folder / "two", range(RUNS))
            two_wait = cost(cluster, waiting, folder / "two-wait", range(WAITS))
            before = _cpu(cluster.scheduler.pid)
            time.sleep(IDLE)
            idle = (_cpu(cluster.scheduler.pid) - before) / IDLE
        finally:
            cluster.close()
        size = sum(p.stat().st_size for p in (folder / "one").rglob("*.parquet")) / RUNS
    parts = (one, two, one_waits, two_wait)
    runs = 2 * (RUNS + WAITS)
    scheduler = 1e3 * max(0.0, sum(c.scheduler - idle * c.wall for c in parts)) / runs
    campaign = 1e3 * sum(c.campaign for c in parts) / runs
    four = 1e3 * (one.campaign + two.campaign) / (2 * RUNS)
    single = 1e3 * (one_waits.campaign + two_wait.campaign) / (2 * WAITS)
    faster, waits = one.wall / two.wall, one_waits.wall / two_wait.wall
    yield f"two workers over one, {len(ROWS)} rows that compute", f"{faster:.2f}", "as cores are free", True
    yield "two workers over one, a row that waits 8 s", f"{waits:.2f}", "at least 1.8", waits >= 1.8
    yield "CPU of a worker for a run [ms]", f"{1e3 * one.workers / RUNS:.0f}, {1e3 * two.workers / RUNS:.0f}", "", True
    yield "CPU of the idle scheduler [% of a core]", f"{100.0 * idle:.1f}", "", True
    yield "CPU of the scheduler for a run, more than idle [ms]", f"{scheduler:.1f}", "", True
    yield "CPU of the campaign's process for a run [ms]", f"{campaign:.1f}", "", True
    yield "  of four rows and of one [ms]", f"{four:.1f}, {single:.1f}", "", True
    yield "results of a run on disk [kB]", f"{size / 1e3:.0f}", "", True


@dataclass(frozen=True)
class Cost:
    """What a campaign took: wall time, and CPU time of the workers, the scheduler and the campaign's process [s]."""

    wall: float
    workers: float
    scheduler: float
    campaign: float


def cost(cluster: Cluster, requests: list[EstimatorRequest], folder: Path, seeds: range) -> Cost:
    """What a campaign on a cluster takes from its first to its last run."""
    seen_at: list[tuple[float, float, float, float]] = []

    def now() -> tuple[float, float, float, float]:
        workers = sum(_cpu(pid) for worker in cluster.workers for pid in _family(worker.pid))
        return time.monotonic(), workers, _cpu(cluster.scheduler.pid), time.process_time()

    def seen(progress: Progress) -> None:
        if progress.stage == "run":  # the first: estimators are resolved; the last: all runs are there
            seen_at.append(now())

    run_campaign([load(SCENARIO)], requests, seeds, folder, backend="dask", scheduler=cluster.address, progress=seen,
                 confinement="none")  # fmt: skip
    return Cost(*(b - a for a, b in zip(seen_at[0], seen_at[-1], strict=True)))


def _family(pid: int) -> list[int]:
    """A process and its descendants."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    threads = {int(t.name) for t in Path(f"/proc/{pid}/task").iterdir()} - {pid}
    for thread in threads:
        children += Path(f"/proc/{pid}/task/{thread}/children").read_text().split()
    return [pid, *(p for child in children for p in _family(int(child)))]


def _cpu(pid: int) -> float:
    """Of a process, and of its children that have ended."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / _TICKS
