"""What the library tells a command while it works: how far a file has been read, and that kernels are compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeAlias

__all__ = ["Watcher", "announce", "announced", "awaited", "tell", "watched"]

#: Is called with the file, and how many of how many parts of it have been read.
Watcher: TypeAlias = Callable[[Path, int, int], None]

_WATCHER: ContextVar[Watcher | None] = ContextVar("watcher", default=None)
_ANNOUNCE: ContextVar[Callable[[], None] | None] = ContextVar("announce", default=None)


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


@contextmanager
def announced(tell: Callable[[], None]) -> Iterator[None]:
    """Within this context ``tell`` is called once, before the first kernel that is not in the cache is compiled."""
    token = _ANNOUNCE.set(tell)
    try:
        yield
    finally:
        _ANNOUNCE.reset(token)


def awaited() -> bool:
    """Whether somebody waits for the announcement of the first kernel that is compiled."""
    return _ANNOUNCE.get() is not None


def announce() -> None:
    """Call what waits for the announcement, once."""
    tell = _ANNOUNCE.get()
    if tell is not None:
        _ANNOUNCE.set(None)
        tell()
