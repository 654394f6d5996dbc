"""Limits of a process of its own, and what is known of it: memory, descendants, how it ended."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
from pathlib import Path

__all__ = [
    "become_reaper",
    "death_of",
    "die_with_parent",
    "keep_freed_memory",
    "kill_descendants",
    "limit",
    "out_of_memory_kills",
    "resident",
    "use_huge_pages",
]

_LINUX = sys.platform == "linux"
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_MADV_COLLAPSE, _HUGE = 25, 2 << 20  # of madvise(2); bytes of a huge page where a page has 4 KiB


def limit(seconds: float, memory: int) -> None:
    """Limit this process: no core files, CPU time (if everyone who could kill it is dead), private memory.

    Parameters
    ----------
    seconds : float
        Wall-clock limit of which the CPU time allows four times as much, and a minute [s].
    memory : int
        Memory that the process may take in addition to its present memory [bytes].
    """
    import resource

    def lower(which: int, value: int) -> None:
        hard = resource.getrlimit(which)[1]
        wanted = value if hard == resource.RLIM_INFINITY else min(value, hard)
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(which, (wanted, wanted))

    lower(resource.RLIMIT_CORE, 0)
    lower(resource.RLIMIT_CPU, int(4.0 * seconds) + 61)
    if _LINUX:
        with open("/proc/self/statm") as file:
            data = int(file.read().split()[5]) * resource.getpagesize()
        lower(resource.RLIMIT_DATA, data + memory)


def die_with_parent(parent: int) -> None:
    """A process that is killed takes this one with it (Linux; elsewhere the limit of CPU time ends it)."""
    if _LINUX:
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def keep_freed_memory() -> None:
    """Memory that is freed stays with this process and its forks (glibc).

    A process that never held a large array gives freed memory back to the system at once, and asks for the same again
    at every step: the pages of a window would be cleared anew for each epoch.
    """
    if _LINUX:
        with contextlib.suppress(OSError, AttributeError):
            libc = ctypes.CDLL(None)
            for parameter, value in ((_M_MMAP_THRESHOLD, 32 << 20), (_M_TRIM_THRESHOLD, 256 << 20)):
                libc.mallopt(parameter, value)


def use_huge_pages() -> None:
    """Put the memory that this process has now into pages of 2 MiB, as far as that is possible (Linux 6.1 and later).

    A fork copies an entry for each page, and removes it when it ends. With 140 MB in pages of 4 KiB the two take 10 ms.
    """
    if not _LINUX:
        return
    with contextlib.suppress(OSError, AttributeError, ValueError):
        madvise = ctypes.CDLL(None).madvise
        madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
        for line in Path("/proc/self/maps").read_text().splitlines():
            places, rights, _, _, inode, *_ = line.split()
            if rights == "rw-p" and inode == "0":
                begin, end = (int(place, 16) for place in places.split("-"))
                for huge in range(-(-begin // _HUGE) * _HUGE, end - _HUGE + 1, _HUGE):
                    madvise(huge, _HUGE, _MADV_COLLAPSE)  # where it fails, the memory stays as it is


def become_reaper() -> None:
    """Descendants whose parents are gone become children of this process (Linux)."""
    if _LINUX:
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def kill_descendants(patience: float = 5.0) -> None:
    """Kill all children of this process, and theirs once they have become its own."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        for child in _children():
            with contextlib.suppress(OSError):
                os.kill(child, signal.SIGKILL)
        try:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.001)
        except ChildProcessError:
            return


def _children() -> list[int]:
    own = os.getpid()
    with contextlib.suppress(OSError, ValueError):
        return [int(child) for child in Path(f"/proc/{own}/task/{own}/children").read_text().split()]
    found = []
    with contextlib.suppress(OSError):
        for entry in os.listdir("/proc"):
            with contextlib.suppress(OSError, ValueError, IndexError):
                if (
                    entry.isdigit()
                    and int(Path(f"/proc/{entry}/stat").read_text().rpartition(")")[2].split()[1]) == own
                ):
                    found.append(int(entry))
    return found


def resident(process: int) -> int:
    """Resident memory of a process [bytes]; 0 if it cannot be told."""
    try:
        with open(f"/proc/{process}/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def out_of_memory_kills() -> int:
    """How many processes the kernel has killed for want of memory since it started; 0 where it does not tell."""
    with contextlib.suppress(OSError, ValueError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            name, _, value = line.partition(" ")
            if name == "oom_kill":
                return int(value)
    return 0


def death_of(status: int) -> str:
    """How a process ended, in words, from what ``waitpid`` gave."""
    code = os.waitstatus_to_exitcode(status)
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
