"""Campaigns with estimators that cheat or do harm: what they gained, and whom they touched."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.confinement import bubblewrap, landlock
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.results import store
from simnav.leaderboard.results.result import Result
from simnav.scenario import load

__all__ = ["CHEATS", "VANDALS", "Harm", "cheats", "vandals"]

HERE = Path(__file__).parent
SCENARIO = HERE / "cheats" / "scenario.toml"

#: The files of the cheats: each gained a position error below a micrometre, or scores of its own making, while
#: estimators ran in forks of the worker.
CHEATS = sorted(path.stem for path in (HERE / "cheats").glob("*.py") if path.stem != "cheating_last_fix")

_VANDAL = '''
import json, mmap, os, resource, signal, subprocess, sys, tempfile, time
import numpy as np
from simnav import Estimate, Estimator

class Vandal(Estimator):
    """Does harm at the third step, and goes on with the last fix."""

    def __init__(self):
        {constructor}

    def reset(self, start, instruments):
        self.position, self.k = start.position, 0

    def update(self, measurements):
        fix = measurements.latest("gnss_position")
        self.position = self.position if fix is None else fix.value
        self.k += 1
        diagnostics = {{}}
        if self.k == 3:
            {mischief}
        return Estimate(measurements.time, position=self.position, diagnostics=diagnostics)
'''

_HELPERS = '''

def _open(descriptor):
    import fcntl
    try:
        return fcntl.fcntl(descriptor, fcntl.F_GETFL) & 3 != 0
    except OSError:
        return False


def _ancestors(campaign):
    """Processes between this one and the campaign's, where they can be seen: no others, for they would be harmed."""
    process = os.getppid()
    while process not in (0, 1, campaign):
        yield process
        try:
            process = int(open(f"/proc/{process}/stat").read().rpartition(")")[2].split()[1])
        except OSError:
            return


def _take(what, *arguments):
    """Do it where it is allowed."""
    try:
        what(*arguments)
    except OSError:
        pass


def _limit_all(campaign):
    for process in _ancestors(campaign):
        for which, value in (("NOFILE", 6), ("DATA", 1 << 20), ("CPU", 1), ("NPROC", 1), ("FSIZE", 10)):
            which = getattr(resource, "RLIMIT_" + which)
            _take(resource.prlimit, process, which, (value, resource.prlimit(0, which)[1]))
        _take(os.sched_setaffinity, process, {0})
        _take(os.setpriority, os.PRIO_PROCESS, process, 19)


def _close_all(folder):
    for path, folders, files in os.walk(folder):
        for name in files + folders:
            _take(os.chmod, os.path.join(path, name), 0)
    _take(os.chmod, folder, 0o555)


def _deep(names):
    """Folders so deep that removing them by recursion fails, and one that is closed to its owner."""
    os.chdir(tempfile.gettempdir())
    os.mkdir("closed", 0o300)
    open("closed/file", "w").close()
    for _ in range(names):
        os.mkdir("d")
        os.chdir("d")


def _fork_each(count, what):
    """Processes that take something, and wait."""
    for _ in range(count):
        if os.fork() == 0:
            kept = what()
            time.sleep(600)
    time.sleep(600)


def _steal():
    """Write a part of an answer into the pipe, and take it back before it is read."""
    up = os.open("/proc/self/fd/4", os.O_RDWR | os.O_NONBLOCK)
    while True:
        os.write(up, b"x")
        try:
            os.read(up, 1)
        except BlockingIOError:
            pass


class _Endless:
    def __repr__(self):
        return repr(self)
'''

_DELETE = "import shutil; shutil.rmtree({results!r})"
_SLEEPER = "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)  # {mark}'], start_new_session=True)"

#: What they do, and the statuses that may come of it. The results folder stands for ``{results}``.
VANDALS: dict[str, tuple[str, set[str]]] = {
    "honest": ("pass", {"ok"}),
    "deletes-results": (_DELETE, {"error"}),
    "kills-parent": ("os.kill(os.getppid(), signal.SIGKILL); time.sleep(1.0)", {"error"}),
    "kills-worker": (
        "os.kill(int(open(f'/proc/{{os.getppid()}}/stat').read().rpartition(')')[2].split()[1]), signal.SIGKILL)",
        {"error"}),
    "raises-in-constructor": ("pass", {"error"}),
    "leaves-grandchildren": (_SLEEPER, {"ok"}),
    "kills-itself": ("os.kill(os.getpid(), signal.SIGKILL)", {"error"}),
    "overflows-the-stack": ("sys.setrecursionlimit(10**9); repr(_Endless())", {"error", "out-of-memory"}),
    "writes-garbage": ("[os.write(d, b'garbage' * 1000) for d in range(3, 64) if _open(d)]", {"invalid-output"}),
    "answers-early": ("[os.write(d, b'\\1' + bytes(23)) for d in range(3, 64) if _open(d)]", {"invalid-output"}),
    "floods-stdout": ("[os.write(d, b'x' * 2**20) for d in (1, 2) for _ in range(50)]; print('x' * 10**7)", {"ok"}),
    "ignores-signals": ("[signal.signal(s, signal.SIG_IGN) for s in (2, 15)]; time.sleep(600)", {"timeout"}),
    "closes-everything": ("os.closerange(0, 4096)", {"error"}),
    "endless-diagnostics": ("diagnostics = {{'x': np.zeros(7 * 2**20)}}; self.k = 2", {"out-of-memory", "timeout"}),
    "giant-answer": ("diagnostics = {{'x': np.zeros(10 * 2**20)}}", {"invalid-output"}),
    "many-names": ("diagnostics = {{str(i): 0.0 for i in range(50000)}}", {"ok", "timeout"}),  # on a busy machine
    "limits-others": ("_limit_all({campaign})", {"ok"}),
    "takes-rights": ("_close_all({folder!r})", {"ok"}),
    "leaves-deep-folders": ("_deep(1500)", {"ok"}),
    "steals-its-answer": ("_steal()", {"timeout", "invalid-output", "error"}),
    "children-take-memory": ("_fork_each(4, lambda: np.ones(15 << 20))", {"out-of-memory", "timeout"}),
    "many-processes": ("_fork_each(700, int)", {"error", "timeout"}),
    "large-file": (
        "file = open(os.path.join(tempfile.gettempdir(), 'x'), 'wb'); [file.write(bytes(1 << 20)) for _ in range(400)]",
        {"error", "out-of-memory", "timeout"}),
    "many-files": (
        "files = [tempfile.TemporaryFile() for _ in range(4)]\n            "
        "[f.write(bytes(1 << 20)) for f in files for _ in range(120)]; time.sleep(600)", {"out-of-memory", "timeout"}),
    "memory-file": ("fd = os.memfd_create('x'); os.truncate(fd, 1 << 30); [os.write(fd, bytes(1 << 20)) for _ in "
                    "range(400)]", {"error"}),
    "shared-memory": ("self.m = mmap.mmap(-1, 400 << 20); [self.m.write(bytes(1 << 20)) for _ in range(400)]; "
                      "self.m.madvise(mmap.MADV_DONTNEED); time.sleep(600)", {"error"}),
    "ragged-diagnostics": (
        "diagnostics = {{'x': np.zeros((10**6, 1))}}\n        if self.k == 4:\n            "
        "diagnostics = {{'x': np.zeros((1, 10**6))}}", {"out-of-memory"}),
    "large-once": ("diagnostics = {{'x': np.zeros(2 * 10**6)}}", {"out-of-memory"}),
    "nothing-in-a-shape": ("diagnostics = {{'x': np.zeros((0, 3))}}", {"ok"}),
    "empty-but-large": ("diagnostics = {{'x': np.zeros((0, 2**40))}}", {"out-of-memory"}),
    "many-dimensions": ("diagnostics = {{'x': np.zeros((1,) * 32)}}", {"invalid-output"}),
    "a-name-twice": ("diagnostics = {{1: 0.0, '1': np.zeros(3)}}", {"invalid-output"}),
    "odd-names": ("diagnostics = {{'innovation.' + chr(0xd800): 1.0}}", {"ok"}),
    "odd-reason": ("raise ValueError(chr(0xd800) * 5000)", {"error"}),
    "odd-covariance": (
        "p = np.eye(9); p[0, 0] = 5e-324; p[0, 1] = p[1, 0] = 1e308\n            "
        "return Estimate(measurements.time, position=self.position, velocity=np.zeros(3), attitude=np.zeros(3), "
        "covariance=p)", {"invalid-output"}),
    "opens-a-socket": ("import socket; socket.create_connection(('127.0.0.1', 9), 2.0)", {"error"}),
}  # fmt: skip


#: Those that only a sandbox keeps from the processes and folders of the campaign's user.
#: Those that only answer badly: how they are confined plays no part.
ANSWERS = {
    "raises-in-constructor", "writes-garbage", "answers-early", "floods-stdout", "endless-diagnostics", "giant-answer",
    "many-names", "ragged-diagnostics", "large-once", "nothing-in-a-shape", "empty-but-large", "many-dimensions",
    "a-name-twice", "odd-names", "odd-reason", "odd-covariance",
}  # fmt: skip
_CONTAINED = {"deletes-results", "kills-worker", "opens-a-socket"}


def contained() -> bool:
    """Whether this system has Landlock with signals, or bubblewrap."""
    return landlock.signals_are_scoped() or not bubblewrap.available()


@dataclass(frozen=True)
class Harm:
    """What came of a campaign with vandals.

    Attributes
    ----------
    tried : int
        Rows that tried to do harm.
    unnamed : list of str
        Those that have no result, or one with another status than they earned.
    touched : list of str
        Rows whose results are not as in a campaign without vandals, and what is left of them all.
    """

    tried: int
    unnamed: list[str]
    touched: list[str]


def plain(result: Result) -> tuple[Any, ...]:
    """A result without what no two runs share."""
    scores = {name: value for name, value in result.scores.items() if not name.startswith("update_")}
    return result.status, result.reason, json.dumps(scores), {n: a.tobytes() for n, a in result.series.items()}


def cheats(folder: Path, confinement: str = "auto", seeds: int = 2) -> list[str]:
    """Those of `CHEATS` that are better than the last fix, which is what they honestly have; each in a campaign."""
    gained = []
    scenario = load(SCENARIO)
    files = {name: EstimatorRequest(str(HERE / "cheats" / f"{name}.py"), label=name) for name in CHEATS}
    honest = EstimatorRequest(f"{HERE / 'cheats' / 'cheating_last_fix.py'}:LastFix", label="honest")
    run_campaign([scenario], [honest], range(seeds), folder / "honest", workers=1, confinement=confinement)
    wanted = [plain(result) for result in store.load(folder / "honest")]
    assert [status for status, *_ in wanted] == ["ok"] * seeds
    for name, request in files.items():
        run_campaign([scenario], [request], range(seeds), folder / name, workers=1, confinement=confinement)
        if [plain(result) for result in store.load(folder / name)] != wanted:
            gained.append(name)
    return gained


def vandals(
    folder: Path, confinement: str = "auto", workers: int = 2, seeds: int = 2, without: Collection[str] = ()
) -> Harm:
    """The `VANDALS`, ``without`` some, and two rows of simnav in one campaign, and these without them."""
    results, mark = folder / "results", f"simnav-vandal-{os.getpid()}"
    requests = []
    tried = {
        name: v
        for name, v in VANDALS.items()
        if name not in without and (name not in _CONTAINED or (confinement != "none" and contained()))
    }
    for name, (mischief, _) in tried.items():
        text = _VANDAL.replace("{mischief}", mischief).replace(
            "{constructor}", "raise RuntimeError('not today')" if "constructor" in name else "pass"
        )
        path = folder / f"{name.replace('-', '_')}.py"
        path.write_text(
            text.format(results=str(results), mark=mark, folder=str(folder), campaign=os.getpid()) + _HELPERS
        )
        requests.append(EstimatorRequest(str(path), label=name))
    ours = [EstimatorRequest("gnss-only"), EstimatorRequest("oracle")]
    mixed = [requests[0], ours[0], *requests[1:], ours[1]]
    options: dict[str, Any] = {
        "workers": workers, "time_limit": 2.5, "memory_limit": 300.0, "confinement": confinement,
    }  # fmt: skip
    options["keep_trials"] = True
    scenario = load(SCENARIO)
    run_campaign([scenario], [requests[0], *ours], range(seeds), folder / "alone", **options)
    rights = {path: path.stat().st_mode for path in (folder, *folder.glob("*.py"), *(folder / "alone").rglob("*"))}
    run_campaign([scenario], mixed, range(seeds), results, **options)
    wanted = {(r.estimator, r.seed): plain(r) for r in store.load(folder / "alone")}
    found = {(r.estimator, r.seed): r for r in store.load(results)}
    touched = [f"{n}, seed {s}" for (n, s), w in wanted.items() if (n, s) not in found or plain(found[n, s]) != w]
    touched += [f"process {line}" for line in _processes(mark)]
    touched += [f"mode of {path.name}" for path, mode in rights.items() if path.stat().st_mode != mode]
    unnamed = []
    for name, (_, statuses) in tried.items():
        got = [found[name, s].status if (name, s) in found else "no result" for s in range(seeds)]
        if not set(got) <= statuses:
            unnamed.append(f"{name}: {', '.join(got)} ({found[name, 0].reason if (name, 0) in found else ''})")
    return Harm(len(tried) - 1, unnamed, touched)


def _processes(mark: str) -> list[str]:
    """Processes of which the command line holds a text."""
    found = []
    for entry in Path("/proc").iterdir() if Path("/proc/self").exists() else ():
        if re.fullmatch(r"\d+", entry.name) and int(entry.name) != os.getpid():
            try:
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            except OSError:
                continue
            if mark in command:
                found.append(f"{entry.name}: {command[:80]}")
    return found
