"""A process of its own: how it begins, its limits, and what is known of it: memory, descendants, how it ended."""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

__all__ = [
    "PR_SET_NO_NEW_PRIVS",
    "RSS_UNIT",
    "WATCH",
    "become_reaper",
    "begin_alone",
    "children_of",
    "death_of",
    "die_with_parent",
    "interrupted",
    "keep_freed_memory",
    "kill_descendants",
    "lift_memory_limit",
    "limit",
    "out_of_memory_kills",
    "own_settings",
    "prctl",
    "resident",
    "use_huge_pages",
    "why_it_died",
]

_LINUX: bool = sys.platform == "linux"
#: Between two looks at the resident memory of a process [s].
WATCH = 0.02 if _LINUX else 0.5
#: Of ``ru_maxrss`` [bytes].
RSS_UNIT = 1 if sys.platform == "darwin" else 1024
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
#: Of `prctl`: no program that is started has more rights. Without it no rights can be given up.
PR_SET_NO_NEW_PRIVS = 38
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
_FROM_OUTSIDE = ("SIGKILL", "SIGTERM", "SIGHUP", "SIGINT", "SIGQUIT")
_FILES, _PROCESSES = 1024, 512  # open files and processes (with their threads) of an estimator
_PATIENCE = 5.0  # s, for which descendants are killed at most
_MADV_COLLAPSE, _HUGE = 25, 2 << 20  # of madvise(2); bytes of a huge page where a page has 4 KiB


def begin_alone(parent: int) -> None:
    """Begin the life of a forked process: gone with its parent, with signals and streams of its own."""
    os.setsid()  # Ctrl-C in the terminal is not for it, and it can be killed with all that it starts
    die_with_parent(parent)
    signal.set_wakeup_fd(-1)
    faulthandler.disable()
    for which in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM, signal.SIGCHLD):
        signal.signal(which, signal.SIG_DFL)
    nothing = os.open(os.devnull, os.O_RDWR)
    for descriptor in (0, 1, 2):
        os.dup2(nothing, descriptor)
    if nothing > 2:
        os.close(nothing)
    sys.stdin = open(os.devnull)  # noqa: SIM115
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115


def limit(seconds: float, memory: int, *, final: bool = True, alone: bool = False) -> None:
    """Limit this process: no core files, CPU time (if everyone who could kill it is dead), private memory.

    If the limits are final, it also opens at most 1024 files, and no file becomes larger than its memory may.

    Parameters
    ----------
    seconds : float
        Wall-clock limit of which the CPU time allows four times as much, and a minute [s].
    memory : int
        Memory that the process may take in addition to its present memory [bytes].
    final : bool
        True: the process cannot raise the limits again.
    alone : bool
        Whether its user has no other processes, so that their number can be limited.
    """
    import resource

    def lower(which: int, value: int) -> None:
        hard = resource.getrlimit(which)[1]
        wanted = value if hard == resource.RLIM_INFINITY else min(value, hard)
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(which, (wanted, wanted if final else hard))

    lower(resource.RLIMIT_CORE, 1 if _LINUX else 0)  # 0 would still start the program that collects core files
    lower(resource.RLIMIT_CPU, int(4.0 * seconds) + 61)
    if final:
        lower(resource.RLIMIT_FSIZE, memory)
        lower(resource.RLIMIT_NOFILE, _FILES)
        if alone:
            lower(resource.RLIMIT_NPROC, _PROCESSES)
    if _LINUX:
        with open("/proc/self/statm") as file:
            data = int(file.read().split()[5]) * resource.getpagesize()
        lower(resource.RLIMIT_DATA, data + memory)


def lift_memory_limit() -> None:
    """Lift the limit of private memory of this process, unless it is final."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def die_with_parent(parent: int) -> None:
    """A process that is killed takes this one with it (Linux; elsewhere the limit of CPU time ends it)."""
    prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def prctl(option: int, value: int) -> bool:
    """Set an attribute of this process, see prctl(2); whether that worked (Linux)."""
    if _LINUX:
        with contextlib.suppress(OSError, AttributeError):
            return bool(ctypes.CDLL(None).prctl(option, value, 0, 0, 0) == 0)
    return False


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
    prctl(_PR_SET_CHILD_SUBREAPER, 1)


def kill_descendants() -> None:
    """Kill all children of this process, and theirs once they have become its own."""
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline:
        for child in children_of(os.getpid()):
            with contextlib.suppress(OSError):
                os.kill(child, signal.SIGKILL)
        try:
            if os.waitpid(-1, os.WNOHANG)[0] == 0:
                time.sleep(0.001)
        except ChildProcessError:
            return


def children_of(process: int) -> list[int]:
    """Children of a process."""
    found = []
    try:
        for thread in os.listdir(f"/proc/{process}/task"):
            with open(f"/proc/{process}/task/{thread}/children") as file:
                found += [int(child) for child in file.read().split()]
        return found
    except (OSError, ValueError):
        if not os.path.exists(f"/proc/{process}/stat") or os.path.exists(f"/proc/self/task/{os.getpid()}/children"):
            return found  # it has just ended, or there is no such folder
    with contextlib.suppress(OSError):
        for entry in os.listdir("/proc"):
            with contextlib.suppress(OSError, ValueError, IndexError):
                if entry.isdigit() and int(_fields(entry)[1]) == process:
                    found.append(int(entry))
    return found


def _fields(process: str) -> list[str]:
    """What /proc says of a process, after its name: state, parent and so on."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()


def own_settings() -> tuple[object, ...]:
    """What another process of the same user could change of this one: limits, priority, processors."""
    import resource

    names = [name for name in dir(resource) if name.startswith("RLIMIT_")]
    limits = tuple((name, resource.getrlimit(getattr(resource, name))) for name in names)
    if not _LINUX:
        return (limits, os.getpriority(os.PRIO_PROCESS, 0))
    scheduling = (os.sched_getscheduler(0), frozenset(os.sched_getaffinity(0)))
    return (limits, os.getpriority(os.PRIO_PROCESS, 0), scheduling)


def resident(process: int) -> int:
    """Resident memory of a process [bytes]; 0 if it cannot be told."""
    try:
        with open(f"/proc/{process}/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        pass
    if _LINUX or os.name != "posix":
        return 0
    done = subprocess.run(["ps", "-o", "rss=", "-p", str(process)], capture_output=True, text=True, check=False)
    return int(done.stdout.strip() or 0) * 1024


def out_of_memory_kills() -> int:
    """How many processes the kernel has killed for want of memory since it started; 0 where it does not tell."""
    with contextlib.suppress(OSError, ValueError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            name, _, value = line.partition(" ")
            if name == "oom_kill":
                return int(value)
    return 0


def death_of(code: int) -> str:
    """How a process ended, in words, from its exit code: that of a signal is negative."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


def interrupted(reason: str) -> bool:
    """Whether the reason of a failure may be the end of the whole campaign: the process was killed from outside."""
    return any(f"({name})" in reason for name in _FROM_OUTSIDE)


def why_it_died(death: str, peak: int, memory: int, *, by_kernel: bool) -> tuple[str, str]:
    """Status and reason of a process that ended without an answer.

    Parameters
    ----------
    death : str
        How it ended (`death_of`).
    peak : int
        Memory that it had taken at most [bytes].
    memory : int
        Limit of its memory [bytes].
    by_kernel : bool
        Whether the kernel killed it for want of memory.
    """
    starved = death.startswith("SIG") and death != "SIGKILL" and peak > 0.9 * memory
    if by_kernel or starved:
        return "out-of-memory", f"killed ({death}) for want of memory"
    return "error", f"the process died ({death}) without an answer"
