"""Files in the user's cache: what takes long to compute, and can be computed again at any time."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from .files import write_whole

__all__ = ["keep", "user_cache"]


def user_cache() -> Path:
    """Folder of simnav in the user's cache; it may not be there yet."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(home) if os.path.isabs(home) else Path.home() / ".cache") / "simnav"


def keep(path: Path, content: str | bytes) -> None:
    """Write a file of the cache, if that is possible: a cache that cannot be written costs time only."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content)
