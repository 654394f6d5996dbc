"""A control group for the memory of estimator processes, where one can be made (Linux).

The kernel counts all that a group takes: of all its processes, in files in memory, in pipes. That needs root, or a
group that was handed over to the user, for example by ``systemd-run --user --scope``. See cgroups(7).
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import time
from pathlib import Path

__all__ = ["MemoryGroup"]

_PREFIX = "simnav-"
_SLACK = 64 << 20  # for what the kernel keeps for the processes: page tables and the like [bytes]


class MemoryGroup:
    """A group of its own, beside or below that of this process.

    Attributes
    ----------
    joining : int
        Descriptor of a file; a process that writes ``0`` to it joins the group. Negative where no group could be made.
    """

    def __init__(self) -> None:
        self.joining = -1
        self._folder: Path | None = None
        self._limit, self._kills = "", ""
        for parent, limit, kills in _candidates():
            with contextlib.suppress(OSError):
                _delete_empty_groups(parent)
                folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{os.getpid()}-", dir=parent))
                self._folder, self._limit, self._kills = folder, limit, kills
                try:
                    (folder / limit).read_text()
                    self.joining = os.open(folder / "cgroup.procs", os.O_WRONLY | os.O_CLOEXEC)
                    return
                except OSError:
                    self.close()
                    raise

    def limit(self, memory: int) -> bool:
        """Limit what the processes of the group take together [bytes]; whether that is in force."""
        if self._folder is None:
            return False
        try:
            (self._folder / self._limit).write_text(str(memory + _SLACK))
        except OSError:
            return False
        return True

    def kills(self) -> int:
        """How many of its processes the kernel has killed for want of memory."""
        if self._folder is not None:
            with contextlib.suppress(OSError, ValueError, IndexError):
                for line in (self._folder / self._kills).read_text().splitlines():
                    name, _, value = line.partition(" ")
                    if name == "oom_kill":
                        return int(value)
        return 0

    def close(self) -> None:
        """Remove the group; its processes are gone."""
        if self.joining >= 0:
            os.close(self.joining)
            self.joining = -1
        folder, self._folder = self._folder, None
        for _ in range(50):  # its last process may be about to end
            try:
                if folder is not None:
                    os.rmdir(folder)
                return
            except OSError:
                time.sleep(0.01)


def _delete_empty_groups(parent: Path) -> None:
    """Remove the empty groups of processes that were killed."""
    for folder in parent.glob(f"{_PREFIX}*-*"):
        owner = folder.name.removeprefix(_PREFIX).partition("-")[0]
        if not Path(f"/proc/{owner}").exists():
            with contextlib.suppress(OSError):
                folder.rmdir()


def _candidates() -> list[tuple[Path, str, str]]:
    """Groups in which one may be made, with the names of the files of the limit and of the kills."""
    if sys.platform != "linux":
        return []
    found = []
    with contextlib.suppress(OSError, ValueError):
        mounts = [line.split() for line in Path("/proc/self/mounts").read_text().splitlines()]
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            for _, place, kind, options, *_ in mounts:
                own = Path(place) / path.lstrip("/")
                if kind == "cgroup2" and not controllers:
                    for parent in (own, own.parent) if path != "/" else (own,):
                        with contextlib.suppress(OSError):
                            if "memory" in (parent / "cgroup.subtree_control").read_text().split():
                                found.append((parent, "memory.max", "memory.events"))
                elif kind == "cgroup" and "memory" in controllers.split(",") and "memory" in options.split(","):
                    found.append((own, "memory.limit_in_bytes", "memory.oom_control"))
    return found
