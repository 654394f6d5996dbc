"""Files that are written completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["write_whole"]


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a temporary file and move it to its place, so that a reader never sees a part of it.

    Raises
    ------
    OSError
        As of writing; an older file stays as it was.
    """
    partial = path.with_name(f".{path.name}.part")
    partial.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(partial, path)
    return path
