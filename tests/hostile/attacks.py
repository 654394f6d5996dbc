"""Campaigns with estimators that cheat or do harm: what they gained, and whom they touched."""

from __future__ import annotations

import json
import os
import re
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
import os, signal, subprocess, sys, time
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

_HELPERS = """

def _open(descriptor):
    import fcntl
    try:
        return fcntl.fcntl(descriptor, fcntl.F_GETFL) & 3 != 0
    except OSError:
        return False


class _Endless:
    def __repr__(self):
        return repr(self)
"""

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
    "opens-a-socket": ("import socket; socket.create_connection(('127.0.0.1', 9), 2.0)", {"error"}),
}  # fmt: skip


#: Those that only a sandbox keeps from the processes and folders of the campaign's user.
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


def vandals(folder: Path, confinement: str = "auto", workers: int = 2, seeds: int = 2) -> Harm:
    """All `VANDALS` and two rows of simnav in one campaign, and these without them."""
    results, mark = folder / "results", f"simnav-vandal-{os.getpid()}"
    requests = []
    tried = {
        name: v for name, v in VANDALS.items() if name not in _CONTAINED or (confinement != "none" and contained())
    }
    for name, (mischief, _) in tried.items():
        text = _VANDAL.replace("{mischief}", mischief).replace(
            "{constructor}", "raise RuntimeError('not today')" if "constructor" in name else "pass"
        )
        path = folder / f"{name.replace('-', '_')}.py"
        path.write_text(text.format(results=str(results), mark=mark) + _HELPERS)
        requests.append(EstimatorRequest(str(path), label=name))
    ours = [EstimatorRequest("gnss-only"), EstimatorRequest("oracle")]
    mixed = [requests[0], ours[0], *requests[1:], ours[1]]
    options: dict[str, Any] = {"workers": workers, "timeout": 4.0, "memory": 300 << 20, "confinement": confinement}
    scenario = load(SCENARIO)
    run_campaign([scenario], [requests[0], *ours], range(seeds), folder / "alone", **options)
    run_campaign([scenario], mixed, range(seeds), results, **options)
    wanted = {(r.estimator, r.seed): plain(r) for r in store.load(folder / "alone")}
    found = {(r.estimator, r.seed): r for r in store.load(results)}
    touched = [f"{n}, seed {s}" for (n, s), w in wanted.items() if (n, s) not in found or plain(found[n, s]) != w]
    touched += [f"process {line}" for line in _processes(mark)]
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
