"""Landlock: a Linux process that gives up rights for itself and all that it starts (Linux 5.13 and later).

An estimator process can then write only below a few folders. From Linux 6.7 on it can open no TCP connection, and from
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

__all__ = ["available", "restrict", "signals_are_scoped"]

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # system calls, the same on all architectures
_PR_SET_NO_NEW_PRIVS = 38
_PATH_BENEATH = 1

_WRITE_FILE, _TRUNCATE = 1 << 1, 1 << 14
#: Rights over files by the version of the interface that brought them: all that change something.
_WRITING = {1: sum(1 << bit for bit in (1, 4, 5, 6, 7, 8, 9, 10, 11, 12)), 2: 1 << 13, 3: _TRUNCATE}
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
    if not version:
        return False
    libc = ctypes.CDLL(None)
    rights = sum(bits for since, bits in _WRITING.items() if since <= version)
    attributes = struct.pack("=Q", rights)
    if version >= _TCP[0]:
        attributes += struct.pack("=Q", _TCP[1])
    if version >= _SCOPES[0]:
        attributes += struct.pack("=Q", _SCOPES[1])
    ruleset = libc.syscall(_CREATE_RULESET, attributes, ctypes.c_size_t(len(attributes)), ctypes.c_uint32(0))
    if ruleset < 0:
        return False
    try:
        for path in writable:
            with contextlib.suppress(OSError):
                opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
                try:
                    own = rights if os.path.isdir(path) else rights & (_WRITE_FILE | _TRUNCATE)
                    rule = struct.pack("=Qi", own, opened)
                    libc.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, rule, ctypes.c_uint32(0))
                finally:
                    os.close(opened)
        if libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
            return False
        return bool(libc.syscall(_RESTRICT_SELF, ruleset, ctypes.c_uint32(0)) == 0)
    finally:
        os.close(ruleset)
