"""What an estimator takes with all that it started: memory of its processes, and files that it made."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from pathlib import Path

from .limits import children_of, resident

__all__ = ["PROCESSES", "Watch"]

#: Processes of an estimator at most.
PROCESSES = 512
_SECONDS = 0.25  # between two looks at files [s]
_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


class Watch:
    """Looks at an estimator process, its descendants and its temporary folder, from its parent.

    Parameters
    ----------
    child : int
        The process.
    start : int
        Its resident memory at its start, which it shares with its parent [bytes].
    memory : int
        What all may take beyond that [bytes].
    folder : Path
        Its temporary folder.

    Attributes
    ----------
    together : int
        The most memory that was seen of it and the processes that it started, beyond that of its start [bytes].
    """

    def __init__(self, child: int, start: int, memory: int, folder: Path):
        self._child, self._start, self._memory, self._folder = child, start, memory, folder
        self._next, self._exact, self._counted = 0.0, 0.0, 0.0
        self._files = self.together = 0

    def verdict(self) -> str:
        """``out-of-memory`` or ``error`` (too many processes); empty where all is well."""
        now = time.monotonic()
        own = resident(self._child) - self._start
        if own > self._memory:
            return "out-of-memory"
        processes = _descendants()
        if len(processes) > PROCESSES:
            return "error"
        if now >= self._next:
            self._files = _taken_by_files(self._folder, processes)
            self._next = time.monotonic() + max(_SECONDS, 20.0 * (time.monotonic() - now))  # a twentieth of the time
        if self._files + max(own, 0) > self._memory:
            return "out-of-memory"
        if len(processes) > 1 and now >= self._counted:
            others = sum(_proportional(p) for p in processes if p != self._child)
            self.together = max(self.together, own + others)
            self._counted = time.monotonic() + 20.0 * (time.monotonic() - now)
        if len(processes) > 1 and now >= self._exact:
            rough = sum(map(resident, processes)) - self._start
            if rough + self._files > self._memory:  # pages that processes share were counted for each
                shared = _proportional(os.getpid())
                exact = sum(map(_proportional, processes)) - min(shared, self._start)
                if exact + self._files > self._memory:
                    return "out-of-memory"
                self._exact = time.monotonic() + max(_SECONDS, 20.0 * (time.monotonic() - now))
        return ""

    def kill(self) -> None:
        """Kill the process and all its descendants; they remain to be waited for."""
        for process in [self._child, *_descendants()]:
            with contextlib.suppress(OSError):
                os.kill(process, signal.SIGKILL)


def _descendants() -> list[int]:
    """All living processes that this one, or a child of it, has started."""
    found: list[int] = []
    todo = children_of(os.getpid())
    while todo and len(found) <= PROCESSES:
        found += todo
        todo = [grandchild for child in todo for grandchild in children_of(child)]
    return found


def _proportional(process: int) -> int:
    """Memory of a process, of which shared pages count for each in part [bytes]."""
    with contextlib.suppress(OSError, ValueError):
        for line in Path(f"/proc/{process}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) << 10
    return 0


def _taken_by_files(folder: Path, processes: list[int]) -> int:
    """Bytes of the files in a folder, and of those that processes hold open or mapped after they were deleted."""
    taken = {}
    todo = [str(folder)]
    while todo:
        with contextlib.suppress(OSError), os.scandir(todo.pop()) as entries:
            for entry in entries:
                with contextlib.suppress(OSError):
                    facts = entry.stat(follow_symlinks=False)
                    taken[facts.st_dev, facts.st_ino] = max(facts.st_blocks * 512, _PAGE)  # an empty one is kept, too
                    if entry.is_dir(follow_symlinks=False):
                        todo.append(entry.path)
    for process in processes:
        with contextlib.suppress(OSError):
            for name in os.listdir(f"/proc/{process}/fd"):
                with contextlib.suppress(OSError):
                    facts = os.stat(f"/proc/{process}/fd/{name}")
                    if facts.st_nlink == 0 and facts.st_blocks:
                        taken[facts.st_dev, facts.st_ino] = facts.st_blocks * 512
        with contextlib.suppress(OSError, ValueError):
            for line in Path(f"/proc/{process}/maps").read_text().splitlines():
                if line.endswith("(deleted)"):
                    places, rights, _, device, inode, *_ = line.split()
                    if rights[3:] == "s":
                        begin, end = (int(place, 16) for place in places.split("-"))
                        major, minor = (int(part, 16) for part in device.split(":"))
                        taken.setdefault((os.makedev(major, minor), int(inode)), end - begin)
    return sum(taken.values())
