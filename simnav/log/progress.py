"""How far a long file has been read: readers tell it, and a command shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeAlias

__all__ = ["Watcher", "tell", "watched"]

#: Is called with the file, and how many of how many parts of it have been read.
Watcher: TypeAlias = Callable[[Path, int, int], None]

_WATCHER: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Within this context a watcher is told how far a file has been read."""
    token = _WATCHER.set(watcher)
    try:
        yield
    finally:
        _WATCHER.reset(token)


def tell(path: Path, done: int, total: int) -> None:
    """Tell how many of how many parts of a file (bytes, messages) have been read; without a watcher nothing happens."""
    watcher = _WATCHER.get()
    if watcher is not None:
        watcher(path, done, total)
