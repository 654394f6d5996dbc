"""A core for a worker and its estimator process: a packet and its answer take 3 us on one core, 90 us between two.

Workers of all campaigns of a user share the cores by locks on files, which end with the process. A worker that finds
no free core runs wherever the system puts it.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

__all__ = ["own_core"]

_claimed: dict[int, tuple[int, int] | None] = {}  # by process: core and the descriptor of its lock


@contextlib.contextmanager
def own_core() -> Iterator[int | None]:
    """Hold this thread to a core of its own for a while; None where there is none to be had."""
    if not hasattr(os, "sched_setaffinity"):
        yield None
        return
    allowed = os.sched_getaffinity(0)
    process = os.getpid()
    if process not in _claimed:
        _claimed[process] = _claim(sorted(allowed))
    claim = _claimed[process]
    if claim is None or claim[0] not in allowed:
        yield None
        return
    try:
        os.sched_setaffinity(0, {claim[0]})
    except OSError:
        yield None
        return
    try:
        yield claim[0]
    finally:
        with contextlib.suppress(OSError):
            os.sched_setaffinity(0, allowed)


def _claim(cores: list[int]) -> tuple[int, int] | None:
    import fcntl

    folder = Path(tempfile.gettempdir()) / f"simnav-cores-{os.getuid()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        for core in cores:
            descriptor = os.open(folder / str(core), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return core, descriptor
            except OSError:
                os.close(descriptor)
    return None
