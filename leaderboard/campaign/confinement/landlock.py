"""Landlock: a Linux process that gives up rights for itself and all that it starts (Linux 5.13 and later).

An estimator process can then write only below a few folders, and read nothing in the folder of the results or in the
file of a secret key. From Linux 6.7 on it can open no TCP connection, and from
6.12 on it can send no signal to a process outside its own domain. It can trace no process outside, either.
Needs no privilege and no package; see the kernel's documentation, "Landlock: unprivileged access control".
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import struct
import sys
from collections.abc import Iterable

from .limits import PR_SET_NO_NEW_PRIVS, prctl

__all__ = ["Unreadable", "available", "restrict", "signals_are_scoped"]

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # system calls, the same on all architectures
_PATH_BENEATH = 1

_WRITE_FILE, _READ_FILE, _TRUNCATE = 1 << 1, 1 << 2, 1 << 14
#: What all processes can read and some can change: counters and state of other processes, of control groups and of
#: devices, and logs of the kernel, into which whoever crashes writes. Of these only `_HARMLESS` can be read, and of
#: devices only `_DEVICES`: root could read the disk, with the key on it, and whoever opens a terminal makes one.
_STATE = ("/proc", "/sys", "/dev/kmsg", "/var/log", "/run/log", "/var/crash", "/var/lib/systemd/coredump")
_HARMLESS = (
    "/proc/cpuinfo", "/proc/meminfo", "/proc/filesystems", "/proc/version", "/proc/sys/vm/overcommit_memory",
    "/proc/sys/kernel/osrelease", "/proc/sys/kernel/pid_max", "/proc/sys/kernel/threads-max",
    "/proc/sys/kernel/cap_last_cap", "/proc/sys/kernel/random", "/sys/devices/system/cpu", "/sys/devices/system/node",
    "/sys/kernel/mm/transparent_hugepage", "/sys/fs/cgroup/cpu.max", "/sys/fs/cgroup/cpu/cpu.cfs_quota_us",
    "/sys/fs/cgroup/cpu/cpu.cfs_period_us",
)  # fmt: skip
_DEVICES = ("null", "zero", "full", "random", "urandom", "shm")

#: Rights over files by the version of the interface that brought them: all that change something.
_IOCTL_DEVICE = 1 << 15  # requests to devices, such as the size of a terminal, which all that can open it can change
_WRITING = {1: sum(1 << bit for bit in (1, 4, 5, 6, 7, 8, 9, 10, 11, 12)), 2: 1 << 13, 3: _TRUNCATE, 5: _IOCTL_DEVICE}
_TCP = (4, 0b11)  # version, bind and connect
_SCOPES = (6, 0b11)  # version, abstract sockets and signals


@functools.cache
def _version() -> int:
    """Version of the interface; 0 where there is none."""
    if sys.platform != "linux":
        return 0
    with contextlib.suppress(OSError, AttributeError):
        return max(0, int(ctypes.CDLL(None).syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(1))))
    return 0


def available() -> bool:
    """Whether this system has it."""
    return _version() > 0


def signals_are_scoped() -> bool:
    """Whether it keeps signals from processes outside."""
    return _version() >= _SCOPES[0]


def restrict(writable: Iterable[str | os.PathLike[str]]) -> bool:
    """Give up, for this process and its children, all writing but below some folders.

    Parameters
    ----------
    writable : iterable of path
        Folders and files; those that do not exist are left out.

    Returns
    -------
    bool
        Whether it is in force.
    """
    version = _version()
    rights = sum(bits for since, bits in _WRITING.items() if since <= version)
    ruleset = _ruleset(rights, _TCP[1] if version >= _TCP[0] else 0, _SCOPES[1] if version >= _SCOPES[0] else 0)
    if ruleset < 0:
        return False
    try:
        for path in writable:
            _allow(ruleset, path, rights if os.path.isdir(path) else rights & (_WRITE_FILE | _TRUNCATE))
        return _enforce(ruleset)
    finally:
        os.close(ruleset)


class Unreadable:
    """Files that a process and its children give up to read: some that are named, and the state of the system.

    A process can read what the system says of itself, of processors and of memory in total, but not of other processes
    (`_STATE`): of these an earlier process could change much.

    Landlock knows rights that are granted, for a folder with all that is below it. So the right to read is granted for
    everything beside the folders above the hidden places. These folders can still be listed.

    Parameters
    ----------
    hidden : iterable of str
        Files and folders. They need not exist.
    """

    def __init__(self, hidden: Iterable[str]):
        self._hidden = {os.path.realpath(path) for path in (*hidden, *_STATE)}
        self._above = {parent for path in self._hidden for parent in _parents(path)}
        self._ruleset, self._seen, self._found = -1, dict[str, int](), dict[str, int]()

    def prepare(self) -> None:
        """Note what can be read; for a folder above a hidden place that has changed, again, so that new files count."""
        if not available():
            return
        hidden = {path: os.stat(path).st_ino for path in self._hidden if os.path.exists(path)}
        if self._ruleset >= 0 and hidden != self._found:  # one may be what could be read before, under another name
            os.close(self._ruleset)
            self._ruleset, self._seen = -1, {}
        if self._ruleset < 0:
            self._found, self._ruleset = hidden, _ruleset(_READ_FILE)
            for path in _HARMLESS:
                _allow(self._ruleset, path, _READ_FILE)
        if self._ruleset < 0:
            return
        for folder in self._above:
            with contextlib.suppress(OSError):
                changed = os.stat(folder).st_mtime_ns
                if self._seen.get(folder) == changed:
                    continue
                with os.scandir(folder) as entries:
                    for entry in entries:  # what a link leads to counts where it lies
                        if folder == "/dev" and entry.name not in _DEVICES:
                            continue
                        if entry.path not in self._hidden and entry.path not in self._above and not entry.is_symlink():
                            _allow(self._ruleset, entry.path, _READ_FILE)
                self._seen[folder] = changed

    def enforce(self) -> bool:
        """Give the rest up; whether that is in force."""
        if self._ruleset < 0:
            return False
        _allow(self._ruleset, f"/proc/{os.getpid()}", _READ_FILE)
        return _enforce(self._ruleset)


def _parents(path: str) -> list[str]:
    found = []
    while (parent := os.path.dirname(path)) != path:
        found.append(parent)
        path = parent
    return found


def _ruleset(files: int, tcp: int = 0, scopes: int = 0) -> int:
    """Descriptor of a new set of rules over these rights; negative where there is none."""
    version = _version()
    if not version:
        return -1
    attributes = struct.pack("=Q", files)
    if version >= _TCP[0]:
        attributes += struct.pack("=Q", tcp)
    if version >= _SCOPES[0]:
        attributes += struct.pack("=Q", scopes)
    return int(_libc().syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), ctypes.c_uint32(0)))


def _allow(ruleset: int, path: str | os.PathLike[str], rights: int) -> None:
    """Grant rights below a path; nothing where it does not exist."""
    with contextlib.suppress(OSError):
        opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
        try:
            rule = struct.pack("=Qi", rights, opened)
            _libc().syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, ctypes.c_uint32(0))
        finally:
            os.close(opened)


def _enforce(ruleset: int) -> bool:
    if not prctl(PR_SET_NO_NEW_PRIVS, 1):
        return False
    return bool(_libc().syscall(_RESTRICT_SELF, ruleset, ctypes.c_uint32(0)) == 0)


@functools.cache
def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)
