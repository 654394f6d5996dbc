"""Whether two rows that run at the same time can meet: one is alive and leaves signs, the other looks for them.

Both are in processes of two servers, as with two workers of a sealed campaign. What is compared is what the second row
sees alone, and what it sees while the first one is there.
"""

from __future__ import annotations

import json
import os
import socket
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.confinement import landlock
from simnav.leaderboard.campaign.confinement.attempt import attempt
from simnav.leaderboard.campaign.confinement.session import EstimatorServer, Limits
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.scenario import load
from simnav.source import record

__all__ = ["seen"]

_SCENARIO = Path(__file__).parent / "cheats" / "scenario.toml"

_ROW = '''
import ctypes, glob, json, mmap, os, platform, socket, struct, tempfile, threading, time
from simnav import Estimate, Estimator

LETTER, LARGE, HERE, SERVICE = {letter!r}, {large!r}, {here!r}, {service!r}
ARM = platform.machine() == "aarch64"
FUTEX, IO_SETUP, IOPRIO_GET, IOPRIO_SET = (98, 0, 31, 30) if ARM else (202, 206, 252, 251)
HARMLESS = ("null", "zero", "full", "random", "urandom", "fd", "stdin", "stdout", "stderr", "core")
libc = ctypes.CDLL(None, use_errno=True)
libc.syscall.restype = ctypes.c_long


def tried(what, *arguments):
    try:
        return what(*arguments)
    except Exception:
        return None


def datagrams():
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)


def word(path):
    """Address of a word in a page of a file that everybody can read."""
    descriptor = os.open(path, os.O_RDONLY)
    libc.mmap.restype = ctypes.c_void_p
    libc.mmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t) + 3 * (ctypes.c_int,) + (ctypes.c_long,)
    found = libc.mmap(None, 4096, mmap.PROT_READ, mmap.MAP_SHARED, descriptor, 0)
    return ctypes.c_void_p(found), ctypes.c_uint32.from_address(found).value


def others():
    return [int(name) for name in os.listdir("/proc") if name.isdigit() and int(name) != os.getpid()]


class Signs(Estimator):
    """Leaves signs, and waits."""

    def reset(self, start, instruments):
        self.position, self.k = start.position, 0

    def leave(self):
        kept = []
        for address in ("\\0simnav-meeting", os.path.join(tempfile.gettempdir(), "simnav-meeting")):
            def bound():
                one, two = datagrams()
                libc.connect(one.fileno(), struct.pack("H", 0), 2)  # it has no peer any more
                one.bind(address)
                if address[0] == "/":
                    libc.chmod(address.encode(), 0o777)
                return one, two
            kept.append(tried(bound))
        address, value = word(LETTER)
        wait = lambda: libc.syscall(FUTEX, address, 0, value, None, None, 0)
        threading.Thread(target=wait, daemon=True).start()
        tried(os.setpriority, os.PRIO_PROCESS, 0, 7)
        tried(os.sched_setscheduler, 0, os.SCHED_BATCH, os.sched_param(0))
        tried(os.sched_setaffinity, 0, {{max(os.sched_getaffinity(0))}})
        libc.syscall(IOPRIO_SET, 1, 0, (2 << 13) | 6)
        if os.fork() == 0:
            os.setpgid(0, 0)
            time.sleep(60)
            os._exit(0)
        for size in (60000, 30000, 10000, 3000, 1000, 300, 100, 30, 10, 3, 1):
            while libc.syscall(IO_SETUP, size, ctypes.byref(ctypes.c_ulong(0))) == 0:
                pass
        kept += [tried(os.open, "/dev/ptmx", os.O_RDONLY) for _ in range(3)]
        tried(lambda: os.posix_fadvise(os.open(LARGE, os.O_RDONLY), 0, 0, os.POSIX_FADV_DONTNEED))
        return kept

    def update(self, measurements):
        self.k += 1
        if self.k == 3:
            kept = self.leave()
            while os.path.exists(HERE):
                time.sleep(0.05)
        return Estimate(measurements.time, position=self.position)


class Seeks(Estimator):
    """Says what it sees."""

    def reset(self, start, instruments):
        self.position = start.position

    def sent(self, address):
        return tried(lambda: datagrams()[0].sendto(b"x", address)) is not None

    def each(self, what):
        return sorted({{str(tried(what, process)) for process in others()}})

    def seek(self):
        found = dict()
        found["abstract socket"] = self.sent("\\0simnav-meeting")
        places = glob.glob(os.path.join(tempfile.gettempdir().partition("simnav-")[0] or "/", "simnav-*/*/*-meeting"))
        found["socket in a folder"] = any(map(self.sent, places))
        found["futex on a common file"] = max(libc.syscall(FUTEX, word(LETTER)[0], 1, 1, None, None, 0), 0)
        found["priority"] = "7" in self.each(lambda p: os.getpriority(os.PRIO_PROCESS, p))
        found["class of scheduling"] = str(os.SCHED_BATCH) in self.each(os.sched_getscheduler)
        found["processors"] = len(self.each(os.sched_getaffinity)) > 1
        found["priority of input and output"] = str((2 << 13) | 6) in self.each(
            lambda p: libc.syscall(IOPRIO_GET, 1, p))
        found["group of processes"] = self.each(lambda p: p == os.getpgid(p) != os.getsid(p))
        found["requests in flight"] = libc.syscall(IO_SETUP, 5000, ctypes.byref(ctypes.c_ulong(0))) == 0
        found["terminals"] = tried(lambda: sorted(os.listdir("/dev/pts")))
        found["service"] = self.sent(SERVICE)
        found["devices"] = [path for path in glob.glob("/dev/*") if os.path.basename(path) not in HARMLESS and not
                            os.path.isdir(path) and tried(os.open, path, os.O_RDONLY | os.O_NONBLOCK) is not None]
        large = os.open(LARGE, os.O_RDONLY)
        now = lambda: tried(os.preadv, large, [bytearray(10)], 0, os.RWF_NOWAIT)
        found["page in the cache"] = now() is not None
        return found

    def update(self, measurements):
        diagnostics = {{}}
        if measurements.start == 0.0:
            diagnostics[json.dumps(self.seek())] = 1.0
        return Estimate(measurements.time, position=self.position, diagnostics=diagnostics)
'''


def seen(folder: Path, confinement: str) -> dict[str, Any]:
    """What a row sees otherwise while another row is there: by name, alone and together.

    So are a device that it can open, and a service of the machine that it can call, whoever else is there.

    Parameters
    ----------
    folder : Path
        For the files of the rows.
    confinement : {"process", "bubblewrap"}
        As of a campaign.
    """
    file, letter, large, here = (folder / name for name in ("rows.py", "letter", "large", "here"))
    letter.write_text("nothing" * 1000)
    with open(large, "wb") as opened:
        opened.write(bytes(1 << 20))
        os.fsync(opened.fileno())  # what is not on the disk yet cannot be put out of the cache
    here.write_text("")
    for path in (letter, large, here):
        path.chmod(0o644)
    recording, limits = record(load(_SCENARIO), 0), Limits(60.0, 1 << 30)

    def run(name: str) -> dict[str, Any]:
        server = EstimatorServer(confinement, loaded=(), sealed=True)
        try:
            made = attempt(server, Entrant(f"{file}:{name}", {}, name, False, "", kernels=()), recording, limits)
        finally:
            server.close()
        assert made.status == "ok", made.reason
        assert made.trial is not None
        return dict(json.loads(next(iter(made.trial.diagnostics), "{}")))

    with tempfile.TemporaryDirectory() as short, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as service:
        service.bind(f"{short}/service")
        for path in (short, f"{short}/service"):
            os.chmod(path, 0o777)
        names = {"letter": letter, "large": large, "here": here, "service": f"{short}/service"}
        file.write_text(_ROW.format(**{name: str(path) for name, path in names.items()}))
        return _differences(run, here)


def _differences(run: Callable[[str], dict[str, Any]], here: Path) -> dict[str, Any]:
    """What the second row says alone, and what it says while the first one is there."""
    alone = run("Seeks")
    first = threading.Thread(target=run, args=("Signs",))
    first.start()
    try:
        time.sleep(8.0)  # it can say nothing to this process before its run ends
        assert first.is_alive()
        together = run("Seeks")
    finally:
        here.unlink()
        first.join()
    nothing = {"service": False, "devices": [] if landlock.available() else alone["devices"]}
    wanted = alone | nothing
    return {name: (wanted[name], value) for name, value in together.items() if wanted[name] != value}
