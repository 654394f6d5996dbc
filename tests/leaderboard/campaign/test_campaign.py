"""Campaigns: resumed after any death, undisturbed by bad estimators, the same on one worker or two."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from simnav.leaderboard.campaign import campaign
from simnav.leaderboard.campaign.campaign import CampaignError, Progress, run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.leaderboard.results.gathering import gather
from simnav.leaderboard.results.provenance import BENCHMARK, numerics
from simnav.leaderboard.results.store import Result, StoreError
from simnav.scenario import Scenario, load, parse
from simnav.simulation.version import SIMULATOR_VERSION
from simnav.warmup import warmup
from tests.cases import ship

pytestmark = pytest.mark.skipif(os.name != "posix", reason="isolation without fork takes seconds a run")

SHIP = ship("tiny-ship", 20.0)

GOOD = '''
import numpy as np
from simnav import Estimate, Estimator, register
{imports}

@register("{name}")
class Mine(Estimator):
    """The last fix, and a body for mischief."""

    def __init__(self, gain: float = 1.0):
        self.gain = gain

    def reset(self, start, instruments):
        self.position = start.position

    def update(self, measurements):
        fix = measurements.latest("gnss_position")
        if fix is not None:
            self.position = self.position + self.gain * (fix.value - self.position)
        {mischief}
        return Estimate(measurements.time, position=self.position)
'''

BAD = {
    "raises": "raise RuntimeError('lost')",
    "nan": "self.position = self.position * np.nan",
    "wrong-shape": "self.position = np.zeros(4)",
    "hangs": "import time; time.sleep(1000.0)",
    "eats-memory": "\n        while True: self.eaten = getattr(self, 'eaten', []) + [bytearray(1 << 20)]",
    "leaves": "import os; os._exit(0)",
}
STATUS = {
    "raises": "error",
    "nan": "invalid-output",
    "wrong-shape": "invalid-output",
    "hangs": "timeout",
    "eats-memory": "out-of-memory",
    "leaves": "error",
}


@pytest.fixture(scope="module", autouse=True)
def warm() -> None:
    """On a fresh machine the kernels compile here, not within a test that waits for something."""
    warmup(load=False)


def scenario(name: str = "tiny-ship", **changes: str) -> Scenario:
    text = SHIP.replace("tiny-ship", name)
    for old, new in changes.items():
        text = re.sub(rf"^{old} = .*$", f"{old} = {new}", text, flags=re.MULTILINE)
    return parse(text)


def estimator(folder: Path, name: str = "last-fix", mischief: str = "pass", imports: str = "") -> EstimatorRequest:
    path = folder / f"{name.replace('-', '_')}.py"
    path.write_text(GOOD.format(name=name, mischief=mischief, imports=imports))
    return EstimatorRequest(str(path), label=name)


def row(r: Result) -> tuple[Any, ...]:
    """A result without what no two runs share."""
    scores = {k: v for k, v in r.scores.items() if not k.startswith("update_")}
    return r.scenario, r.estimator, r.seed, r.status, r.reason, json.dumps(scores)


def rows(folder: Path) -> list[tuple[Any, ...]]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return [row(r) for r in store.load(folder)]


def test_bad_estimators_are_recorded_and_everyone_else_stands(tmp_path: Path) -> None:
    requests = [estimator(tmp_path, name, mischief) for name, mischief in BAD.items()]
    requests.insert(3, estimator(tmp_path))
    out = tmp_path / "results"
    summary = run_campaign([scenario()], requests, [7], out, workers=2, time_limit=3.0, memory_limit=200)
    found = {r.estimator: r for r in store.load(out)}
    assert {name: found[name].status for name in BAD} == STATUS
    assert all(found[name].reason for name in BAD)
    assert "lost" in found["raises"].reason
    good = found["last-fix"]
    assert good.status == "ok"
    assert 0.5 < good.scores["horizontal_rmse"] < 20.0
    assert len(good.series["time"]) == 20
    assert 0.0 < good.seconds < 3.0
    assert good.peak_memory < 100 << 20
    assert found["eats-memory"].peak_memory > 100 << 20
    assert (summary.total, summary.computed, summary.skipped, summary.failed) == (7, 7, 0, 6)
    alone = tmp_path / "alone"
    run_campaign([scenario()], [requests[3]], [7], alone, workers=1)
    assert rows(alone) == [row(good)]


def test_one_worker_and_two_give_the_same_and_a_second_start_does_nothing(tmp_path: Path) -> None:
    requests = [estimator(tmp_path), EstimatorRequest(str(tmp_path / "last_fix.py"), {"gain": 0.5}, "half")]
    scenarios = [scenario(), scenario("tiny-two", heading_deg="90.0")]
    told: list[Progress] = []
    for workers in (1, 2):
        run_campaign(scenarios, requests, range(3), tmp_path / str(workers), workers=workers, progress=told.append)
    assert rows(tmp_path / "1") == rows(tmp_path / "2")
    assert len(rows(tmp_path / "1")) == 12
    runs = [p for p in told if p.stage == "run"][-7:]
    assert [p.done for p in runs] == [0, 2, 4, 6, 8, 10, 12]
    assert runs[-1].left == 0.0
    assert all(p.left is not None and p.left > 0.0 for p in runs[1:-1])
    again = run_campaign(scenarios, requests, range(3), tmp_path / "1", progress=told.append)
    assert (again.skipped, again.computed) == (12, 0)
    assert told[-1].done == told[-1].total == 12
    more = run_campaign(scenarios, requests, range(4), tmp_path / "1", workers=1)
    assert (more.skipped, more.computed) == (12, 4)
    found = store.load(tmp_path / "1")
    assert {r.provenance.benchmark for r in found} == {BENCHMARK}
    assert len({(r.estimator_digest, r.estimator) for r in found}) == len(requests)
    assert {r.scenario_digest for r in found} == {s.content_hash() for s in scenarios}


RUN = """
import sys
from pathlib import Path
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.scenario import load

def main(folder, results, seeds):
    here = Path(folder)
    requests = [EstimatorRequest(str(here / f"{n}.py"), label=n) for n in ("last_fix", "raises")]
    run_campaign([load(here / "tiny.toml")], requests, range(int(seeds)), results, workers=2)

main(*sys.argv[1:])
"""


PAUSE = """
import os, signal
from joblib.externals.loky.process_executor import ProcessPoolExecutor

start_workers = ProcessPoolExecutor._adjust_process_count

def start_workers_and_stop(executor):
    start_workers(executor)
    os.kill(os.getpid(), signal.SIGSTOP)

ProcessPoolExecutor._adjust_process_count = start_workers_and_stop
"""


def start(folder: Path, results: Path, seeds: int, before: str = "") -> subprocess.Popen[bytes]:
    (folder / "run.py").write_text(before + RUN)
    (folder / "tiny.toml").write_text(SHIP)
    return subprocess.Popen(
        [sys.executable, str(folder / "run.py"), str(folder), str(results), str(seeds)],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=_interruptible,
    )


def _interruptible() -> None:
    """Whoever started the tests in the background may have had them ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def results_in(folder: Path) -> int:
    return len(list((folder / "results").glob("*.parquet"))) + 1000 * len(list((folder / "compacted").glob("*")))


def wait_until(condition: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + 200.0
    while process.poll() is None and not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_killed_at_any_moment_it_ends_with_the_same_table(tmp_path: Path) -> None:
    """SIGKILL to all its processes at random moments: while it starts, between results, while it compacts."""
    estimator(tmp_path)
    estimator(tmp_path, "raises", "import time; time.sleep(0.002); assert measurements.time < 15.0")
    undisturbed, disturbed = tmp_path / "undisturbed", tmp_path / "disturbed"
    requests = [EstimatorRequest(str(tmp_path / f"{n}.py"), label=n) for n in ("last_fix", "raises")]
    run_campaign([scenario()], requests, range(8), undisturbed, workers=1)
    chance = random.Random(20)
    for kill in range(2):  # the audit kills a hundred times
        process = start(tmp_path, disturbed, 8)
        if kill > 0:  # the first wherever it is in its start
            there = results_in(disturbed)
            wait_until(lambda there=there: results_in(disturbed) > there, process)  # type: ignore[misc]
        time.sleep(chance.uniform(0.0, 0.1 if kill else 1.5))
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait(60)
    run_campaign([scenario()], requests, range(8), disturbed, workers=1)
    assert len(rows(undisturbed)) == 16
    assert rows(disturbed) == rows(undisturbed)
    assert not list((disturbed / "results").glob("*.parquet"))


def _descendants(process: int) -> set[int]:
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
    found, more = set[int](), {process}
    while more:
        more = {child for child, parent in parents.items() if parent in more}
        found |= more
    return found


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="processes are listed in /proc")
@pytest.mark.parametrize("moment", ["before a run is sent", "while workers load", "while estimators run"])
def test_soon_after_the_death_of_a_campaign_nobody_is_left(tmp_path: Path, moment: str) -> None:
    estimator(tmp_path)
    estimator(tmp_path, "raises", "import time; time.sleep(1.0)")
    process = start(tmp_path, tmp_path / "out", 12, PAUSE if moment == "before a run is sent" else "")
    if moment == "before a run is sent":
        wait_until(lambda: Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] == "T", process)
    elif moment == "while workers load":
        wait_until(lambda: len(_descendants(process.pid)) >= 4, process)  # two workers, and what joblib starts
    else:
        wait_until(lambda: results_in(tmp_path / "out") >= 1, process)
        time.sleep(0.5)
    left = _descendants(process.pid)
    assert len(left) >= 4  # two workers, their servers, the estimators
    process.kill()
    process.wait()
    deadline = time.monotonic() + 100.0
    while left and time.monotonic() < deadline:
        time.sleep(0.2)
        left = {child for child in left if Path(f"/proc/{child}").exists()}
    assert not left
    # Estimators that lost their server have not failed: nothing is stored of them.
    assert all(r.status == "ok" for r in store.load(tmp_path / "out"))


def test_an_interrupt_of_the_user_ends_it_at_once_and_keeps_all(tmp_path: Path) -> None:
    """Ctrl-C goes to every process of the terminal; an estimator that ignores it is not waited for."""
    estimator(tmp_path)
    hang = tmp_path / "hang"
    deaf = "import pathlib, signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    deaf += f"time.sleep(1000.0 if pathlib.Path({str(hang)!r}).exists() else 0.03)"
    estimator(tmp_path, "raises", deaf)
    out = tmp_path / "out"
    process = start(tmp_path, out, 6)
    wait_until(lambda: results_in(out) >= 2, process)
    assert process.poll() is None
    hang.touch()
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(200) != 0
    hang.unlink()
    kept = rows(out)
    assert 2 <= len(kept) < 12
    assert {status for _, _, _, status, *_ in kept} == {"ok"}  # nobody ran into the limit of time
    requests = [EstimatorRequest(str(tmp_path / f"{n}.py"), label=n) for n in ("last_fix", "raises")]
    run_campaign([scenario()], requests, range(6), out, workers=1)
    assert len(rows(out)) == 12


def test_a_folder_of_the_users_own_does_not_hide_ours(tmp_path: Path) -> None:
    """Started where estimators/, scenarios/, simnav/ and a module random.py lie about; the estimator has a helper."""
    for name in ("estimators", "scenarios", "simnav", "leaderboard", "joblib"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("raise ImportError('the wrong one')")
    (tmp_path / "random.py").write_text("raise ImportError('the wrong one')")
    (tmp_path / "helper.py").write_text("GAIN = 1.0")
    estimator(tmp_path, imports="import helper")
    estimator(tmp_path, "raises", "raise RuntimeError")
    scripts = tmp_path / "scripts"
    scripts.mkdir()
    (scripts / "run.py").write_text(RUN)
    (tmp_path / "tiny.toml").write_text(SHIP)
    done = subprocess.run(
        [sys.executable, str(scripts / "run.py"), ".", "out", "2"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert [r.status for r in store.load(tmp_path / "out")] == ["ok", "ok", "error", "error"]


def test_a_run_that_cannot_be_recorded_is_a_status_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SIMNAV_DATA", str(tmp_path))
    recorded = load("ship-nbp1406")
    request, out = estimator(tmp_path), tmp_path / "out"
    summary = run_campaign([recorded, scenario()], [request], [0], out, workers=1)
    found = {r.scenario: r for r in store.load(out)}
    assert found["tiny-ship-v1"].status == "ok"
    assert found[recorded.id].status == "no-recording"
    assert "SIMNAV_DATA" in found[recorded.id].reason
    assert summary.statuses == {"no-recording": 1, "ok": 1}
    again = run_campaign([recorded, scenario()], [request], [0], out, workers=1)
    assert (again.skipped, dict(again.statuses)) == (1, {"no-recording": 1})
    assert len(store.load(out)) == 2


def test_an_edit_is_noticed(tmp_path: Path) -> None:
    """Of an estimator's file, of a module beside it, of its parameters, of the scenario; not of other files."""
    out = tmp_path / "out"
    (tmp_path / "helper.py").write_text("GAIN = 1.0")
    edited, other = estimator(tmp_path, imports="import helper"), estimator(tmp_path, "other")
    calm = scenario()

    def computed(s: Scenario, *requests: EstimatorRequest) -> int:
        count = run_campaign([s], requests, [0], out, workers=1).computed
        assert [r.estimator for r in store.load(out)] == [r.label for r in requests]  # the current, each once
        return count

    assert computed(calm, edited, other) == 2
    (tmp_path / "notes.py").write_text("1")
    assert computed(calm, edited, other) == 0
    (tmp_path / "helper.py").write_text("GAIN = 2.0")
    assert computed(calm, edited, other) == 1
    estimator(tmp_path, mischief="self.gain = 0.1", imports="import helper")
    assert computed(calm, edited, other) == 1
    assert computed(calm, EstimatorRequest(edited.name, {"gain": "0.5"}, "last-fix"), other) == 1
    assert computed(scenario(speed_m_s="6.0"), edited, other) == 2
    assert computed(calm, edited, other) == 0  # all of it is still there


SLOW = """if measurements.time == 1.0:
            import pathlib, time
            time.sleep(float(pathlib.Path({path!r}).read_text()))"""


def test_a_stored_timeout_is_run_again_under_a_longer_limit(tmp_path: Path) -> None:
    sleep, out = tmp_path / "seconds.txt", tmp_path / "out"
    sleep.write_text("1.5")
    request, other = estimator(tmp_path, mischief=SLOW.format(path=str(sleep))), estimator(tmp_path, "other")

    def run(timeout: float, *, retry: bool = False) -> tuple[int, str, float]:
        summary = run_campaign([scenario()], [request, other], [0], out, workers=1, time_limit=timeout, retry=retry)
        found = {r.estimator: r for r in store.load(out)}
        assert found["other"].status == "ok"
        return summary.computed, found["last-fix"].status, found["last-fix"].time_limit

    assert run(0.8) == (2, "timeout", 0.8)
    assert run(0.8) == (0, "timeout", 0.8)
    assert run(0.5) == (0, "timeout", 0.8)  # a shorter limit would give no more
    assert run(1.0) == (1, "timeout", 1.0)
    assert run(1.0, retry=True) == (1, "timeout", 1.0)
    assert run(30.0) == (1, "ok", 30.0)
    assert run(60.0, retry=True) == (0, "ok", 30.0)


def test_failures_are_run_again_when_asked(tmp_path: Path) -> None:
    raises = "if __import__('pathlib').Path({!r}).exists(): raise RuntimeError('lost')"
    flag, out = tmp_path / "flag", tmp_path / "out"
    flag.touch()
    request = estimator(tmp_path, mischief=raises.format(str(flag)))

    def run(*, retry: bool) -> tuple[int, str]:
        summary = run_campaign([scenario()], [request], [0], out, workers=1, retry=retry)
        (found,) = store.load(out)
        return summary.computed, found.status

    assert run(retry=False) == (1, "error")
    flag.unlink()
    assert run(retry=False) == (0, "error")
    assert run(retry=True) == (1, "ok")
    assert run(retry=True) == (0, "ok")


def test_an_estimator_is_run_anew_when_asked_or_when_others_computed_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "results"
    requests = [estimator(tmp_path, "mine"), EstimatorRequest("gnss-only"), EstimatorRequest("kf")]

    def computed(**options: Any) -> int:
        return run_campaign([scenario()], requests, [0], out, workers=1, **options).computed

    assert computed() == 3
    assert computed() == 0
    assert computed(force=["mine"]) == 1
    assert computed(force=["kf", "gnss-only"]) == 2
    with monkeypatch.context() as patch:
        others = ("9.9", *numerics()[1:])
        patch.setattr(campaign, "numerics", lambda p=None, *, processor=True: others if p is None else numerics(p))
        assert computed() == 3  # of another version of NumPy
    machine = (*numerics()[:-1], "x86_64 other")
    with monkeypatch.context() as patch:
        patch.setattr(campaign, "numerics", lambda p=None, *, processor=True: machine if p is None else numerics(p))
        assert computed() == 3
    assert numerics(processor=False) == numerics()[:-1]
    with pytest.raises(RequestError, match="force = 'ekff': no such estimator is run here; did you mean 'ekf'"):
        campaign.require_known(["ekff"], [[EstimatorRequest("ekf")]])


def test_the_version_that_an_estimator_declares_is_in_its_results(tmp_path: Path) -> None:
    out = tmp_path / "results"
    mine = estimator(tmp_path, "mine")
    path = Path(mine.name)
    path.write_text(path.read_text().replace("class Mine(Estimator):\n", "class Mine(Estimator):\n    version = 3\n"))
    run_campaign([scenario()], [mine, EstimatorRequest("gnss-only")], [0], out, workers=1)
    assert {r.estimator: (r.estimator_version, r.simulator_version) for r in store.load(out)} == {
        "mine": (3, SIMULATOR_VERSION), "gnss-only": (1, SIMULATOR_VERSION),
    }  # fmt: skip


def test_out_of_memory_is_run_again_under_a_larger_limit(tmp_path: Path) -> None:
    request, out = estimator(tmp_path, mischief="self.eaten = bytearray(100 << 20)"), tmp_path / "out"

    def run(mebibytes: int) -> tuple[int, str, int]:
        summary = run_campaign([scenario()], [request], [0], out, workers=1, memory_limit=mebibytes)
        (found,) = store.load(out)
        return summary.computed, found.status, found.memory_limit >> 20

    assert run(64) == (1, "out-of-memory", 64)
    assert run(64) == (0, "out-of-memory", 64)
    assert run(512) == (1, "ok", 512)


def test_damaged_results_are_computed_again(tmp_path: Path) -> None:
    request, out = estimator(tmp_path), tmp_path / "out"
    run_campaign([scenario()], [request], [0], out, workers=1)
    wanted = rows(out)
    part = next((out / "compacted").iterdir())
    part.write_bytes(part.read_bytes()[:-100])
    with pytest.warns(store.StoreWarning, match=part.name):
        assert run_campaign([scenario()], [request], [0], out, workers=1).computed == 1
    assert rows(out) == wanted


def test_a_full_disk_ends_it_with_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    request, out = estimator(tmp_path), tmp_path / "out"
    run_campaign([scenario()], [request], [0], out, workers=1)
    original, count = os.fsync, [0]

    def fsync(descriptor: int) -> None:
        count[0] += 1
        if count[0] > 2:  # a file and its folder: one more result
            raise OSError(28, "No space left on device")
        original(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fsync)
        with pytest.raises(StoreError, match="the disk is full"):
            run_campaign([scenario()], [request], range(4), out, workers=1)
    assert [r.seed for r in store.load(out)] == [0, 1]
    assert not list(out.rglob("*.tmp"))
    run_campaign([scenario()], [request], range(4), out, workers=1)
    assert [r.seed for r in store.load(out)] == [0, 1, 2, 3]


def test_an_error_in_a_worker_reaches_the_user(tmp_path: Path) -> None:
    """The store's sentence crosses from the worker's process: here the folder is in the way of a file."""
    request, out = estimator(tmp_path), store.create(tmp_path / "out")
    (out / "results").chmod(0o500)
    if os.access(out / "results", os.W_OK):  # root may write anywhere
        (out / "results").rmdir()
        (out / "results").symlink_to("/proc")
    with pytest.raises(StoreError, match="cannot be written"):
        run_campaign([scenario()], [request], [0, 1], out, workers=2)


def test_a_worker_that_dies_is_replaced_but_not_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when the system kills it for want of memory; here an estimator does it, which nothing keeps from it."""
    monkeypatch.setattr(campaign, "RESTARTS", 1)
    monkeypatch.setenv("SIMNAV_CONFINEMENT", "none")
    killer = "import os, signal; os.kill(os.getppid(), signal.SIGKILL)"
    note = f"import pathlib; p = pathlib.Path({str(tmp_path / 'was-here')!r})"
    once = f"{note}\n        if not p.exists(): p.touch(); {killer}"
    requests = [estimator(tmp_path), estimator(tmp_path, "once", once), estimator(tmp_path, "always", killer)]
    out = tmp_path / "out"
    with pytest.raises(CampaignError, match="worker processes died 2 times"):
        run_campaign([scenario()], requests, [0], out, workers=2)
    assert [(r.estimator, r.status) for r in store.load(out)] == [("last-fix", "ok"), ("once", "ok")]


def test_requests_that_make_no_sense(tmp_path: Path) -> None:
    good, out, s = estimator(tmp_path), tmp_path / "out", scenario()
    broken = tmp_path / "broken.py"
    broken.write_text("def f(:\n")
    hangs = tmp_path / "hangs.py"
    hangs.write_text("import os; os._exit(3)")
    cases: list[tuple[dict[str, Any], str]] = [
        ({"estimators": []}, "no estimator was asked for"),
        ({"estimators": [good, good]}, "'last-fix' was asked for twice; give each its own label"),
        ({"estimators": [EstimatorRequest("extended-kalman-filterr")]}, "unknown estimator 'extended-kalman-filterr'"),
        ({"estimators": [EstimatorRequest(good.name, {"gian": "1"})]}, "^estimator 'last-fix' .*you mean 'gain'"),
        ({"estimators": [EstimatorRequest(str(tmp_path / "absent.py"))]}, "absent.py"),
        ({"estimators": [EstimatorRequest(str(broken))]}, "broken.py, line 1"),
        ({"estimators": [EstimatorRequest(str(hangs))]}, r"hangs.py.*died \(exit code 3\)"),
        ({"scenarios": []}, "no scenario was asked for"),
        ({"scenarios": [s, s]}, "'tiny-ship-v1' was asked for twice"),
        ({"seeds": [-1]}, "seed -1"),
        ({"workers": 0}, "workers = 0"),
        ({"time_limit": 0.0}, "time_limit = 0 s"),
        ({"memory_limit": 0.001}, "memory_limit = 0.001: a finite number from 16 up"),
        ({"backend": "slurm"}, "backend = 'slurm' is unknown"),
    ]
    for change, message in cases:
        arguments = {"scenarios": [s], "estimators": [good], "seeds": [0], **change}
        with pytest.raises(RequestError, match=message) as caught:
            run_campaign(folder=out, **arguments)
        assert "\n" not in str(caught.value)
        assert not list(out.glob("results/*"))
    (out / "simnav-results.json").write_text('{"format": 7}')
    with pytest.raises(StoreError, match="format 7"):
        run_campaign([s], [good], [0], out)


def test_labels_say_what_was_asked_for() -> None:
    assert EstimatorRequest("ekf").label == "ekf"
    assert EstimatorRequest("ekf", {"gate": 3.0}).label == "ekf(gate=3.0)"
    assert EstimatorRequest("/a/b/my_filter.py").label == "my_filter"
    assert EstimatorRequest("b/my.py:Mine", {"a": 1, "b": 2}).label == "my:Mine(a=1,b=2)"


def test_the_time_limit_grows_with_the_run() -> None:
    assert campaign.time_limit(scenario()) == 60.0
    assert campaign.time_limit(scenario(duration_s="6000.0")) == 1200.0


def test_shards_are_the_campaign_in_parts(tmp_path: Path) -> None:
    requests, scenarios = [estimator(tmp_path)], [scenario(), scenario("tiny-two", heading_deg="90.0")]
    parts = [tmp_path / f"part-{k}" for k in (1, 2, 3)]
    totals = []
    for k, folder in enumerate(parts, 1):
        totals.append(run_campaign(scenarios, requests, range(4), folder, workers=1, shard=(k, 3)).total)
        assert len({r.scenario for r in store.load(folder)}) == 2  # a part is no scenario of its own
    assert sum(totals) == 8
    run_campaign(scenarios, requests, range(4), tmp_path / "whole", workers=1)
    assert rows(gather(tmp_path / "merged", parts)) == rows(tmp_path / "whole")
    with pytest.raises(RequestError, match=r"shard = 4/3"):
        run_campaign(scenarios, requests, range(4), tmp_path / "x", shard=(4, 3))
