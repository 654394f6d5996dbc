"""The server of a worker: nothing secret, forks an estimator process for each run.

It is started as ``python -m simnav.leaderboard.campaign.confinement.server DESCRIPTOR``, where the descriptor is a Unix
socket to the worker. It is asked, in JSON, to load kernels, to fork (descriptors of the pipes come with it, and of
a control group where there is one), to finish with the process that it forked, and to import libraries before the next
fork. Kernels are loaded before the first estimator that may call them, and not in the time of any. The server watches
what the process takes with all that it starts, kills all that is left of it, and is gone when the worker is. If its own
limits or priority were changed, it ends before the next fork, and the worker starts another one.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import importlib
import json
import os
import select
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from simnav.kinds import INSTRUMENTS
from simnav.leaderboard.results.scratch import scratch
from simnav.plugins import entry_points

from . import privileges, seccomp
from .estimator_process import LIBRARIES, live
from .landlock import Unreadable, restrict
from .limits import (
    RSS_UNIT,
    WATCH,
    become_reaper,
    begin_alone,
    death_of,
    die_with_parent,
    keep_freed_memory,
    kill_descendants,
    limit,
    out_of_memory_kills,
    own_settings,
    resident,
    use_huge_pages,
)
from .reachable_kernels import reachable_kernels
from .resource_use import Watch

__all__ = ["COPY_FROM", "main"]

#: Environment variable: folder of compiled kernels that are copied before they are loaded, for it cannot be written to.
COPY_FROM = "SIMNAV_KERNELS_FROM"

_GRACE = 1.0  # for a process that has closed its pipe to end [s]
_LONGEST = 1 << 16  # of a request [bytes]


def main() -> None:
    """Serve until the worker is gone."""
    control = socket.socket(fileno=int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    become_reaper()
    keep_freed_memory()
    copied_from = os.environ.pop(COPY_FROM, "")
    _import_estimators()
    with scratch("estimator") as own:
        _serve(control, own, copied_from)


def _serve(control: socket.socket, own: Path, copied_from: str) -> None:
    """Do what the worker asks for, until it is gone."""
    hidden: list[str] = []
    unreadable = Unreadable(hidden)
    settings = own_settings()
    try:
        control.sendall(json.dumps({"ready": True}).encode())
        while True:
            request, descriptors = _receive(control)
            if request is None or ("fork" in request and own_settings() != settings):
                return
            if "load" in request:
                _load_kernels(copied_from, request["load"])
                control.sendall(json.dumps({"ready": True}).encode())
            if "fork" in request:
                if hidden != request["fork"]["hidden"]:
                    hidden = request["fork"]["hidden"]
                    unreadable = Unreadable(hidden)
                _fork(control, request["fork"], descriptors, own, unreadable)
            for name in request.get("import", ()):
                if name in LIBRARIES:
                    with contextlib.suppress(Exception):
                        importlib.import_module(name)
    finally:
        _remove(own)


def _import_estimators() -> None:
    """simnav's own estimators; plug-ins of others are loaded in their own processes only."""
    from simnav.estimator.registry import discover_own

    discover_own()
    importlib.import_module("simnav.leaderboard.campaign.entrant")  # or each estimator process would
    importlib.import_module("numpy.random")
    if all(point.value == INSTRUMENTS.home for point in entry_points(INSTRUMENTS.group)):  # no code of others
        INSTRUMENTS.discover()  # to look for them takes 7 ms
    _settle_memory()


def _load_kernels(copied_from: str, modules: list[str]) -> None:
    """Kernels that estimators of some modules may call, from a folder that cannot be written to if there is one."""
    from simnav.compiled import cache_directory

    wanted, target = reachable_kernels(modules), cache_directory()
    if copied_from and target is not None:
        shutil.rmtree(target, ignore_errors=True)  # nothing that an estimator may have put there is loaded
        for part in {k.fingerprint() for kernel in wanted for k in kernel.tree()}:
            with contextlib.suppress(OSError):
                shutil.copytree(Path(copied_from) / part, target / part)
    for kernel in wanted:
        kernel.compile()
    if copied_from and target is not None:
        shutil.rmtree(target, ignore_errors=True)
    _settle_memory()


def _settle_memory() -> None:
    """Share what is loaded with the forked processes: a collection in one of them does not copy it."""
    gc.collect()
    gc.freeze()
    use_huge_pages()


def _receive(control: socket.socket) -> tuple[dict[str, Any] | None, list[int]]:
    data, descriptors, _, _ = socket.recv_fds(control, _LONGEST, 3)
    return (json.loads(data) if data else None), descriptors


def _fork(
    control: socket.socket, asked: dict[str, Any], descriptors: list[int], own: Path, unreadable: Unreadable
) -> None:
    """Fork an estimator process and look after it until the worker has done with it."""
    temporary = Path(tempfile.mkdtemp(dir=own))
    cache = asked["cache"] and str(own / asked["cache"])  # below its own folder, or an absolute path
    if cache:
        with contextlib.suppress(OSError):
            os.makedirs(cache, mode=0o700, exist_ok=True)
    if asked["user"] is not None:
        for folder in filter(None, (temporary, cache)):
            with contextlib.suppress(OSError):
                os.chown(folder, asked["user"], asked["user"])
    if asked["landlock"]:
        unreadable.prepare()
    before, parent = out_of_memory_kills(), os.getpid()
    confined, says = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            control.close()
            _become_estimator(parent, asked | {"cache": cache}, [*descriptors[:2], says, *descriptors[2:]], temporary,
                              unreadable)  # fmt: skip
        finally:
            os._exit(70)
    for descriptor in (*descriptors, says):
        os.close(descriptor)
    fault = os.read(confined, _LONGEST).decode()  # nothing of the estimator runs before
    os.close(confined)
    start, verdict, ended = resident(child), "", None
    watch = Watch(child, start, asked["memory"], temporary)
    control.sendall(json.dumps({"forked": child, "fault": fault}).encode())
    try:
        while not select.select([control], [], [], WATCH)[0]:
            if not verdict:
                verdict = watch.verdict()
                if verdict:
                    watch.kill()  # the worker sees the pipe closed
        request, _ = _receive(control)
        if request is None:
            return
        deadline = time.monotonic() + (_GRACE if request.get("gone") else 0.0)
        while True:
            pid, status, usage = os.wait4(child, os.WNOHANG)
            if pid == child:
                ended = death_of(os.waitstatus_to_exitcode(status))
                break
            if time.monotonic() >= deadline:
                os.kill(child, signal.SIGKILL)
                _, _, usage = os.wait4(child, 0)
                break
            time.sleep(0.001)
        peak = max(usage.ru_maxrss * RSS_UNIT - start, watch.together)
        killed = ended == "SIGKILL" and out_of_memory_kills() > before
        facts = {"ended": ended, "peak": max(0, peak), "verdict": verdict or ("killed" if killed else "")}
    finally:
        with contextlib.suppress(OSError):
            os.kill(child, signal.SIGKILL)
        kill_descendants()
        _remove(temporary)
    control.sendall(json.dumps(facts).encode())


def _remove(folder: Path) -> None:
    """Remove a folder, also where folders in it are very deep, or closed to their owner."""

    def open_up(_: object, path: str, __: object) -> None:
        with contextlib.suppress(OSError):
            os.chmod(os.path.dirname(path), stat.S_IRWXU)
            if os.path.isdir(path) and not os.path.islink(path):
                os.chmod(path, stat.S_IRWXU)

    for again in range(2):
        with contextlib.suppress(RecursionError):
            shutil.rmtree(folder, onerror=open_up if not again else lambda *_: None)
        if not folder.exists():
            return
    with contextlib.suppress(OSError):
        subprocess.run(["rm", "-rf", "--", str(folder)], stderr=subprocess.DEVNULL, check=False)


def _become_estimator(
    parent: int, asked: dict[str, Any], descriptors: list[int], temporary: Path, unreadable: Unreadable
) -> None:
    """The forked process until it ends."""
    if descriptors[3:]:
        with contextlib.suppress(OSError):
            os.write(descriptors[3], b"0")  # join the group whose memory is limited
    in_force = [not asked["landlock"] or unreadable.enforce()]
    moved = [fcntl.fcntl(descriptor, fcntl.F_DUPFD, 16) for descriptor in descriptors[:3]]
    down, up, says = 3, 4, 5
    for number, descriptor in zip((down, up, says), moved, strict=True):
        os.dup2(descriptor, number)
    os.closerange(6, _most_descriptors())
    begin_alone(parent)
    if asked.get("core") is not None and hasattr(os, "sched_setaffinity"):
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, {asked["core"]})
    writable: list[str | Path] = [temporary, os.devnull]
    os.environ["TMPDIR"] = tempfile.tempdir = str(temporary)
    if asked.get("cache"):
        os.environ["SIMNAV_CACHE_DIR"] = asked["cache"]
        writable.append(asked["cache"])
    with contextlib.suppress(OSError):
        os.chdir(asked["folder"])
    if asked["landlock"]:
        in_force.append(restrict(writable))
    privileges.give_up(asked["user"])
    die_with_parent(parent)  # which is forgotten with a change of the user
    os.umask(0o077)
    limit(asked["timeout"], asked["memory"], alone=os.geteuid() == asked["user"])
    if not all(in_force):
        os.write(says, b"Landlock")
        os._exit(0)
    if not seccomp.deny() and seccomp.available():
        os.write(says, b"a filter of system calls (seccomp)")
        os._exit(0)
    os.close(says)
    live(down, up)
    os._exit(0)


def _most_descriptors() -> int:
    import resource

    soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return soft if 0 < soft < 1 << 20 else 1 << 20


if __name__ == "__main__":
    main()
