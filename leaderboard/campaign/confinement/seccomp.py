"""Seccomp: a Linux process that gives up system calls for itself and all that it starts.

Two estimators of one person could tell each other what is measured later, and one can do harm to another. So an
estimator process can open no socket (also none to a service of the user's desktop, which would start programs outside),
has no memory, queue, lock or key ring in common with other processes, changes no attribute of a file that is not its
contents (mode, owner, times, extended attributes), watches no files, and neither sees nor changes limits, priorities
and groups of another process. Pipes and connected pairs of sockets to its own children are left. Calls of kernels that
are newer than the list do not exist for it. Needs no privilege and no package; see the kernel's documentation,
"Seccomp BPF".
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from .limits import PR_SET_NO_NEW_PRIVS, prctl

__all__ = ["DENIED", "available", "deny"]

_CALL = {"x86_64": 317, "aarch64": 277}  # seccomp(2)
_SET_MODE_FILTER, _SPECULATION_ALLOWED = 1, 4  # older kernels would slow the process down without the latter
_LOAD, _EQUAL, _AT_LEAST, _AND, _RETURN = 0x20, 0x15, 0x35, 0x54, 0x06  # of the classic packet filter
_ALLOW, _ERRNO = 0x7FFF0000, 0x00050000
_NUMBER, _ARCHITECTURE, _ARGUMENTS = 0, 4, 16  # where they are in what a filter sees
_X32 = 0x40000000  # calls of another interface of the same processor
_UNKNOWN = 470  # from here on, calls of kernels after 6.18; libraries do without a call that does not exist

#: Numbers of calls that are refused whatever their arguments, by architecture. Calls that are missing on ARM64 were
#: replaced there by others of the list.
DENIED: dict[str, dict[str, int]] = {
    "x86_64": {
        "socket": 41, "bind": 49, "listen": 50, "connect": 42, "accept": 43, "accept4": 288,
        "shmget": 29, "shmat": 30, "shmctl": 31, "semget": 64, "semop": 65, "semctl": 66, "semtimedop": 220,
        "msgget": 68, "msgsnd": 69, "msgrcv": 70, "msgctl": 71, "mq_open": 240, "mq_unlink": 241, "mq_timedsend": 242,
        "mq_timedreceive": 243, "mq_notify": 244, "mq_getsetattr": 245, "io_setup": 206, "io_submit": 209,
        "add_key": 248, "request_key": 249, "keyctl": 250,
        "chmod": 90, "fchmod": 91, "fchmodat": 268, "chown": 92, "fchown": 93, "lchown": 94, "fchownat": 260,
        "utime": 132, "utimes": 235, "futimesat": 261, "utimensat": 280,
        "setxattr": 188, "lsetxattr": 189, "fsetxattr": 190,
        "removexattr": 197, "lremovexattr": 198, "fremovexattr": 199,
        "inotify_init": 253, "inotify_init1": 294, "fanotify_init": 300, "mincore": 27, "memfd_create": 319,
        "name_to_handle_at": 303, "open_by_handle_at": 304, "ptrace": 101, "process_vm_readv": 310,
        "process_vm_writev": 311, "kcmp": 312, "migrate_pages": 256, "move_pages": 279,
        "bpf": 321, "userfaultfd": 323, "perf_event_open": 298, "syslog": 103,
        "mount": 165, "umount2": 166, "pivot_root": 155, "chroot": 161, "unshare": 272, "setns": 308,
        "settimeofday": 164, "clock_settime": 227, "adjtimex": 159, "clock_adjtime": 305, "sethostname": 170,
        "setdomainname": 171, "swapon": 167, "swapoff": 168, "reboot": 169, "init_module": 175, "finit_module": 313,
        "delete_module": 176, "kexec_load": 246, "kexec_file_load": 320, "acct": 163, "quotactl": 179,
        "vhangup": 153, "iopl": 172, "ioperm": 173,
    },
    "aarch64": {
        "socket": 198, "bind": 200, "listen": 201, "connect": 203, "accept": 202, "accept4": 242,
        "shmget": 194, "shmat": 196, "shmctl": 195, "semget": 190, "semop": 193, "semctl": 191, "semtimedop": 192,
        "msgget": 186, "msgsnd": 189, "msgrcv": 188, "msgctl": 187, "mq_open": 180, "mq_unlink": 181,
        "mq_timedsend": 182, "mq_timedreceive": 183, "mq_notify": 184, "mq_getsetattr": 185, "io_setup": 0,
        "io_submit": 2,
        "add_key": 217, "request_key": 218, "keyctl": 219,
        "fchmod": 52, "fchmodat": 53, "fchown": 55, "fchownat": 54, "utimensat": 88,
        "setxattr": 5, "lsetxattr": 6, "fsetxattr": 7, "removexattr": 14, "lremovexattr": 15, "fremovexattr": 16,
        "inotify_init1": 26, "fanotify_init": 262, "mincore": 232, "memfd_create": 279,
        "name_to_handle_at": 264, "open_by_handle_at": 265, "ptrace": 117, "process_vm_readv": 270,
        "process_vm_writev": 271, "kcmp": 272, "migrate_pages": 238, "move_pages": 239,
        "bpf": 280, "userfaultfd": 282, "perf_event_open": 241, "syslog": 116,
        "mount": 40, "umount2": 39, "pivot_root": 41, "chroot": 51, "unshare": 97, "setns": 268,
        "settimeofday": 170, "clock_settime": 112, "adjtimex": 171, "clock_adjtime": 266, "sethostname": 161,
        "setdomainname": 162, "swapon": 224, "swapoff": 225, "reboot": 142, "init_module": 105, "finit_module": 273,
        "delete_module": 106, "kexec_load": 104, "kexec_file_load": 294, "acct": 89, "quotactl": 60, "vhangup": 58,
    },
}  # fmt: skip
#: The same on all architectures.
_NEW = {
    "pidfd_getfd": 438, "process_madvise": 440, "io_uring_setup": 425, "fchmodat2": 452, "setxattrat": 463,
    "removexattrat": 466, "file_setattr": 469, "cachestat": 451, "memfd_secret": 447, "open_tree": 428,
    "move_mount": 429, "fsopen": 430, "fsconfig": 431, "fsmount": 432, "fspick": 433, "mount_setattr": 442,
    "open_tree_attr": 467, "quotactl_fd": 443, "futex_wake": 454, "futex_requeue": 456,
}  # fmt: skip
for _calls in DENIED.values():
    _calls |= _NEW
_AUDIT = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}


@dataclass(frozen=True)
class _Condition:
    """What an argument (its lower 32 bits, which are all that the kernel reads here) must be.

    It is one of the values, once the mask is applied; or none of them.
    """

    argument: int
    values: tuple[int, ...]
    mask: int = 0xFFFFFFFF
    among: bool = True


_SELF = -1  # stands for the number of the process that gives the calls up
_OWN = (_Condition(0, (0, _SELF)),)  # the first argument is a process: 0 is the one that calls
#: Commands of fcntl(2) for descriptors of the process itself; the others lock, watch, or mark files.
_FCNTL = (_Condition(1, (0, 1, 2, 3, 4, 1030, 1032)),)
#: Requests of ioctl(2): close on exec, bytes to read, non-blocking, and whether it is a terminal.
_IOCTL = (_Condition(1, (0x5451, 0x5450, 0x541B, 0x5421, 0x5401, 0x5413, 0x802C542A)),)
_NAMESPACES = (_Condition(0, (0,), 0x7E020000),)  # flags of clone(2): none of new namespaces
_PRIVATE = (_Condition(3, (0x21,), 0x2F, among=False),)  # flags of mmap(2): shared, without a file
#: Pairs of Unix sockets that stay connected with each other: datagrams can be sent to any name.
_CONNECTED = (_Condition(0, (1,)), _Condition(1, (1,), 0xF))
#: Operations of futex(2), whatever the clock: those within a process, and of the others only to wait, as for the end of
#: a thread. Who may wake others by a page of a common file, such as a library, finds out whether they wait.
_FUTEX = (_Condition(1, (*range(128, 142), 0, 9), 0xFFFFFEFF),)
_WAITING_READ = (_Condition(5, (0,), 0x8),)  # flags of preadv2(2): not only what is in the page cache
_KEPT = (_Condition(3, (4,), among=False),)  # of posix_fadvise(2): do not put a file out of the page cache
_MEMORY = (_Condition(2, (12, 20, 21), among=False),)  # of madvise(2): neither merged with others, nor put out

#: Calls that are allowed under conditions, with their numbers on x86-64 and ARM64, and the error otherwise.
_CONDITIONAL: tuple[tuple[str, int, int, tuple[_Condition, ...], int], ...] = (
    ("mmap", 9, 222, _PRIVATE, errno.EPERM),
    ("fcntl", 72, 25, _FCNTL, errno.EPERM),
    ("ioctl", 16, 29, _IOCTL, errno.EPERM),
    ("clone", 56, 220, _NAMESPACES, errno.EPERM),
    ("clone3", 435, 435, (), errno.ENOSYS),  # its flags cannot be seen; libraries then take clone
    ("flock", 73, 32, (), errno.ENOSYS),  # as on a file system without locks, which libraries expect
    ("socketpair", 53, 199, _CONNECTED, errno.EPERM),
    ("futex", 202, 98, _FUTEX, errno.EINVAL),  # at other errors libraries end the process
    ("preadv2", 327, 286, _WAITING_READ, errno.EOPNOTSUPP),
    ("fadvise64", 221, 223, _KEPT, errno.EPERM),
    ("madvise", 28, 233, _MEMORY, errno.EINVAL),
    ("getpriority", 140, 141, (_Condition(0, (0,)), _Condition(1, (0, _SELF))), errno.EPERM),
    ("ioprio_get", 252, 31, (_Condition(0, (1,)), _Condition(1, (0, _SELF))), errno.EPERM),
    ("sched_getaffinity", 204, 123, _OWN, errno.ENOSYS),  # libraries that ask for each thread then do without
    ("sched_getscheduler", 145, 120, _OWN, errno.EPERM),
    ("sched_getparam", 143, 121, _OWN, errno.EPERM),
    ("sched_getattr", 315, 275, _OWN, errno.EPERM),
    ("sched_rr_get_interval", 148, 127, _OWN, errno.EPERM),
    ("getpgid", 121, 155, _OWN, errno.EPERM),
    ("getsid", 124, 156, _OWN, errno.EPERM),
    ("prlimit64", 302, 261, _OWN, errno.EPERM),
    ("setpriority", 141, 140, (_Condition(0, (0,)), _Condition(1, (0, _SELF))), errno.EPERM),
    ("ioprio_set", 251, 30, (_Condition(0, (1,)), _Condition(1, (0, _SELF))), errno.EPERM),
    ("sched_setaffinity", 203, 122, _OWN, errno.EPERM),
    ("sched_setscheduler", 144, 119, _OWN, errno.EPERM),
    ("sched_setparam", 142, 118, _OWN, errno.EPERM),
    ("sched_setattr", 314, 274, _OWN, errno.EPERM),
)


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
    program = _program(platform.machine(), os.getpid())
    text = ctypes.create_string_buffer(program, len(program))
    given = ctypes.create_string_buffer(struct.pack("@HP", len(program) // 8, ctypes.addressof(text)))
    if not prctl(PR_SET_NO_NEW_PRIVS, 1):
        return False
    where = ctypes.c_void_p(ctypes.addressof(given))
    return bool(
        ctypes.CDLL(None).syscall(_CALL[platform.machine()], _SET_MODE_FILTER, _SPECULATION_ALLOWED, where) == 0
    )


def _program(architecture: str, process: int) -> bytes:
    """The filter: another architecture and the x32 interface are refused whole, then each call of the lists."""
    refuse = _instruction(_RETURN, _ERRNO | errno.EPERM)
    program = _instruction(_LOAD, _ARCHITECTURE)
    program += _instruction(_EQUAL, _AUDIT[architecture], 1, 0) + refuse
    program += _instruction(_LOAD, _NUMBER)
    program += _instruction(_AT_LEAST, _X32, 0, 1) + refuse
    program += _instruction(_AT_LEAST, _UNKNOWN, 0, 1) + _instruction(_RETURN, _ERRNO | errno.ENOSYS)
    for _, here, arm, conditions, error in _CONDITIONAL:
        block = _block(conditions, error, process)
        program += _instruction(_EQUAL, here if architecture == "x86_64" else arm, 0, len(block) // 8) + block
    for number in DENIED[architecture].values():
        program += _instruction(_EQUAL, number, 0, 1) + refuse
    return program + _instruction(_RETURN, _ALLOW)


def _block(conditions: Sequence[_Condition], error: int, process: int) -> bytes:
    """Instructions that allow a call where all conditions hold, and refuse it otherwise."""
    refuse, program = _instruction(_RETURN, _ERRNO | error), b""
    for condition in conditions:
        program += _instruction(_LOAD, _ARGUMENTS + 8 * condition.argument)
        if condition.mask != 0xFFFFFFFF:
            program += _instruction(_AND, condition.mask)
        count = len(condition.values)
        for k, value in enumerate(condition.values):
            # To the instruction after the refusal where the condition holds, to the refusal where it does not.
            left = count - 1 - k
            if condition.among:
                program += _instruction(_EQUAL, process if value == _SELF else value, left + 1, 0)
            else:
                program += _instruction(_EQUAL, value, left, 0 if left else 1)
        program += refuse
    return program + (_instruction(_RETURN, _ALLOW) if conditions else refuse)


def _instruction(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return struct.pack("=HBBI", code, if_true, if_false, value)
