"""The folder of what simnav keeps between processes: compiled kernels, and the list of its estimators."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import tempfile
from pathlib import Path

__all__ = ["cache_directory"]


def cache_directory() -> Path | None:
    """The directory of compiled kernels.

    It is the first of these that can be written to: ``$SIMNAV_CACHE_DIR``; the user's cache directory; a private
    directory among the temporary files.

    Returns
    -------
    Path or None
        None if none of them can be written to: kernels are then compiled in every process.
    """
    return _cache_directory(os.environ.get("SIMNAV_CACHE_DIR", ""), os.environ.get("XDG_CACHE_HOME", ""))


@functools.lru_cache
def _cache_directory(chosen: str, xdg: str) -> Path | None:
    candidates = [Path(chosen).expanduser()] if chosen else []
    with contextlib.suppress(RuntimeError):  # no home directory
        if sys.platform == "darwin":
            candidates.append(Path.home() / "Library" / "Caches" / "simnav")
        elif os.name == "nt":
            candidates.append(Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "simnav")
        else:
            candidates.append((Path(xdg) if xdg else Path.home() / ".cache") / "simnav")
    user = str(os.getuid()) if hasattr(os, "getuid") else "user"
    with contextlib.suppress(OSError):  # no directory for temporary files
        candidates.append(Path(tempfile.gettempdir()) / f"simnav-{user}")
    for candidate in candidates:
        path = candidate / "kernels"
        with contextlib.suppress(OSError):
            path.mkdir(parents=True, exist_ok=True, mode=0o700)
            # The cache is unpickled, so it must be ours. (For root, permissions alone prove nothing: write.)
            if not hasattr(os, "getuid") or path.stat().st_uid == os.getuid():
                with tempfile.TemporaryFile(dir=path):
                    return path
    return None
