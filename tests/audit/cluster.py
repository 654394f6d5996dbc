"""What a Dask cluster costs: the throughput of one and of two workers, and the work of the scheduler for each run.

Scheduler and workers are processes of their own on this machine. The second worker needs a core of its own, so the
ratio means nothing on a machine with other work.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.scenario import load

__all__ = ["rows"]

SCENARIO = "gnss-outage"
ROWS = ("ekf", "gated-ekf", "huber-kf", "iae", "sw-fgo", "gnc-fgo")
RUNS = 14
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
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cluster = _Cluster(folder)
        try:
            cluster.add()
            _run(cluster, folder / "warm", range(100, 102))  # kernels are loaded, and simnav is imported
            one, _, _ = _run(cluster, folder / "one", range(RUNS))
            cluster.add()
            _run(cluster, folder / "warm", range(102, 110))
            two, scheduler, campaign = _run(cluster, folder / "two", range(RUNS))
        finally:
            cluster.close()
        size = sum(p.stat().st_size for p in (folder / "one").rglob("*.parquet")) / RUNS
    yield f"runs a second of one worker, {len(ROWS)} rows", f"{RUNS / one:.3g}", "", True
    yield "throughput of two workers over that of one", f"{one / two:.2f}", "at least 1.8", one / two >= 1.8
    yield "CPU of the scheduler for a run [ms]", f"{1e3 * scheduler / RUNS:.1f}", "", True
    yield "CPU of the campaign's process for a run [ms]", f"{1e3 * campaign / RUNS:.1f}", "", True
    yield "results of a run on disk [kB]", f"{size / 1e3:.0f}", "", True
    most = RUNS / max(scheduler, campaign) / (RUNS / one)
    yield "workers that one scheduler feeds", f"{most:.0f}", "at least 100", most >= 100.0


def _run(cluster: _Cluster, folder: Path, seeds: range) -> tuple[float, float, float]:
    """Wall time of a campaign, and CPU time of the scheduler and of this process in it [s]."""
    requests = [EstimatorRequest(name) for name in ROWS]
    before, mine, started = _cpu(cluster.scheduler.pid), time.process_time(), time.monotonic()
    first: list[float] = []

    def seen(progress: object) -> None:
        if getattr(progress, "stage", "") == "run" and not first:
            first.append(time.monotonic())
            nonlocal mine
            mine = time.process_time()

    run_campaign([load(SCENARIO)], requests, seeds, folder, backend="dask", scheduler=cluster.address, progress=seen)
    end = time.monotonic()
    return end - (first or [started])[0], _cpu(cluster.scheduler.pid) - before, time.process_time() - mine


def _cpu(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS
