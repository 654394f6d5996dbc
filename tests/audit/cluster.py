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

__all__ = ["rows"]

SCENARIO = "gnss-outage"
ROWS = ("ekf", "gated-ekf", "iae", "sw-fgo")
RUNS = 8
_TICKS = 100.0  # of /proc/PID/stat in a second


class _Cluster:
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

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait(10.0)


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """What, figure, promised, kept."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no worker is left behind
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cluster = _Cluster(folder)
        try:
            cluster.add()
            _run(cluster, folder / "warm", range(100, 101))  # kernels are loaded, and simnav is imported
            one = _run(cluster, folder / "one", range(RUNS))
            cluster.add()
            _run(cluster, folder / "warm", range(101, 105))
            two = _run(cluster, folder / "two", range(RUNS))
        finally:
            cluster.close()
        size = sum(p.stat().st_size for p in (folder / "one").rglob("*.parquet")) / RUNS
    faster = one.wall / two.wall
    scheduler, campaign = (1e3 * (getattr(one, n) + getattr(two, n)) / (2 * RUNS) for n in ("scheduler", "campaign"))
    worker = 1e3 * one.workers / RUNS
    yield f"runs a second of one worker, {len(ROWS)} rows", f"{RUNS / one.wall:.3g}", "", True
    yield "throughput of two workers over that of one", f"{faster:.2f}", "at least 1.8", faster >= 1.8
    yield "CPU of a worker for a run [ms]", f"{worker:.0f}, with two {1e3 * two.workers / RUNS:.0f}", "", True
    yield "CPU of the scheduler for a run [ms]", f"{scheduler:.1f}", "", True
    yield "CPU of the campaign's process for a run [ms]", f"{campaign:.1f}", "", True
    yield "results of a run on disk [kB]", f"{size / 1e3:.0f}", "", True
    most = worker / max(scheduler, campaign)
    yield "workers that are fed, for rows as quick as these", f"{most:.0f}", "", True


@dataclass(frozen=True)
class _Cost:
    """What a campaign took: wall time, and CPU time of the workers, the scheduler and the campaign's process [s]."""

    wall: float
    workers: float
    scheduler: float
    campaign: float


def _run(cluster: _Cluster, folder: Path, seeds: range) -> _Cost:
    requests = [EstimatorRequest(name) for name in ROWS]
    begin: list[tuple[float, float, float, float]] = []

    def now() -> tuple[float, float, float, float]:
        workers = sum(_cpu(pid) for worker in cluster.workers for pid in _family(worker.pid))
        return time.monotonic(), workers, _cpu(cluster.scheduler.pid), time.process_time()

    def seen(progress: Progress) -> None:
        if progress.stage == "run" and not begin:  # the estimators are resolved, the kernels compiled
            begin.append(now())

    run_campaign([load(SCENARIO)], requests, seeds, folder, backend="dask", scheduler=cluster.address, progress=seen)
    return _Cost(*(b - a for a, b in zip(begin[0], now(), strict=True)))


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
