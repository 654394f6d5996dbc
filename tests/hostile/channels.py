"""Whether two rows can pass anything on: one sees the end of a run, the other is told of it before it begins.

The first row marks all that it can reach: limits, priority and processors of processes, modes, times and attributes of
files, files, modules, names of processes, time of the processor. The second row looks at all of it.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.confinement.attempt import close_server, try_estimator
from simnav.leaderboard.campaign.confinement.session import Limits
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.scenario import load
from simnav.source import record

__all__ = ["told"]

_SCENARIO = Path(__file__).parent / "cheats" / "scenario.toml"

_ROW = '''
import array, ctypes, fcntl, glob, json, os, resource, signal, struct, subprocess, sys, tempfile, time
from simnav import Estimate, Estimator

LETTER, FOLDER = {letter!r}, {folder!r}
LIMITS = ("RLIMIT_NOFILE", "RLIMIT_STACK", "RLIMIT_MSGQUEUE", "RLIMIT_SIGPENDING", "RLIMIT_RTPRIO")
PLACES = (FOLDER, "/dev/shm", "/dev/mqueue", "/var/tmp")
NOFLAGS, SETFLAGS, NO_DUMP = 0x80086601, 0x40086602, 0x40
LIBRARIES = ("filterpy.kalman", "scipy.stats")
HINT, SET_HINT = 1035, 1036


def processes():
    """The server, and what is between it and the process of the test: no others, for they would be harmed."""
    process = os.getppid()
    while process not in (0, {campaign}):
        yield process
        try:
            process = int(open(f"/proc/{{process}}/stat").read().rpartition(")")[2].split()[1])
        except OSError:
            return


def tried(what, *arguments):
    try:
        return what(*arguments)
    except Exception:
        return None


class Marks(Estimator):
    """Leaves a mark everywhere."""

    def reset(self, start, instruments):
        self.position, self.k = start.position, 0

    def mark(self):
        letter = os.open(LETTER, os.O_RDONLY)
        for process in processes():
            for name in LIMITS:
                which = getattr(resource, name)
                hard = tried(resource.prlimit, process, which)
                if hard and hard[1] != 0:
                    tried(resource.prlimit, process, which, (77, hard[1]))
            tried(os.setpriority, os.PRIO_PROCESS, process, 7)
            tried(os.sched_setaffinity, process, {{0}})
        tried(os.chmod, LETTER, 0o640)
        tried(os.utime, LETTER, (77, 77))
        tried(os.setxattr, LETTER, "user.mark", b"77")
        tried(fcntl.ioctl, letter, SETFLAGS, struct.pack("l", NO_DUMP))
        tried(fcntl.fcntl, letter, SET_HINT, struct.pack("Q", 3))
        for place in PLACES:
            tried(lambda: open(os.path.join(place, "simnav-mark"), "w").write("77"))
        tried(os.utime, FOLDER, (77, 77))
        tried(os.utime, "/dev/shm", (77, 77))
        tried(lambda: os.makedirs(os.path.join(tempfile.gettempdir(), "closed", "simnav-mark")))
        tried(os.mkdir, os.path.join(tempfile.gettempdir(), "simnav-mark"), 0)
        for library in LIBRARIES:
            tried(__import__, library)
        begun = time.process_time()
        while time.process_time() < begun + 1.5:
            pass
        if os.fork() == 0:
            tried(ctypes.CDLL(None).prctl, 15, b"simnav-mark", 0, 0, 0)
            os.setsid()
            time.sleep(60)
        if os.fork() == 0:
            os.kill(os.getpid(), signal.SIGSEGV)  # which the kernel writes to its log

    def update(self, measurements):
        self.k += 1
        if self.k == 20:
            self.mark()
        return Estimate(measurements.time, position=self.position)


class Looks(Estimator):
    """Says all that it finds."""

    def reset(self, start, instruments):
        self.position = start.position

    def look(self):
        letter, found = os.open(LETTER, os.O_RDONLY), dict()
        for k, process in enumerate(processes()):
            found[f"limits of {{k}}"] = [tried(resource.prlimit, process, getattr(resource, name)) for name in LIMITS]
            found[f"priority of {{k}}"] = tried(os.getpriority, os.PRIO_PROCESS, process)
            found[f"processors of {{k}}"] = sorted(tried(os.sched_getaffinity, process) or ())
            spent = tried(lambda: open(f"/proc/{{process}}/stat").read().rpartition(")")[2].split()[13:15])
            # What a server takes to load is counted there, too.
            found[f"time of {{k}}"] = spent and sum(map(int, spent)) >= 120
        found["own limits"] = [resource.getrlimit(getattr(resource, name)) for name in LIMITS]
        facts = os.stat(LETTER)
        found["file"] = [facts.st_mode, facts.st_mtime, facts.st_uid, tried(os.listxattr, LETTER)]
        found["flags"] = str(tried(fcntl.ioctl, letter, NOFLAGS, bytes(8)))
        found["hint"] = str(tried(fcntl.fcntl, letter, HINT, bytes(8)))
        found["places"] = [[tried(os.path.exists, os.path.join(p, "simnav-mark")), os.path.isdir(p) and
                            os.stat(p).st_mtime == 77] for p in PLACES]
        around = os.path.dirname(tempfile.gettempdir()) + "*/**/simnav-mark"
        found["left"] = glob.glob(around, recursive=True)
        found["modules"] = [n for n in LIBRARIES if n in sys.modules]
        found["names"] = sum("simnav-mark" in (tried(lambda: open(f).read()) or "") for f in glob.glob("/proc/*/comm"))
        return found

    def update(self, measurements):
        diagnostics = {{}}
        if measurements.start == 0.0:
            diagnostics[json.dumps(self.look())] = 1.0
        return Estimate(measurements.time, position=self.position, diagnostics=diagnostics)
'''


def told(folder: Path, confinement: str) -> dict[str, Any]:
    """What a row finds otherwise after a row that has left its marks, in a sealed campaign: by name, before and after.

    Parameters
    ----------
    folder : Path
        For the file of the rows.
    confinement : {"process", "bubblewrap"}
        As of a campaign.
    """
    file, letter = folder / "rows.py", folder / "letter"
    letter.write_text("nothing")
    letter.chmod(0o644)
    file.write_text(_ROW.format(letter=str(letter), folder=str(folder), campaign=os.getpid()))
    recording, limits = record(load(_SCENARIO), 0), Limits(60.0, 1 << 30)

    def run(name: str) -> dict[str, Any]:
        entrant = Entrant(f"{file}:{name}", {}, name, False, "", kernels=())
        made = try_estimator(entrant, recording, limits, confinement, sealed=True)
        assert made.status == "ok", made.reason
        assert made.trial is not None
        return dict(json.loads(next(iter(made.trial.diagnostics), "{}")))

    try:
        before = run("Looks")
        run("Marks")
        after = run("Looks")
    finally:
        close_server()
    return {name: (value, after.get(name)) for name, value in before.items() if after.get(name) != value}
