"""Temporary folders that do not stay behind, also where the process that made them was killed.

A folder is locked as long as its process lives; the lock ends with the process, however that ends. Whoever makes the
next folder removes those that nobody holds any more.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:
    LOCKS = False  # Windows: a folder is removed by the process that made it, or not at all
else:
    LOCKS = True

__all__ = ["LOCKS", "delete_leftovers", "scratch"]

#: A folder that is younger than this is left alone: its process may not have locked it yet [s].
YOUNG = 60.0


@contextlib.contextmanager
def scratch(purpose: str, parent: Path | None = None, *, sweeping: bool = True) -> Iterator[Path]:
    """A new temporary folder, which is removed at the end, or by the next call if this process is killed.

    Parameters
    ----------
    purpose : str
        A word for its name.
    parent : Path, optional
        Folder in which it is made; by default that of temporary files.
    sweeping : bool
        False: what killed processes left stays.
    """
    place = Path(tempfile.gettempdir()) if parent is None else parent
    if sweeping:
        delete_leftovers(purpose, place)
    folder = Path(tempfile.mkdtemp(prefix=_prefix(purpose, place), dir=place))
    lock = _held(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def delete_leftovers(purpose: str, place: Path) -> None:
    """Remove the folders for a purpose whose processes were killed."""
    if not LOCKS:
        return
    made = re.compile(re.escape(_prefix(purpose, place)) + r"[a-z0-9_]{8}")  # as `tempfile.mkdtemp` names them
    with contextlib.suppress(OSError):
        for entry in list(os.scandir(place)):
            with contextlib.suppress(OSError):
                if not made.fullmatch(entry.name) or not entry.is_dir(follow_symlinks=False):
                    continue
                status = entry.stat(follow_symlinks=False)
                if status.st_uid != os.getuid() or time.time() - status.st_mtime < YOUNG:
                    continue
                lock = _held(Path(entry.path))
                if lock is not None:
                    shutil.rmtree(entry.path, ignore_errors=True)
                    os.close(lock)


def _prefix(purpose: str, place: Path) -> str:
    """How the names begin; hidden where the user's own files are."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    hidden = "" if place == Path(tempfile.gettempdir()) else "."
    return f"{hidden}simnav-{purpose}-of-{user}-"


def _held(folder: Path) -> int | None:
    """A descriptor that holds the folder's lock; None where another process holds it, or there are no locks."""
    if not LOCKS:
        return None
    lock = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock
