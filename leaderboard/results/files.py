"""Files that are written completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import io
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

__all__ = ["FORMULA", "cell", "complete_file", "csv_text", "write_whole"]

#: Begin of a text that a spreadsheet would compute, as a regular expression; a text that is a number is no formula.
FORMULA = r"^[=+\-@\t\r]"


@contextlib.contextmanager
def complete_file(path: Path) -> Iterator[Path]:
    """A temporary path to write to, which is moved to its place at the end, so that a reader never sees a part of it.

    Each process has a path of its own, so that several may write the same file at the same time.

    Raises
    ------
    OSError
        If writing fails; an older file stays unchanged.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        if error.filename == str(partial):
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise
    finally:
        partial.unlink(missing_ok=True)


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file with `whole`.

    Raises
    ------
    OSError
        If writing fails; an older file stays unchanged.
    """
    with complete_file(path) as partial:
        partial.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    r"""Rows of values as a text of CSV; a text that a spreadsheet would compute is quoted (`cell`).

    >>> csv_text([("row", "score"), ("ekf", 1.5)])
    'row,score\nekf,1.5\n'
    """
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(cell, row) for row in rows)
    return text.getvalue()


def cell(value: object) -> object:
    """A value of a CSV file: a text that begins like a formula gets an apostrophe before it; numbers stay.

    >>> cell("=HYPERLINK(1)"), cell("-1.5"), cell(-1.5), cell("ekf")
    ("'=HYPERLINK(1)", '-1.5', -1.5, 'ekf')
    """
    if not isinstance(value, str) or value == "-" or not re.match(FORMULA, value):
        return value
    try:
        float(value)
    except ValueError:
        return f"'{value}"
    return value
