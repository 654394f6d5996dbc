"""Seccomp: a Linux process that gives up system calls for itself and all that it starts.

An estimator process can then open no socket (also none to a service of the user's desktop, which would start programs
outside), and has no memory, queue or key ring in common with other processes: two estimators of one person could tell
each other what is measured later. Pipes and pairs of sockets to its own children are left. Needs no privilege and no
package; see the kernel's documentation, "Seccomp BPF".
"""

from __future__ import annotations

import ctypes
import errno
import platform
import struct
import sys

from simnav.leaderboard.campaign.confinement.limits import PR_SET_NO_NEW_PRIVS, prctl

__all__ = ["DENIED", "available", "deny"]

_CALL = {"x86_64": 317, "aarch64": 277}  # seccomp(2)
_SET_MODE_FILTER, _SPECULATION_ALLOWED = 1, 4  # older kernels would slow the process down without the latter
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06  # instructions of the classic packet filter
_ALLOW, _ERRNO = 0x7FFF0000, 0x00050000
_NUMBER, _ARCHITECTURE = 0, 4  # where they are in what a filter sees
_X32 = 0x40000000  # calls of another interface of the same processor

#: Numbers by architecture of: socket, shmget, semget, msgget, mq_open, add_key, request_key, keyctl, bpf, userfaultfd,
#: perf_event_open; and those that are the same everywhere: io_uring_setup, pidfd_getfd.
DENIED: dict[str, tuple[int, ...]] = {
    "x86_64": (41, 29, 64, 68, 240, 248, 249, 250, 321, 323, 298, 425, 438),
    "aarch64": (198, 194, 190, 186, 180, 217, 218, 219, 280, 282, 241, 425, 438),
}
_AUDIT = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}


def available() -> bool:
    """Whether the calls of this system are known."""
    return sys.platform == "linux" and platform.machine() in DENIED and sys.maxsize > 2**32


def deny() -> bool:
    """Give the calls up; they then fail with "operation not permitted".

    Returns
    -------
    bool
        Whether it is in force.
    """
    if not available():
        return False
    machine = platform.machine()
    numbers = DENIED[machine]
    refuse = struct.pack("=HBBI", _RETURN, 0, 0, _ERRNO | errno.EPERM)
    program = struct.pack("=HBBI", _LOAD, 0, 0, _ARCHITECTURE)
    program += struct.pack("=HBBI", _EQUAL, 1, 0, _AUDIT[machine]) + refuse
    program += struct.pack("=HBBI", _LOAD, 0, 0, _NUMBER)
    program += struct.pack("=HBBI", _AT_LEAST, len(numbers) + 1, 0, _X32)
    for k, number in enumerate(numbers):
        program += struct.pack("=HBBI", _EQUAL, len(numbers) - k, 0, number)
    program += struct.pack("=HBBI", _RETURN, 0, 0, _ALLOW) + refuse
    text = ctypes.create_string_buffer(program, len(program))
    given = ctypes.create_string_buffer(struct.pack("@HP", len(program) // 8, ctypes.addressof(text)))
    if not prctl(PR_SET_NO_NEW_PRIVS, 1):
        return False
    where = ctypes.c_void_p(ctypes.addressof(given))
    return bool(ctypes.CDLL(None).syscall(_CALL[machine], _SET_MODE_FILTER, _SPECULATION_ALLOWED, where) == 0)
