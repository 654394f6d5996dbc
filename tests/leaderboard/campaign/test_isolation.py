"""Isolated calls: every way to misbehave ends as a status, quickly, and leaves nothing behind."""

from __future__ import annotations

import contextlib
import ctypes
import mmap
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simnav.leaderboard.campaign.confinement.isolation import Outcome, isolate

MIB = 1 << 20
posix = pytest.mark.skipif(os.name != "posix", reason="forks")
METHODS = [pytest.param("fork", marks=posix), "spawn"]


def run(
    function: Any, *args: Any, timeout: float = 20.0, memory: int = 300 * MIB, method: str | None = None
) -> Outcome:
    return isolate(function, *args, timeout=timeout, memory=memory, method=method)


def add(a: Any, b: Any) -> Any:
    return a + b


def fail(text: str) -> None:
    raise ValueError(text)


def leave(code: int) -> None:
    os._exit(code)


def sleep(seconds: float) -> None:
    time.sleep(seconds)


def grow() -> None:
    kept = []
    while True:
        kept.append(bytearray(MIB))


@pytest.mark.parametrize("method", METHODS)
def test_returns_what_the_function_returns(method: str) -> None:
    a = np.arange(400_000.0)  # larger than a pipe holds
    outcome = run(add, a, 1.0, method=method)
    assert (outcome.status, outcome.reason) == ("ok", "")
    np.testing.assert_array_equal(outcome.value, a + 1.0)


@pytest.mark.parametrize("method", METHODS)
def test_errors_are_told(method: str) -> None:
    outcome = run(fail, "no fix", method=method)
    assert (outcome.status, outcome.reason, outcome.value) == ("error", "ValueError: no fix", None)
    outcome = run(leave, 3, method=method)
    assert outcome.status == "error"
    assert "exit code 3" in outcome.reason
    outcome = run(sys.exit, 0, method=method)
    assert (outcome.status, outcome.reason) == ("error", "SystemExit: 0")


@pytest.mark.parametrize("method", METHODS)
def test_time_is_limited(method: str) -> None:
    outcome = run(sleep, 60.0, timeout=0.5, method=method)
    assert (outcome.status, outcome.reason) == ("timeout", "stopped after 0.5 s")
    assert 0.5 <= outcome.seconds < 60.0


@posix
def test_a_forked_call_costs_a_fraction_of_a_new_interpreter() -> None:
    seconds = {method: min(run(add, 1, 2, method=method).seconds for _ in range(2)) for method in ("fork", "spawn")}
    assert seconds["fork"] < 0.5 * seconds["spawn"]


@posix
def test_crash_by_signal() -> None:
    outcome = run(ctypes.string_at, 0)
    assert outcome.status == "error"
    assert "SIGSEGV" in outcome.reason
    assert run(os.abort).reason.count("SIGABRT") == 1


@posix
def test_sigterm_ignored_and_busy() -> None:
    def stubborn() -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        while True:
            with contextlib.suppress(BaseException):
                sum(range(1000))

    assert run(stubborn, timeout=0.3).status == "timeout"


@posix
def test_memory_is_limited() -> None:
    outcome = run(grow)
    assert outcome.status == "out-of-memory"
    assert "300 MiB" in outcome.reason
    assert outcome.peak_memory < 400 * MIB
    assert run(np.ones, 10**12).status == "out-of-memory"
    assert run(np.ones, 10**6).status == "ok"


@posix
def test_memory_error_swallowed_for_ever() -> None:
    """It keeps what it has and tries again: stopped by the clock at the latest, never beyond the limit."""

    def hoard() -> None:
        kept = []
        while True:
            with contextlib.suppress(MemoryError):
                kept.append(bytearray(MIB))

    outcome = run(hoard, timeout=2.0)
    assert outcome.status in ("timeout", "out-of-memory")
    assert outcome.peak_memory < 400 * MIB


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_the_watchdog_sees_memory_that_no_resource_limit_counts() -> None:
    def shared() -> None:
        block = mmap.mmap(-1, 1500 * MIB)  # shared: not private data
        for i in range(0, len(block), 4096):
            block[i] = 1
        time.sleep(10.0)

    outcome = run(shared, memory=100 * MIB)
    assert outcome.status == "out-of-memory"


@posix
def test_memory_error_kept_alive_on_an_object_is_still_told() -> None:
    kept: list[list[int]] = []

    def small_pieces() -> None:
        while True:
            kept.append([0] * 1000)

    assert run(small_pieces, memory=100 * MIB).status == "out-of-memory"


@posix
def test_peak_memory_is_that_of_the_call() -> None:
    ballast = np.ones(50 * MIB // 8)  # ours, not the call's

    def use(megabytes: int) -> float:  # pages of its own: what other tests have freed may still be with this process
        pages = np.frombuffer(mmap.mmap(-1, megabytes * MIB, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS), dtype=float)
        pages[:] = 1.0
        return float(pages.sum() + ballast[0])

    small, large = run(use, 1).peak_memory, run(use, 100).peak_memory
    assert small < 40 * MIB
    assert large - small == pytest.approx(99 * MIB, rel=0.1)


@posix
def test_input_is_empty_and_output_is_silent(capfd: pytest.CaptureFixture[str]) -> None:
    def chatter() -> str:
        print("hello")
        os.write(2, b"hello")
        return sys.stdin.read()

    assert run(chatter).value == ""
    with pytest.raises(EOFError):
        raise {"EOFError": EOFError}[run(input).reason.split(":")[0]]
    assert capfd.readouterr() == ("", "")


@posix
def test_what_it_returns_may_not_be_picklable() -> None:
    outcome = run(lambda: lambda: 0)
    assert outcome.status == "error"
    assert "cannot be pickled" in outcome.reason


class Unreadable:
    def __reduce__(self) -> Any:
        return fail, ("on the way back",)


@posix
def test_what_it_returns_may_not_be_readable() -> None:
    outcome = run(Unreadable)
    assert outcome.status == "error"
    assert "on the way back" in outcome.reason


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    stat = Path(f"/proc/{process}/stat")
    return not (stat.exists() and stat.read_text().rpartition(")")[2].split()[0] == "Z")


def gone(process: int) -> bool:
    deadline = time.monotonic() + 50.0  # the child that waits longest would end by itself after a minute
    while alive(process) and time.monotonic() < deadline:
        time.sleep(0.02)
    return not alive(process)


@posix
def test_children_of_the_call_die_with_it(tmp_path: Path) -> None:
    def parent_of_many() -> int:
        return subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]).pid

    assert gone(run(parent_of_many).value)


@pytest.mark.skipif(sys.platform != "linux", reason="parent-death signal")
def test_the_call_dies_with_its_worker(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    code = (
        "import os, time; from pathlib import Path\n"
        "from simnav.leaderboard.campaign.confinement.isolation import isolate\n"
        f"note = Path({str(note)!r})\n"
        "isolate(lambda: (note.write_text(str(os.getpid())), time.sleep(60)), timeout=60, memory=1 << 30)\n"
    )
    worker = subprocess.Popen([sys.executable, "-c", code])
    deadline = time.monotonic() + 100.0
    while not (note.exists() and note.read_text()) and time.monotonic() < deadline:
        time.sleep(0.02)
    worker.kill()
    worker.wait()
    assert gone(int(note.read_text()))


@posix
def test_an_interrupt_of_the_user_leaves_no_child() -> None:
    pids: list[int] = []
    original = os.fork

    def fork() -> int:
        pid = original()
        if pid:
            pids.append(pid)
            signal.setitimer(signal.ITIMER_REAL, 0.2)
        return pid

    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        os.fork = fork
        with pytest.raises(KeyboardInterrupt):
            run(sleep, 30.0)
    finally:
        os.fork = original
        signal.signal(signal.SIGALRM, previous)
    assert not alive(pids[0])
