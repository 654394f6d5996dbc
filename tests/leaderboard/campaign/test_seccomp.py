"""The filter of system calls: its numbers are those of the kernel, and what it lets through, on both processors."""

from __future__ import annotations

import errno
import os
import re
import struct
from pathlib import Path

import pytest

from simnav.leaderboard.campaign.confinement import seccomp

ALLOWED, PROCESS = 0x7FFF0000, 4711
ARCHITECTURES = ("x86_64", "aarch64")
#: Headers of the kernel. ARM64 has the numbers of the generic table.
HEADERS = {
    "x86_64": ("/usr/include/x86_64-linux-gnu/asm/unistd_64.h", "/usr/include/asm/unistd_64.h"),
    "aarch64": ("/usr/include/asm-generic/unistd.h",),
}
#: Calls of old that ARM64 never had, and the call that does the same there.
OLD = {
    "chmod": "fchmodat", "chown": "fchownat", "lchown": "fchownat", "utime": "utimensat", "utimes": "utimensat",
    "futimesat": "utimensat", "inotify_init": "inotify_init1", "ioperm": "", "iopl": "",
}  # fmt: skip


def table(architecture: str) -> dict[str, int]:
    """Numbers of calls by name, as the header of this machine says."""
    found = next((path for path in map(Path, HEADERS[architecture]) if path.exists()), None)
    if found is None:
        pytest.skip(f"the header of {architecture} is not here (package linux-libc-dev)")
    lines = re.findall(r"#define\s+__NR(?:3264)?_(\w+)\s+(\d+)\b", found.read_text())
    assert len(lines) > 300
    marks = ("syscalls", "arch_specific_syscall")  # which are no calls
    return {name: int(number) for name, number in lines if name not in marks}


def conditional(architecture: str) -> dict[str, int]:
    return {name: (here if architecture == "x86_64" else arm) for name, here, arm, *_ in seccomp._CONDITIONAL}


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_the_numbers_are_those_of_the_kernel(architecture: str) -> None:
    known = table(architecture)
    newest, asked = max(known.values()), seccomp.DENIED[architecture] | conditional(architecture)
    checked = {name: number for name, number in asked.items() if name in known or number <= newest}
    assert {name: known.get(name) for name in checked} == checked
    assert len(checked) > 110
    assert len(set(asked.values())) == len(asked)  # no call hides another
    assert all(number < seccomp._UNKNOWN for number in asked.values())


def test_what_only_one_processor_has_is_replaced_on_the_other() -> None:
    intel, arm = seccomp.DENIED["x86_64"], seccomp.DENIED["aarch64"]
    assert set(intel) - set(arm) == set(OLD)
    assert set(arm) <= set(intel)
    assert {new for new in OLD.values() if new} <= set(arm)
    assert not set(OLD) & set(table("aarch64"))  # the kernel has them not


def run(architecture: str, number: int, arguments: tuple[int, ...] = (), *, audit: int | None = None) -> int:
    """What the filter answers: the instructions of the classic packet filter that it uses, one by one."""
    code = seccomp._program(architecture, PROCESS)
    program = [struct.unpack_from("=HBBI", code, at) for at in range(0, len(code), 8)]
    assert len(program) <= 4096  # which the kernel takes at most
    given = struct.pack(
        "=iIQ6Q", number, audit or seccomp._AUDIT[architecture], 0, *arguments, *[0] * (6 - len(arguments))
    )
    at = value = 0
    while True:
        operation, if_true, if_false, operand = program[at]
        at += 1
        if operation == 0x20:
            (value,) = struct.unpack_from("=I", given, operand)
        elif operation == 0x54:
            value &= operand
        elif operation == 0x06:
            return operand
        else:
            at += if_true if (value == operand if operation == 0x15 else value >= operand) else if_false


def refused(error: int) -> int:
    return 0x00050000 | error


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_all_other_calls_pass(architecture: str) -> None:
    known, named = table(architecture), seccomp.DENIED[architecture]
    passing = {name for name, number in known.items() if run(architecture, number) == ALLOWED}
    assert not passing & set(named)
    conditions = {"mmap", "fcntl", "clone", "fadvise64", "madvise", "preadv2", "futex", "sched_getaffinity", "getsid"}
    assert conditions <= passing  # with zeros as their arguments
    assert set(known) - passing - set(named) <= {
        "clone3", "ioctl", "socketpair", "flock", "ioprio_set", "ioprio_get",
    }  # fmt: skip
    assert {"read", "write", "openat", "execve", "exit_group", "ppoll", "pipe2", "munmap"} <= passing


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_another_interface_and_unknown_calls_are_refused(architecture: str) -> None:
    other = next(a for a in ARCHITECTURES if a != architecture)
    read = 0 if architecture == "x86_64" else 63
    assert run(architecture, read) == ALLOWED
    assert run(architecture, read, audit=seccomp._AUDIT[other]) == refused(errno.EPERM)
    assert run(architecture, read, audit=0x40000003) == refused(errno.EPERM)  # of 32 bits
    assert run(architecture, 0x40000000 | read) == refused(errno.EPERM)
    assert run(architecture, seccomp._UNKNOWN) == refused(errno.ENOSYS)
    assert run(architecture, 500) == refused(errno.ENOSYS)


#: Calls with arguments, and the error or none.
CASES: list[tuple[str, tuple[int, ...], int]] = [
    ("mmap", (0, 4096, 3, 0x22), 0),  # private, without a file
    ("mmap", (0, 4096, 1, 0x01), 0),  # shared, with a file
    ("mmap", (0, 4096, 3, 0x21), errno.EPERM),
    ("mmap", (0, 4096, 3, 0x8021), errno.EPERM),  # and populated
    ("socketpair", (1, 1), 0),
    ("socketpair", (1, 1 | 0o2000000), 0),  # closed on exec
    ("socketpair", (1, 2), errno.EPERM),  # datagrams can be sent to any name
    ("socketpair", (30, 1), errno.EPERM),
    ("futex", (0, 128), 0),
    ("futex", (0, 129), 0),
    ("futex", (0, 128 | 256 | 9), 0),
    ("futex", (0, 0), 0),  # as for the end of a thread
    ("futex", (0, 256 | 9), 0),
    ("futex", (0, 1), errno.EINVAL),  # wake whoever waits at a page of a common file
    ("futex", (0, 10), errno.EINVAL),
    ("futex", (0, 3), errno.EINVAL),
    ("futex", (0, 5), errno.EINVAL),
    ("preadv2", (3, 0, 1, 0, 0, 8), errno.EOPNOTSUPP),
    ("preadv2", (3, 0, 1, 0, 0, 1), 0),
    ("fadvise64", (3, 0, 0, 2), 0),
    ("fadvise64", (3, 0, 0, 4), errno.EPERM),
    ("madvise", (0, 0, 14), 0),  # huge pages
    ("madvise", (0, 0, 4), 0),
    ("madvise", (0, 0, 21), errno.EINVAL),
    ("madvise", (0, 0, 12), errno.EINVAL),
    ("getpriority", (0, 0), 0),
    ("getpriority", (0, PROCESS), 0),
    ("getpriority", (0, 1), errno.EPERM),
    ("getpriority", (2, 0), errno.EPERM),  # of all processes of a user
    ("setpriority", (0, PROCESS, 5), 0),
    ("setpriority", (0, 1, 5), errno.EPERM),
    ("ioprio_get", (1, 1), errno.EPERM),
    ("sched_getaffinity", (1,), errno.ENOSYS),
    ("sched_getaffinity", (PROCESS,), 0),
    ("sched_setaffinity", (1,), errno.EPERM),
    ("getpgid", (1,), errno.EPERM),
    ("prlimit64", (1,), errno.EPERM),
    ("prlimit64", (0,), 0),
    ("fcntl", (3, 1030), 0),
    ("fcntl", (3, 6), errno.EPERM),  # a lock
    ("fcntl", (3, 1031), errno.EPERM),  # the size of a pipe, of which a user has so much
    ("ioctl", (0, 0x5401), 0),
    ("ioctl", (0, 0x5412), errno.EPERM),  # a character into the terminal
    ("clone", (0x11,), 0),
    ("clone", (0x10000011,), errno.EPERM),  # users of its own
    ("clone3", (), errno.ENOSYS),
]  # fmt: skip


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize(("name", "arguments", "error"), CASES)
def test_arguments_decide(architecture: str, name: str, arguments: tuple[int, ...], error: int) -> None:
    wanted = refused(error) if error else ALLOWED
    assert run(architecture, conditional(architecture)[name], arguments) == wanted


@pytest.mark.skipif(not seccomp.available(), reason="the system calls are not known here")
def test_it_is_in_force_and_python_goes_on() -> None:
    """In a child: threads, queues, programs and pairs of sockets as libraries use them."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            import queue
            import socket
            import subprocess
            import sys
            import threading

            assert seccomp.deny()
            found: queue.Queue[int] = queue.Queue()
            threads = [threading.Thread(target=found.put, args=(k,)) for k in range(8)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            assert sorted(found.get() for _ in range(8)) == list(range(8))
            one, other = socket.socketpair()
            one.sendall(b"x")
            assert other.recv(1) == b"x"
            words = "import os, threading; t = threading.Thread(target=print, args=('here',)); t.start(); t.join()"
            assert subprocess.run([sys.executable, "-c", words], capture_output=True, check=True).stdout == b"here\n"
            os.sched_getaffinity(0)
            os.getpriority(os.PRIO_PROCESS, os.getpid())
            for what in (lambda: os.getpgid(1), lambda: socket.socketpair(type=socket.SOCK_DGRAM)):
                try:
                    what()
                except PermissionError:
                    continue
                raise AssertionError(what)
            status = 0
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
