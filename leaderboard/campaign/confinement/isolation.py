"""Run code that is not trusted in a process of its own, with limits of time and memory.

On POSIX the process is a fork: it starts in milliseconds, with all kernels warm, and the recording
is shared, not copied. Elsewhere it is spawned. Memory is limited twice: the kernel refuses private
memory beyond the limit (``RLIMIT_DATA``, so that Python sees a `MemoryError` before the machine
suffers), and a watchdog kills a process whose resident memory passes it all the same. Windows
has neither; there only time is limited.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import select
import signal
import struct
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from simnav.leaderboard.results.errors import named

from .limits import (
    RSS_UNIT,
    WATCH,
    begin_alone,
    death_of,
    lift_memory_limit,
    limit,
    out_of_memory_kills,
    resident,
    why_it_died,
)

__all__ = ["Outcome", "isolate"]

_HEADER = struct.Struct(">QQ")  # resident memory at the start, length of the message
_MEGABYTE = 1 << 20


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of an isolated call.

    Attributes
    ----------
    status : str
        ``ok``, ``error`` (it raised, crashed or left), ``timeout`` or ``out-of-memory``.
    reason : str
        One sentence; empty if ok.
    value : object
        Value that the function returned; None unless the status is ok.
    seconds : float
        Wall-clock time.
    peak_memory : int
        Largest resident memory beyond what the process had at its start [bytes].
    """

    status: str
    reason: str
    value: Any
    seconds: float
    peak_memory: int


def isolate(
    function: Callable[..., Any], *args: Any, timeout: float, memory: int, method: str | None = None
) -> Outcome:
    """Call ``function(*args)`` in a process of its own and wait for it.

    The process has no standard input, its output is discarded, and whatever it started is killed
    with it. Nothing that it does raises here.

    Parameters
    ----------
    function, *args
        What to call. The value comes back pickled.
    timeout : float
        Wall-clock limit [s]; the process is killed when it passes, whatever it does.
    memory : int
        Limit of the memory that it takes beyond what it starts with [bytes].
    method : {"fork", "spawn"}, optional
        Default: fork on POSIX. A spawned function and its arguments are pickled.

    Returns
    -------
    Outcome
    """
    started, kills = time.monotonic(), out_of_memory_kills()
    run = _fork if (method or ("fork" if os.name == "posix" else "spawn")) == "fork" else _spawn
    message, verdict, death, peak = run(function, args, timeout, memory)
    seconds = time.monotonic() - started
    if verdict:
        reason = {
            "timeout": f"stopped after {timeout:g} s",
            "out-of-memory": f"stopped when it had taken more than {_readable(memory)} of memory",
        }[verdict]
        return Outcome(verdict, reason, None, seconds, peak)
    if message is None:
        by_kernel = death == "SIGKILL" and out_of_memory_kills() > kills
        return Outcome(*why_it_died(death, peak, memory, by_kernel=by_kernel), None, seconds, peak)
    try:
        status, value, peak = pickle.loads(message)
    except Exception as error:
        return Outcome("error", f"the answer cannot be read ({named(error)})", None, seconds, peak)
    if status == "ok":
        return Outcome("ok", "", value, seconds, peak)
    reason = f"more than {_readable(memory)} of memory was wanted" if status == "out-of-memory" else value
    return Outcome(status, reason, None, seconds, peak)


def _readable(memory: int) -> str:
    return f"{memory / _MEGABYTE:.0f} MiB"


def _answer(function: Callable[..., Any], args: tuple[Any, ...], start: int) -> bytes:
    """Call, in the child, and pickle (status, value or reason, peak memory)."""
    try:
        status, value = "ok", function(*args)
    except MemoryError:
        status, value = "out-of-memory", None
    except BaseException as error:  # SystemExit and KeyboardInterrupt, too: it is not the user who asks
        status, value = "error", named(error)
    lift_memory_limit()
    peak = max(0, _peak_resident() - start)
    try:
        return pickle.dumps((status, value, peak), protocol=pickle.HIGHEST_PROTOCOL)
    except BaseException as error:
        return pickle.dumps(("error", f"what it returned cannot be pickled ({named(error)})", peak))


# --- fork -----------------------------------------------------------------------------------------


def _fork(
    function: Callable[..., Any], args: tuple[Any, ...], timeout: float, memory: int
) -> tuple[bytes | None, str, str, int]:
    """Return (message or None, verdict or "", how it died, peak memory)."""
    deadline = time.monotonic() + timeout
    parent, (read, write) = os.getpid(), os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # fork beside threads: the child uses none of them
        child = os.fork()
    if child == 0:
        try:
            os.close(read)
            _serve(write, parent, function, args, timeout, memory)
        finally:
            os._exit(70)
    os.close(write)
    received, verdict = bytearray(), ""
    start, wanted = -1, _HEADER.size
    try:
        while len(received) < wanted:
            left = deadline - time.monotonic()
            if left <= 0:
                verdict = "timeout"
                break
            if select.select([read], [], [], min(left, WATCH))[0]:
                piece = os.read(read, _MEGABYTE)
                if not piece:
                    break
                received += piece
                if start < 0 and len(received) >= 8:
                    start = int.from_bytes(received[:8])
                if len(received) >= _HEADER.size:
                    wanted = _HEADER.size + _HEADER.unpack_from(received)[1]
            elif start >= 0 and resident(child) - start > memory:
                verdict = "out-of-memory"
                break
    finally:
        os.close(read)
        _kill(child)
        _, status, usage = os.wait4(child, 0)
    peak = max(0, usage.ru_maxrss * RSS_UNIT - start) if start >= 0 else 0
    if verdict or len(received) < wanted:
        return None, verdict, death_of(os.waitstatus_to_exitcode(status)), peak
    return bytes(received[_HEADER.size :]), "", "", peak


def _kill(child: int) -> None:
    """Kill a child and all that it started (it leads a session once it is up)."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError):
        os.kill(child, signal.SIGKILL)


def _serve(
    write: int, parent: int, function: Callable[..., Any], args: tuple[Any, ...], timeout: float, memory: int
) -> None:
    """The child's whole life."""
    begin_alone(parent)
    start = resident(os.getpid())
    os.write(write, start.to_bytes(8))
    limit(timeout, memory, final=False)
    message = _answer(function, args, start)
    view = memoryview(len(message).to_bytes(8) + message)
    while view:
        view = view[os.write(write, view) :]
    os._exit(0)


def _peak_resident() -> int:
    """Largest resident memory of this process so far [bytes]; 0 if it cannot be told."""
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * RSS_UNIT


# --- spawn ----------------------------------------------------------------------------------------


def _spawn(
    function: Callable[..., Any], args: tuple[Any, ...], timeout: float, memory: int
) -> tuple[bytes | None, str, str, int]:
    """Like `_fork`, for systems without it."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_spawned, args=(theirs, function, args, timeout, memory))
    message: bytes | None = None
    try:
        process.start()
        theirs.close()
        if not ours.poll(timeout):
            return None, "timeout", "", 0
        with contextlib.suppress(EOFError, OSError):
            message = ours.recv_bytes()
    finally:
        ours.close()
        if process.pid is not None:
            if message is not None:
                process.join(1.0)
            process.kill()
            process.join()
    return message, "", death_of(process.exitcode or 0), 0


def _spawned(connection: Any, function: Callable[..., Any], args: tuple[Any, ...], timeout: float, memory: int) -> None:
    sys.stdin = open(os.devnull)  # noqa: SIM115
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    start = _peak_resident()
    if os.name == "posix":
        limit(timeout, memory, final=False)
    connection.send_bytes(_answer(function, args, start))
