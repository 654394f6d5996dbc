"""A campaign on a Dask cluster of separate processes: nothing is lost with a worker or with the scheduler."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from simnav.leaderboard.campaign.campaign import CampaignError, run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results import store
from simnav.leaderboard.results.provenance import here
from simnav.scenario import parse
from tests.cases import ship

pytestmark = pytest.mark.skipif(not find_spec("distributed"), reason="the extra 'distributed' is not installed")

SHIP = ship("tiny-ship", 60.0)

MINE = """
import time
from pathlib import Path
from simnav import Estimate, Estimator, register

@register("last-fix")
class LastFix(Estimator):
    def reset(self, start, instruments):
        self.position = start.position
        time.sleep({pause})

    def update(self, measurements):
        fix = measurements.latest("gnss_position")
        if fix is not None:
            self.position = fix.value
        return Estimate(measurements.time, position=self.position)
"""


class Cluster:
    """A scheduler and workers, each a process of its own that can be killed."""

    def __init__(self, folder: Path, workers: int):
        self.file, self.folder = folder / "scheduler.json", folder
        self.processes = [self._start("dask_scheduler", "--scheduler-file", str(self.file), "--port", "0",
                                      "--host", "127.0.0.1", "--no-dashboard")]  # fmt: skip
        self.workers = [self.worker() for _ in range(workers)]
        deadline = time.monotonic() + 60.0
        while not (self.file.exists() and self.file.stat().st_size) and time.monotonic() < deadline:
            time.sleep(0.1)

    def _start(self, module: str, *words: str) -> subprocess.Popen[bytes]:
        with open(self.folder / f"{module}.log", "ab") as log:
            command = [sys.executable, "-c", f"from distributed.cli.{module} import main; main()", *words]
            return subprocess.Popen(command, stdout=log, stderr=log,
                                    cwd=self.folder)  # fmt: skip

    def worker(self) -> subprocess.Popen[bytes]:
        made = self._start("dask_worker", "--scheduler-file", str(self.file), "--nthreads", "1", "--no-nanny",
                           "--no-dashboard", "--host", "127.0.0.1", "--local-directory", str(self.folder / "scratch")
                           )  # fmt: skip
        self.processes.append(made)
        return made

    @property
    def address(self) -> str:
        import json

        return str(json.loads(self.file.read_text())["address"])

    def close(self) -> None:
        for process in self.processes:
            process.kill()
        for process in self.processes:
            process.wait(10.0)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path, 2)
    yield made
    made.close()


def request_of(folder: Path, pause: float) -> EstimatorRequest:
    path = folder / "last_fix.py"
    path.write_text(MINE.format(pause=pause))
    return EstimatorRequest(str(path), label="last-fix")


def rows(folder: Path) -> list[tuple[int, str, float]]:
    return [(r.seed, r.status, r.scores["horizontal_rmse"]) for r in store.load(folder)]


def killed_after(results: Path, count: int, process: subprocess.Popen[bytes]) -> threading.Thread:
    """Kill a process as soon as so many results are there."""

    def wait() -> None:
        deadline = time.monotonic() + 240.0
        while time.monotonic() < deadline and len(list((results / "results").glob("*.parquet"))) < count:
            time.sleep(0.02)
        process.kill()

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


def test_nothing_is_lost_with_a_worker_or_with_the_scheduler(tmp_path: Path, cluster: Cluster) -> None:
    """Results travel through the scheduler: the workers do not see the folder of the campaign."""
    request, seeds, out = request_of(tmp_path, 0.2), range(8), tmp_path / "out"
    threads = [killed_after(out, 1, cluster.workers[0]), killed_after(out, 4, cluster.processes[0])]
    with pytest.raises(CampaignError, match="scheduler"):
        run_campaign([parse(SHIP)], [request], seeds, out, backend="dask", scheduler=cluster.address,
                     confinement="none")  # fmt: skip
    for thread in threads:
        thread.join()
    assert cluster.workers[0].poll() is not None
    kept = len(store.keys(out))
    assert 4 <= kept < 8  # the other worker went on alone
    assert not list((tmp_path / "scratch").rglob("*.parquet"))
    again = run_campaign([parse(SHIP)], [request], seeds, out, workers=1, confinement="none")
    assert (again.skipped, again.computed) == (kept, 8 - kept)
    run_campaign([parse(SHIP)], [request], seeds, tmp_path / "here", workers=1, confinement="none")
    assert rows(out) == rows(tmp_path / "here")
    assert {r.provenance.commit for r in store.load(out)} == {here().commit}


def test_a_scheduler_that_is_not_there_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from simnav.leaderboard.campaign import cluster

    monkeypatch.setattr(cluster, "WAIT", 1.0)
    request = request_of(tmp_path, 0.0)
    with pytest.raises(CampaignError, match=r"the Dask scheduler tcp://127.0.0.1:1 cannot be used"):
        run_campaign([parse(SHIP)], [request], [0], tmp_path / "out", backend="dask", scheduler="tcp://127.0.0.1:1")
