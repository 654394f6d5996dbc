"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import io
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

__all__ = ["csv_text", "whole", "write_whole"]


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A temporary path to write to, which is moved to its place at the end, so that a reader never sees a part of it.

    Raises
    ------
    OSError
        If writing fails; an older file stays unchanged.
    """
    partial = path.with_name(f".{path.name}.part")
    try:
        yield partial
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file with `whole`.

    Raises
    ------
    OSError
        If writing fails; an older file stays unchanged.
    """
    with whole(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    r"""Rows of values as a text of CSV.

    >>> csv_text([("row", "score"), ("ekf", 1.5)])
    'row,score\nekf,1.5\n'
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
