"""Calls in forked processes, which share all that this one has in memory, and hand back what they return."""

from __future__ import annotations

import gc
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

__all__ = ["forked"]

Made = TypeVar("Made")

_called: Callable[[Any], Any] | None = None  # what forked processes call


@contextmanager
def forked(call: Callable[[Any], Made], arguments: Sequence[Any], workers: int) -> Iterator[Iterator[Made]]:
    """Call a function with each argument in forked processes, while this one goes on.

    Where there is only one process, the calls are made as the iterator is read.

    Parameters
    ----------
    call : callable
        Anything that can be called; it is not pickled. What it returns is.
    arguments : sequence
        What can be pickled.
    workers : int
        Number of processes.

    Yields
    ------
    iterator
        What the calls return, in the order of the arguments. An exception is raised when its place is read.

    Examples
    --------
    >>> with forked(lambda k: k + 1, [1, 2, 3], workers=1) as found:
    ...     list(found)
    [2, 3, 4]
    """
    global _called
    if workers < 2 or len(arguments) < 2 or "fork" not in multiprocessing.get_all_start_methods():
        yield map(call, arguments)
        return
    _called = call
    gc.freeze()  # so that a collection in another process does not copy the memory that it shares
    try:
        with ProcessPoolExecutor(min(workers, len(arguments)), multiprocessing.get_context("fork")) as pool:
            yield pool.map(_call, arguments)
    finally:
        gc.unfreeze()
        _called = None


def _call(argument: Any) -> Any:
    assert _called is not None
    return _called(argument)
