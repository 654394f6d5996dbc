"""An estimator in a process of its own: the same bits as here, and nothing to be learned there."""

from __future__ import annotations

import json
import os
import platform
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.compiled import cache_directory, kernels
from simnav.estimator import make
from simnav.leaderboard.campaign.confinement import attempt as attempt_module
from simnav.leaderboard.campaign.confinement import bubblewrap, landlock, seccomp
from simnav.leaderboard.campaign.confinement.attempt import (
    Attempt,
    attempt,
    chosen_confinement,
    close_server,
    prepare,
    seed_words,
)
from simnav.leaderboard.campaign.confinement.limits import resident
from simnav.leaderboard.campaign.confinement.server import _load_kernels as load_kernels
from simnav.leaderboard.campaign.confinement.session import EstimatorServer, Limits, NoAnswerError
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.sources import kernel_modules
from simnav.recording import Recording
from simnav.scenario import load
from simnav.source import record
from simnav.trial import Trial, run_trial
from simnav.warmup import warmup

pytestmark = pytest.mark.skipif(os.name != "posix", reason="estimators are confined on POSIX systems only")

HEAD = """
import os, sys, json, random, time
import numpy as np
from simnav import Estimate, Estimator, NavigationStates, UnsuitableScenario

def attempted(what):
    try:
        what()
    except OSError:
        return True
    return False

class Mine(Estimator):
    def reset(self, start, instruments):
        self.position, self.k = start.position, 0
        {reset}

    def update(self, measurements):
        self.k += 1
        diagnostics, flagged = {{}}, []
        {update}
        return Estimate(measurements.time, position=self.position, diagnostics=diagnostics, flagged=flagged)
"""


@pytest.fixture(autouse=True)
def _registry(clean_registry: None) -> None:
    """Each test has a class ``Mine`` in a file ``mine.py`` of its own."""


@pytest.fixture(scope="module")
def server() -> Iterator[EstimatorServer]:
    warmup(load=False)
    made = EstimatorServer("process")
    made.wait_until_ready()
    yield made
    made.close()


@pytest.fixture(scope="module")
def recording() -> Recording:
    return record(load("harbour-multipath").model_copy(update={"duration": 60.0}), 5)


def entrant(name: str, **parameters: Any) -> Entrant:
    return Entrant(name, parameters, name, False, "")


#: One that loads the few kernels that it calls by itself.
QUICK = replace(entrant("gnss-only"), kernels=())


def same(a: Trial, b: Trial) -> None:
    """All but wall times, bit for bit."""
    assert (a.estimator, a.status, a.reason, a.flagged) == (b.estimator, b.status, b.reason, b.flagged)
    assert list(a.diagnostics) == list(b.diagnostics)
    pairs: list[tuple[Any, Any]] = [(getattr(a, n), getattr(b, n)) for n in ("time", "position", "velocity", "attitude",
                                                                            "estimated", "covariance")]  # fmt: skip
    pairs += [(a.diagnostics[n], b.diagnostics[n]) for n in a.diagnostics]
    pairs += [(getattr(a.smoothed, n, None), getattr(b.smoothed, n, None)) for n in ("time", "position", "attitude")]
    for x, y in pairs:
        assert (x is None) == (y is None)
        if x is not None:
            assert x.shape == y.shape
            assert x.tobytes() == y.tobytes()


@pytest.mark.parametrize("name", ["ekf", "ekf-rts", "ship-ekf", "gnss-only", "iae", "sw-fgo", "gtsam-batch"])
def test_both_ways_give_the_same_bits(name: str, server: EstimatorServer, recording: Recording) -> None:
    there = attempt(server, entrant(name), recording, Limits(60.0, 1 << 30))
    assert there.trial is not None
    assert there.status == "ok"
    same(there.trial, run_trial(make(name), recording))


NEXT = "\n    def nothing(self, measurements):\n        diagnostics, flagged = {}, []"

CASES = {
    "varying": ("", "diagnostics = {'a': np.arange(self.k % 3 + 1.0), 'n': self.k, 'b': True}"),
    "names come and go": ("", "diagnostics = {str(self.k % 4): np.eye(2), 'x': 1.5} if self.k % 3 else {}"),
    "flags": ("", "flagged = [('gnss', measurements.time), ('n\\u00e4me \\udc80', float('nan'))]"),
    "raises": ("", "if self.k == 7: raise KeyError('lost\\nin a line')"),
    "leaves": ("", "if self.k == 7: sys.exit(3)"),
    "wants memory": ("", "if self.k == 7: raise MemoryError"),
    "refuses at once": ("raise UnsuitableScenario('no sonar')", ""),
    "refuses": ("", "raise UnsuitableScenario('no sonar')"),
    "raises in reset": ("[][1]", ""),
    "needs a DVL": ("", f"pass\n    needs = ('imu', ('dvl', 'terrain_fix')){NEXT}"),
    "odd needs": ("", f"pass\n    needs = 'imu'{NEXT}"),
    "uses no fix": ("", f"pass\n    def observes(self, instruments):\n        return []{NEXT}"),
    "uses nothing that is there": ("", f"pass\n    def observes(self, instruments):\n        return ['sonar']{NEXT}"),
    "odd names": ("", f"pass\n    def observes(self, instruments):\n        return len(instruments){NEXT}"),
    "fails to say": ("", f"pass\n    def observes(self, instruments):\n        return instruments['sonar']{NEXT}"),
    "wrong type": ("", "if self.k == 7: return 3"),
    "wrong shape": ("", "if self.k == 7: self.position = np.zeros(4)"),
    "wrong time": ("", "if self.k == 7: return Estimate(0.0, position=self.position)"),
    "not finite": ("", "if self.k == 7: self.position = self.position * np.nan"),
    "far away": ("", "if self.k == 7: self.position = self.position + 0.1"),
    "wrong covariance": ("", "if self.k > 5: return Estimate(measurements.time, position=self.position, "
                             "covariance=-np.eye(9))"),
    "partly": ("", "return Estimate(measurements.time, position=self.position, "
                   "estimated=np.arange(9) < 2, covariance=np.full((9, 9), np.nan) * (self.k > 20) + np.eye(9))"),
    "dimensions": ("", "diagnostics = {'a': np.zeros((1,) * self.k)} if self.k < 3 else {}"),
    "no diagnostics": ("", "diagnostics = [] if self.k == 7 else {}"),
    "a complex one": ("", "diagnostics = {'c': 1j}"),
    "bad, then dead": ("", "if self.k == 9: os._exit(3)\n        if self.k == 7: return 3"),
    "late, then dead": ("", "if self.k == 9: os._exit(3)\n        "
                            "if self.k == 7: return Estimate(0.0, position=self.position)"),
    "far away, then silent": ("", "time.sleep(600.0 * (self.k == 9))\n        "
                                  "if self.k == 7: self.position = self.position + 0.1"),
    "not finite, then raises": ("", "self.position = self.position * np.nan if self.k == 7 else [][self.k == 9]"),
    "slow": ("", "time.sleep(0.06 * (self.k % 20 == 0)); flagged = [('gnss', 1.0)] * (self.k == 30)"),
    "large": ("", "diagnostics = {'x': np.arange(self.k % 30 * 1000.0)}"),
    "writes its input": ("", "measurements.imu.specific_force[:] = 0.0; measurements.aids.clear()"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_both_ways_judge_alike(case: str, server: EstimatorServer, recording: Recording, tmp_path: Path) -> None:
    reset, update = CASES[case]
    file = tmp_path / "mine.py"
    file.write_text(HEAD.format(reset=reset, update=update))
    there = attempt(server, entrant(str(file)), recording, Limits(60.0, 1 << 30))
    assert there.trial is not None, there.reason
    same(there.trial, run_trial(make(str(file)), recording))


SMOOTHS = {
    "whole": "return NavigationStates(np.arange(1.0, self.k + 1), *(np.ones((self.k, 3)) for _ in range(3)))",
    "short": "return NavigationStates(np.arange(1.0, self.k), *(np.ones((self.k - 1, 3)) for _ in range(3)))",
    "no states": "return [1.0]",
    "raises": "raise ValueError('no way back')",
}


@pytest.mark.parametrize("case", SMOOTHS)
def test_smoothed_trajectories_cross_too(
    case: str, server: EstimatorServer, recording: Recording, tmp_path: Path
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(HEAD.format(reset="", update="") + f"\n    def smooth(self):\n        {SMOOTHS[case]}\n")
    there = attempt(server, entrant(str(file)), recording, Limits(60.0, 1 << 30))
    assert there.trial is not None
    same(there.trial, run_trial(make(str(file)), recording))


def test_an_estimator_of_others_gets_one_step_at_a_time(
    server: EstimatorServer, recording: Recording, tmp_path: Path
) -> None:
    """It could look ahead in the others, wherever its arrays come from; our rows get many steps in one packet."""
    file = tmp_path / "mine.py"
    ahead = "\n    def update_all(self, steps):\n        raise ValueError(f'{len(steps)} steps')\n"
    size = "a = measurements.imu.time; diagnostics = {'size': float((a if a.base is None else a.base).size)}"
    file.write_text(HEAD.format(reset="", update=size) + ahead)
    there = attempt(server, entrant(str(file)), recording, Limits(60.0, 1 << 30))
    assert there.trial is not None
    assert there.status == "ok", there.reason
    assert there.trial.diagnostics["size"].max() < 2 * there.trial.diagnostics["size"].min()
    assert "60 steps" in run_trial(make(str(file)), recording).reason  # who runs it here trusts it
    assert entrant("ekf").ours
    assert not entrant(str(file)).ours
    assert not replace(entrant("ekf"), own="somebody's").ours


def test_an_estimator_has_the_linear_algebra_of_the_one_who_starts_it(
    recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """OpenBLAS has other code, and other last bits, for each type of processor."""
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Prescott")
    file = tmp_path / "mine.py"
    file.write_text(HEAD.format(reset="", update="diagnostics = {os.environ['OPENBLAS_CORETYPE']: 1.0}"))
    server = EstimatorServer("process", loaded=())
    try:
        there = attempt(server, replace(entrant(str(file)), kernels=()), recording, Limits(60.0, 1 << 30))
    finally:
        server.close()
    assert there.trial is not None, there.reason
    assert "Prescott" in there.trial.diagnostics


@pytest.fixture
def told(server: EstimatorServer, recording: Recording, tmp_path: Path) -> Callable[..., Any]:
    """What an estimator finds where it runs: the value of an expression, as JSON in the name of a diagnostic."""

    def tell(expression: str, limits: Limits | None = None) -> Any:
        file = tmp_path / "mine.py"
        file.write_text(HEAD.format(reset="", update=f"diagnostics = {{json.dumps({expression}, default=str): 1.0}}"))
        there = attempt(server, entrant(str(file)), recording, limits or Limits(60.0, 1 << 30))
        assert there.status == "ok", there.reason
        assert there.trial is not None
        return json.loads(next(iter(there.trial.diagnostics)))

    return tell


def test_it_inherits_nothing_secret(told: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert told("dict(os.environ)").keys().isdisjoint({"SIMNAV_DATA", "PYTEST_CURRENT_TEST", "OLDPWD", "PWD"})
    words = told("sys.orig_argv + sys.argv")
    assert "harbour" not in " ".join(words)
    assert "pytest" not in " ".join(words)
    assert told("os.getcwd()") == str(tmp_path)  # the folder of its own file
    opened = told("[os.readlink('/proc/self/fd/' + d) for d in os.listdir('/proc/self/fd') if os.path.exists("
                  "'/proc/self/fd/' + d)]")  # fmt: skip
    assert sorted({name.partition(":")[0] for name in opened}) == ["/dev/null", "pipe"]
    assert len([name for name in opened if name.startswith("pipe")]) == 2
    secret = "[type(o).__name__ for o in __import__('gc').get_objects() if type(o).__name__ in ('Recording', 'Unit')]"
    assert told(secret) == []


def test_global_generators_tell_nothing_and_are_the_same_everywhere(
    told: Callable[..., Any], recording: Recording
) -> None:
    drawn = told("[random.random(), float(np.random.rand())]")
    assert told("[random.random(), float(np.random.rand())]") == drawn
    assert np.random.RandomState(recording.seed).rand() not in drawn
    words = seed_words(recording, entrant("a"))
    other = record(load("harbour-multipath").model_copy(update={"duration": 60.0}), 6)
    assert len({tuple(words), tuple(seed_words(recording, entrant("b"))), tuple(seed_words(other, entrant("a")))}) == 3


def ended(server: EstimatorServer, recording: Recording, tmp_path: Path, update: str, **limits: Any) -> Attempt:
    file = tmp_path / "mine.py"
    file.write_text(HEAD.format(reset="", update=update))
    return attempt(server, entrant(str(file)), recording, Limits(**{"timeout": 60.0, "memory": 1 << 30, **limits}))


def test_how_a_process_ended_is_told(server: EstimatorServer, recording: Recording, tmp_path: Path) -> None:
    def end(update: str, **limits: Any) -> tuple[str, str]:
        there = ended(server, recording, tmp_path, update, **limits)
        return there.status, there.reason

    assert end("os.kill(os.getpid(), 9)") == ("error", "the process died (SIGKILL) without an answer")
    assert end("os._exit(3)") == ("error", "the process died (exit code 3) without an answer")
    assert end("time.sleep(9.0)", timeout=0.5) == ("timeout", "stopped after 0.5 s")
    status, reason = end("self.eaten = np.ones(40 << 20)", memory=100 << 20)
    assert status == "out-of-memory"
    assert reason
    assert end("") == ("ok", "")  # and the server is as before


def test_kernels_are_loaded_when_the_first_one_may_call_them(recording: Recording) -> None:
    close_server()
    try:
        server = prepare("process", (), loaded=())
        server.wait_until_ready()
        before = resident(server.process_id)
        assert prepare("process", (), loaded=("simnav",)) is server
        server.wait_until_ready()
        assert resident(server.process_id) > 1.2 * before
        assert prepare("process", (), loaded=()) is server  # and it keeps them
        assert attempt(server, entrant("ekf"), recording, Limits(60.0, 1 << 30)).status == "ok"
    finally:
        close_server()


def test_a_server_loads_no_kernel_that_an_estimator_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a sandbox estimators run before the kernels are loaded, and have the folder of the kernels in common."""
    given = cache_directory()
    assert given is not None
    warmup(load=False)
    kernel = next(kernel for kernel in kernels() if kernel.cached())
    monkeypatch.setenv("SIMNAV_CACHE_DIR", str(tmp_path))
    target = cache_directory()
    assert target is not None
    assert tmp_path in target.parents
    ours = next(path for path in (given / kernel.fingerprint()).rglob("*.nbi"))
    planted = target / ours.relative_to(given)
    planted.parent.mkdir(parents=True)
    planted.write_bytes(b"a compiled function of a stranger")
    child = os.fork()  # its memory is settled for ever
    if child == 0:
        code = 1
        try:
            read = []
            monkeypatch.setattr(
                "simnav.compiled.Kernel.compile", lambda self: read.append(planted.read_bytes() == ours.read_bytes())
            )
            load_kernels(str(given), ["simnav"])
            code = 0 if read and all(read) and not target.exists() else 2
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_a_server_that_is_gone_before_its_kernels_are_loaded_is_no_failure_of_an_estimator() -> None:
    server = EstimatorServer("process", loaded=())
    server.wait_until_ready()
    os.kill(server.process_id, signal.SIGKILL)
    server.load(["simnav"])
    with pytest.raises(NoAnswerError, match="did not answer"):
        server.wait_until_ready()
    server.close()


@pytest.mark.parametrize(
    ("text", "modules"),
    [
        ("import os, tempfile\nimport numpy as np\nfrom simnav import Estimate, Estimator", []),
        ("from simnav.types import Instruments\nfrom scipy.linalg import expm", []),
        ("from beside import nothing", []),
        ("from beside_too import row", ["simnav.estimators"]),
        ("import simnav", ["simnav"]),
        ("from simnav import Estimator, make", ["simnav.make"]),
        ("from simnav.geometry.earth import displace", ["simnav.geometry.earth"]),
        ("def later():\n    import somebody_elses", ["simnav"]),
        ("import importlib\nimportlib.import_module('sim' + 'nav')", ["simnav"]),
    ],
)
def test_of_which_modules_an_estimator_may_call_kernels(text: str, modules: list[str], tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text("import json")
    (tmp_path / "beside_too.py").write_text("import simnav.estimators")
    (tmp_path / "mine.py").write_text(text)
    assert kernel_modules(str(tmp_path / "mine.py")) == modules


def test_who_is_in_no_file_may_call_all_kernels() -> None:
    assert kernel_modules("") == ["simnav"]


@pytest.mark.parametrize("losses", [1, 2])
def test_who_has_not_been_started_has_not_failed(
    recording: Recording, monkeypatch: pytest.MonkeyPatch, losses: int
) -> None:
    """A server that is lost between two estimators is replaced, once."""
    lost: list[EstimatorServer] = []

    def losing(*arguments: Any, **more: Any) -> EstimatorServer:
        server = prepare(*arguments, **more)
        server.wait_until_ready()
        if len(lost) < losses:
            lost.append(server)
            server.close()
        return server

    monkeypatch.setattr(attempt_module, "prepare", losing)
    close_server()
    try:
        if losses == 1:
            found = attempt_module.try_estimator(QUICK, recording, Limits(60.0, 1 << 30), "process")
            assert (found.status, found.reason) == ("ok", "")
        else:
            with pytest.raises(NoAnswerError, match="did not answer"):
                attempt_module.try_estimator(QUICK, recording, Limits(60.0, 1 << 30), "process")
    finally:
        close_server()
    assert len(lost) == losses


PROGRAM = """
import sys, time
taken = bytearray(60 << 20)
for k in range(0, len(taken), 4096): taken[k] = 1
for line in sys.stdin:
    if line.startswith("start"): place = ",".join(line.split(",")[3:6])
    if line.startswith("begin"): time.sleep(0.2), print("ready", flush=True)
    if line.startswith("step"): print("estimate", line[5:-1], place, ",,,,,", sep=",", flush=True)
"""


@pytest.mark.skipif(platform.system() != "Linux", reason="memory of other processes is seen on Linux only")
def test_a_program_is_confined_and_its_memory_counts(
    server: EstimatorServer, recording: Recording, tmp_path: Path
) -> None:
    """Its working folder is that of the file which names it; it is not there afterwards."""
    (tmp_path / "mine.txt").write_text(PROGRAM)
    (tmp_path / "mine.py").write_text(
        "from simnav.estimator.program import ProgramEstimator\n"
        f"class Mine(ProgramEstimator):\n    program = '{sys.executable} -S mine.txt'\n"
    )
    there = attempt(server, entrant(str(tmp_path / "mine.py")), recording, Limits(60.0, 1 << 30))
    assert (there.status, there.reason) == ("ok", "")
    assert 60 << 20 < there.peak_memory < 120 << 20
    assert not [p for p in Path("/proc").glob("[0-9]*/cmdline") if b"mine.txt" in p.read_bytes()]


def test_time_is_measured_outside(server: EstimatorServer, recording: Recording, tmp_path: Path) -> None:
    """What an estimator does to its own clocks does not matter."""
    update = "begun = time.monotonic()\n        while time.monotonic() < begun + 0.003: pass\n        "
    update += "time.perf_counter_ns = time.perf_counter = lambda: 0"
    there = ended(server, recording, tmp_path, update)
    assert there.trial is not None
    assert there.trial.update_seconds.min() > 0.003


def test_what_can_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SIMNAV_CONFINEMENT", raising=False)
    assert chosen_confinement("none") == "none"
    assert chosen_confinement() == ("process" if bubblewrap.available() else "bubblewrap")
    monkeypatch.setenv("SIMNAV_CONFINEMENT", "process")
    assert chosen_confinement() == "process"
    with pytest.raises(ValueError, match="confinement = 'prison' is unknown; there are auto, bubblewrap"):
        chosen_confinement("prison")


@pytest.mark.skipif(not landlock.available(), reason="this system has no Landlock")
def test_results_and_keys_cannot_be_read(
    told: Callable[..., Any], server: EstimatorServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A trial that is kept holds the truth of the run; so does whoever knows the key."""
    results, key, link = tmp_path / "results", tmp_path / "key", tmp_path / "link"
    (results / "trials").mkdir(parents=True)
    link.symlink_to(results)
    for file in (results / "trials" / "a.parquet", key, tmp_path / "mine.csv"):
        file.write_text("secret")
    monkeypatch.setattr(server, "hidden", (results, key))

    def readable(*names: str) -> list[bool]:
        text = "[os.system(f'cat {n} > /dev/null 2>&1') == 0"
        return list(told(f"{text} for n in {[str(tmp_path / n) for n in names]!r}]"))

    files = ("results/trials/a.parquet", "link/trials/a.parquet", "key", "mine.csv", "mine.py")
    assert readable(*files) == [False, False, False, True, True]
    (tmp_path / "later.csv").write_text("mine, too")
    assert readable("later.csv", "key") == [True, False]
    assert told("open('/proc/self/stat').read() != ''")
    monkeypatch.setattr(server, "hidden", ())
    assert readable("key") == [True]


@pytest.mark.skipif(not seccomp.available(), reason="the system calls are not known here")
def test_no_channel_leads_to_another_process(server: EstimatorServer, recording: Recording, tmp_path: Path) -> None:
    """A socket of the user's desktop would start programs outside; shared memory outlives an estimator."""
    update = f"""
        import ctypes, socket
        found = []
        for family, kind in ((1, 1), (2, 1), (2, 2)):  # to a path, TCP, UDP
            try:
                socket.socket(family, kind)
            except PermissionError:
                found.append("refused")
        for number in {[seccomp.DENIED[platform.machine()][n] for n in ("shmget", "semget", "msgget")]}:
            found.append(ctypes.CDLL(None).syscall(number, 0x5EC2E7, 1, 0o1600))
        a, b = socket.socketpair()
        a.send(b"x")
        diagnostics = {{json.dumps([*found, b.recv(1).decode(), os.system("true")]): 1.0}}"""
    there = ended(server, recording, tmp_path, update)
    assert there.trial is not None, there.reason
    assert json.loads(next(iter(there.trial.diagnostics))) == ["refused"] * 3 + [-1] * 3 + ["x", 0]


@pytest.mark.skipif(not landlock.available(), reason="this system has no Landlock")
def test_two_estimators_of_one_file_have_no_folder_in_common(
    server: EstimatorServer, recording: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that has seen the whole run could tell the other what will be measured."""
    file = tmp_path / "mine.py"
    file.write_text(HEAD.format(reset="", update="diagnostics = {os.environ['SIMNAV_CACHE_DIR']: 1.0}"))

    def folder(label: str) -> str:
        there = attempt(server, Entrant(str(file), {}, label, False, ""), recording, Limits(60.0, 1 << 30))
        assert there.trial is not None
        return next(iter(there.trial.diagnostics))

    assert folder("a") == folder("a") != folder("b")
    monkeypatch.setattr(server, "sealed", True)
    assert "simnav-estimator-" in folder("a")  # gone with the server


@pytest.mark.skipif(bool(bubblewrap.available()), reason=bubblewrap.available() or "it works")
def test_a_sandbox_hides_results_and_has_no_network(recording: Recording, tmp_path: Path) -> None:
    results, outside = tmp_path / "results", tmp_path / "outside"
    results.mkdir()
    outside.mkdir()
    (results / "secret").touch()
    server = EstimatorServer("bubblewrap", [results])
    try:
        update = f"""
        import socket
        def writes(folder):
            try:
                open(folder + '/x', 'w').close()
            except OSError:
                return False
            return True
        found = [os.listdir({str(results)!r}), writes({str(outside)!r}), writes(os.environ['TMPDIR']),
                 len(open('/proc/net/dev').readlines()) - 2,
                 sorted(int(p) for p in os.listdir('/proc') if p.isdigit())[0]]
        diagnostics = {{json.dumps(found): 1.0}}"""
        there = ended(server, recording, tmp_path, update)
        assert there.status == "ok", there.reason
        assert there.trial is not None
        assert there.confinement == "bubblewrap"
        listed, out, temporary, networks, first = json.loads(next(iter(there.trial.diagnostics)))
        assert (listed, out, temporary, networks, first) == ([], False, True, 1, 1)
        same(
            attempt(server, entrant("ekf"), recording, Limits(60.0, 1 << 30)).trial,  # type: ignore[arg-type]
            run_trial(make("ekf"), recording),
        )
    finally:
        server.close()


def test_a_server_whose_limits_were_changed_starts_nobody(recording: Recording) -> None:
    """Whoever can lower the limits of a server would have all later estimators fail."""
    resource = pytest.importorskip("resource")
    if not hasattr(resource, "prlimit"):
        pytest.skip("limits of another process cannot be changed here")
    server = EstimatorServer("process", loaded=())
    try:
        server.wait_until_ready()
        hard = resource.prlimit(server.process_id, resource.RLIMIT_NOFILE)[1]
        resource.prlimit(server.process_id, resource.RLIMIT_NOFILE, (40, hard))
        with pytest.raises(NoAnswerError):
            attempt(server, QUICK, recording, Limits(60.0, 1 << 30))
    finally:
        server.close()


@pytest.mark.parametrize("times", [1, 2])
def test_who_was_killed_from_outside_is_tried_once_more(
    recording: Recording, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    """Whoever kills a campaign may begin with an estimator's process; that is no failure of the estimator."""
    reason = "the process died (SIGKILL) without an answer"
    killed = Attempt("error", reason, None, 1.0, 0, "landlock")
    answers = [killed] * times + [Attempt("ok", "", None, 1.0, 0, "landlock")]
    monkeypatch.setattr(attempt_module, "prepare", lambda *_, **__: None)
    monkeypatch.setattr(attempt_module, "attempt", lambda *_: answers.pop(0))
    monkeypatch.setattr(attempt_module, "_SETTLE", 0.0)
    found = attempt_module.try_estimator(QUICK, recording, Limits(60.0, 1 << 30), "process")
    assert (found.status, found.reason) == (("ok", "") if times == 1 else ("error", reason))


def test_a_sealed_run_has_a_server_of_its_own(recording: Recording) -> None:
    """What one estimator changes of its server, the next one would see."""
    servers = set()
    close_server()
    for _ in range(2):
        made = attempt_module.try_estimator(QUICK, recording, Limits(60.0, 1 << 30), "process", sealed=True)
        assert made.status == "ok"
        assert attempt_module._server is None
        servers.add(prepare("process", (), loaded=(), sealed=True).process_id)
    close_server()
    assert len(servers) == 2


@pytest.mark.skipif(not seccomp.available(), reason="the system calls are not known here")
def test_no_attribute_of_a_file_or_of_another_process_is_changed(told: Callable[..., Any], tmp_path: Path) -> None:
    """By them two estimators could pass something on, and one could take a file or its memory from another."""
    letter = tmp_path / "letter"
    letter.write_text("x")
    calls = {
        "mode": f"os.chmod({str(letter)!r}, 0)",
        "mode by descriptor": f"os.fchmod(os.open({str(letter)!r}, 0), 0)",
        "owner": f"os.chown({str(letter)!r}, os.getuid(), -1)",
        "times": f"os.utime({str(letter)!r})",
        "attribute": f"os.setxattr({str(letter)!r}, 'user.a', b'1')",
        "flags": f"__import__('fcntl').ioctl(os.open({str(letter)!r}, 0), 0x40086602, bytes(8))",
        "hint": f"__import__('fcntl').fcntl(os.open({str(letter)!r}, 0), 1036, bytes(8))",
        "lock": f"__import__('fcntl').flock(os.open({str(letter)!r}, 0), 2)",
        "lock of bytes": f"__import__('fcntl').lockf(os.open({str(tmp_path / 'mine.py')!r}, 0), 1)",
        "limits": "__import__('resource').prlimit(os.getppid(), __import__('resource').RLIMIT_NOFILE, (40, 50))",
        "limits of its own": "__import__('resource').setrlimit(__import__('resource').RLIMIT_NOFILE, (40, 50))",
        "priority": "os.setpriority(os.PRIO_PROCESS, os.getppid(), 19)",
        "priority of a user": "os.setpriority(os.PRIO_USER, 0, 19)",
        "priority of its own": "os.nice(1)",
        "processors": "os.sched_setaffinity(os.getppid(), [0])",
        "scheduler": "os.sched_setscheduler(os.getppid(), os.SCHED_BATCH, os.sched_param(0))",
        "file in memory": "os.memfd_create('x')",
        "shared memory": "__import__('mmap').mmap(-1, 4096)",
        "private memory": "__import__('mmap').mmap(-1, 4096, __import__('mmap').MAP_PRIVATE) and None",
    }
    tried = ", ".join(f"[{n!r}, attempted(lambda: {c})]" for n, c in calls.items())
    found = dict(told(f"[{tried}]"))
    allowed = {name for name, refused in found.items() if not refused}
    assert allowed == {"limits of its own", "priority of its own", "private memory"}
    assert letter.stat().st_mode & 0o777 != 0


@pytest.mark.skipif(not landlock.available(), reason="this system has no Landlock")
def test_the_state_of_the_system_cannot_be_read(told: Callable[..., Any]) -> None:
    """What an earlier process has changed there would be told to a later one."""
    names = ["/proc/stat", "/proc/vmstat", "/proc/1/stat", "/proc/loadavg", "/sys/kernel/uevent_seqnum"]
    names += ["/proc/self/stat", "/proc/meminfo", "/proc/cpuinfo"]
    found = told(f"[attempted(lambda n=n: open(n).read()) for n in {names!r}]")
    assert found == [True] * 5 + [False] * 3
