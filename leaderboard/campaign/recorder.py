"""A recording made in a process of its own, with limits: it fails, hangs or wants memory without harm to a campaign.

The process is a fork of the worker. The arrays of the recording come back through shared memory.
"""

from __future__ import annotations

import mmap
import os
import pickle
import sys
import tempfile
from typing import TYPE_CHECKING, Any

from simnav.leaderboard.campaign.confinement.isolation import isolate
from simnav.leaderboard.results.errors import mistakes, sentence

if TYPE_CHECKING:
    from simnav.recording import Recording
    from simnav.scenario import Scenario

__all__ = ["NoRecordingError", "record_here", "record_within", "time_limit"]

_ALIGNED = 64  # bytes at which an array begins


class NoRecordingError(Exception):
    """The recording could not be made; the message is one sentence."""


def time_limit(scenario: Scenario) -> float:
    """Default time that an estimator may take for a run [s]: a fifth of real time, at least a minute."""
    return max(60.0, 0.2 * scenario.duration)


def record_here(scenario: Scenario, seed: int) -> Recording:
    """A recording made in this process; RequestError where the files of a log are not there or cannot be used."""
    from simnav.source import record

    with mistakes(ValueError, FileNotFoundError):
        return record(scenario, seed)


def record_within(scenario: Scenario, seed: int, seconds: float) -> Recording:
    """Record a run in a fork of this process; where there are no forks, in this process without limits.

    The arrays come back through memory that both processes have, so that nothing is copied but once.

    Parameters
    ----------
    scenario : Scenario
        The scenario to record.
    seed : int
        Seed of the run.
    seconds : float
        Wall-clock time that it may take [s].

    Raises
    ------
    NoRecordingError
        If it raises, takes longer, or wants more memory than is free.
    """
    from simnav.source import free_memory, record

    if os.name != "posix":
        try:
            return record(scenario, seed)
        except Exception as error:
            raise NoRecordingError(sentence(error)) from None
    shared = _shared()
    try:
        outcome = isolate(_record, shared, scenario, seed, timeout=seconds, memory=int(free_memory()))
        if outcome.status != "ok":
            raise NoRecordingError(outcome.reason)
        head, places, why = outcome.value
        if why:
            raise NoRecordingError(why)
        size = os.fstat(shared).st_size
        if not size:
            return pickle.loads(head)  # type: ignore[no-any-return]
        view = memoryview(mmap.mmap(shared, size, flags=mmap.MAP_PRIVATE, prot=mmap.PROT_READ | mmap.PROT_WRITE))
        return pickle.loads(head, buffers=[view[a:b] for a, b in places])  # type: ignore[no-any-return]
    finally:
        os.close(shared)


def _shared() -> int:
    """Descriptor of an empty file without a name, in memory where the system has that."""
    if sys.platform == "linux":
        return os.memfd_create("recording", os.MFD_CLOEXEC)
    else:
        with tempfile.TemporaryFile() as file:
            return os.dup(file.fileno())


def _record(shared: int, scenario: Scenario, seed: int) -> tuple[bytes, list[tuple[int, int]], str]:
    """In the other process: the recording without its arrays, where these are in the shared file, or what is wrong."""
    import cloudpickle

    from simnav.source import record

    try:
        recording = record(scenario, seed)
    except MemoryError:
        raise
    except Exception as error:
        return b"", [], sentence(error)
    buffers: list[Any] = []
    head = cloudpickle.dumps(recording, protocol=5, buffer_callback=buffers.append)
    places, at = [], 0
    for buffer in buffers:
        data = buffer.raw()
        at += -at % _ALIGNED
        places.append((at, at + data.nbytes))
        begin, end = at, at + data.nbytes
        while begin < end:
            begin += os.pwrite(shared, data[begin - at : end - at], begin)
        at = end
    return head, places, ""
