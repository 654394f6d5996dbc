"""What an estimator prints in this process: its first lines, and how many more there were.

An estimator that prints at every epoch would bury the report that it was run for.
"""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Iterator
from typing import TextIO

__all__ = ["LINES", "first_lines"]

#: Lines of an estimator that are shown.
LINES = 20


class _FirstLines(io.TextIOBase):
    """Passes the first lines on to a stream, and counts the others."""

    def __init__(self, stream: TextIO):
        self._stream, self.lines = stream, 0

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        for line in text.splitlines(keepends=True):
            if self.lines < LINES:
                self._stream.write(line)
            self.lines += line.endswith("\n")
        return len(text)

    def flush(self) -> None:
        self._stream.flush()


@contextlib.contextmanager
def first_lines(estimator: str) -> Iterator[None]:
    """Within this context only the first `LINES` lines that are printed are shown; a warning says how many there were.

    Parameters
    ----------
    estimator : str
        Label of the estimator that runs.
    """
    shown = _FirstLines(sys.stdout)
    try:
        with contextlib.redirect_stdout(shown):
            yield
    finally:
        if shown.lines > LINES:
            what = f"{estimator} printed {shown.lines} lines; the first {LINES} are shown"
            warnings.warn(what, UserWarning, stacklevel=3)
