"""The names and summaries of the estimators, kept between commands.

To import all estimators takes longer than everything else that ``simnav list`` does. What it shows of them is kept in a
file of the cache (`simnav.cache_folder`) with the state of the files that it comes from. Where another package or a
plug-in may have registered estimators, they are all imported.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import simnav
from simnav.cache_folder import cache_directory
from simnav.plugins import entry_points

__all__ = ["Summary", "summaries"]


class Summary(NamedTuple):
    """What a list shows of an estimator: ``reference`` is true if it is told the truth."""

    name: str
    summary: str
    reference: bool


def summaries() -> list[Summary]:
    """Every registered estimator, by name."""
    folder = cache_directory() if _only_own() else None
    if folder is None:
        return _imported()
    path, state = folder.parent / "estimators.json", _state()
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["state"] == state:
            return [Summary(str(name), str(said), bool(told)) for name, said, told in kept["estimators"]]
    found = _imported()
    with contextlib.suppress(OSError):  # a full disk must not stop the command
        _write(path, json.dumps({"state": state, "estimators": found}))
    return found


def _imported() -> list[Summary]:
    from simnav.estimator import describe, names

    return [Summary(d.name, d.summary, d.reference) for d in map(describe, names())]


def _only_own() -> bool:
    """Whether nobody else can have registered an estimator: no plug-in of this command, and no other package."""
    if "simnav.estimator.registry" in sys.modules:
        return False
    return all(p.dist is not None and p.dist.name == "simnav" for p in entry_points("simnav.estimators"))


def _state() -> str:
    """Hash of the paths, sizes and times of the files that define the estimators."""
    home = Path(simnav.__file__).parent
    found = [sys.implementation.cache_tag, *_files(home / "estimators"), *_files(home / "estimator")]
    return hashlib.blake2b("\n".join(map(str, found)).encode(errors="replace"), digest_size=8).hexdigest()


def _files(folder: Path) -> Iterator[str]:
    for entry in sorted(os.scandir(folder), key=lambda e: e.name):
        if entry.is_dir():
            yield from _files(Path(entry.path))
        elif entry.name.endswith(".py"):
            state = entry.stat()
            yield f"{entry.path} {state.st_mtime_ns} {state.st_size}"


def _write(path: Path, text: str) -> None:
    """Write a file whole: another command may read it at the same time."""
    handle, beside = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(beside, path)
    except BaseException:
        os.unlink(beside)
        raise
