"""Reading a log file into named columns, once per process.

A `Table` has float columns and knows the line of each row in the file, so that every complaint can name it.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.spec import SpecError, closest
from simnav.types import Array

__all__ = ["LogError", "LogWarning", "Table", "check_ascending", "read_csv"]

_DELIMITERS = (",", ";", "\t", " ")
_MISSING = ["", "nan", "NaN", "NAN", "NA", "null"]


class LogError(SpecError):
    """A log that cannot be used; the message names file, line and column."""


class LogWarning(UserWarning):
    """Something in a log was left out; the message counts it and names the first place."""


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of one file, or of the sentences of one type in an NMEA file.

    Attributes
    ----------
    source : str
        For messages: the file, and the sentence.
    columns : dict of str to array
        Numbers, or text as objects. A missing cell is NaN.
    line : (n,) int array
        Line of each row in the file, from 1.
    numbered : bool
        True where columns may also be given by number.
    """

    source: str
    columns: dict[str, NDArray[np.float64] | NDArray[np.object_]]
    line: NDArray[np.int64]
    numbered: bool = True
    names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "names", tuple(self.columns))

    def __len__(self) -> int:
        return len(self.line)

    def column(self, which: int | str) -> tuple[float, Array]:
        """Sign and values of a column.

        Parameters
        ----------
        which : int or str
            Name, or number from 1; a minus flips the sign. ``"=x"`` is the constant x.

        Raises
        ------
        LogError
            If there is no such column, or it has a cell that is not a number.
        """
        if isinstance(which, str) and which.startswith("="):
            try:
                return 1.0, np.full(len(self), float(which[1:]))
            except ValueError:
                raise LogError(f"{self.source}: the constant column {which!r} should be '=' and a number") from None
        sign, name = self.resolve(which)
        values = self.columns[name]
        return sign, values.astype(np.float64, copy=False) if values.dtype != object else self._numbers(name)

    def resolve(self, which: int | str) -> tuple[float, str]:
        """Sign and name of a column given by name or number."""
        if isinstance(which, int):
            if not self.numbered:
                raise LogError(f"{self.source}: column {which} by number; NMEA has names: {', '.join(self.names)}")
            if not 1 <= abs(which) <= len(self.names):
                raise LogError(
                    f"{self.source}: there is no column {which}; the file has columns 1 to {len(self.names)}"
                )
            return (-1.0 if which < 0 else 1.0), self.names[abs(which) - 1]
        if which in self.columns:
            return 1.0, which
        if which.startswith("-") and which[1:] in self.columns:
            return -1.0, which[1:]
        raise LogError(f"{self.source}: there is no column {which.removeprefix('-')!r}{closest(which, self.names)}")

    def without_first(self, count: int) -> Table:
        """The table without its first rows."""
        return Table(self.source, {n: c[count:] for n, c in self.columns.items()}, self.line[count:], self.numbered)

    def _numbers(self, name: str) -> Array:
        """A text column as numbers; the first cell that is none is named."""
        out = np.empty(len(self))
        for k, cell in enumerate(self.columns[name]):
            try:
                out[k] = np.nan if cell is None else float(cell)
            except (TypeError, ValueError):
                raise LogError(
                    f"{self.source}, line {self.line[k]}, column {name!r}: {cell!r} is not a number"
                ) from None
        return out


def check_ascending(time: Array, table: Table, column: str) -> None:
    """Raise `LogError` where times do not ascend."""
    bad = np.flatnonzero(~(np.diff(time) > 0.0))
    if bad.size:
        k = int(bad[0]) + 1
        if not np.isfinite(time[k]) or not np.isfinite(time[k - 1]):
            k = k if not np.isfinite(time[k]) else k - 1
            raise LogError(f"{table.source}, line {table.line[k]}, column {column!r}: the time is missing")
        what = "is the same as" if time[k] == time[k - 1] else "is before"
        raise LogError(
            f"{table.source}, line {table.line[k]}, column {column!r}: the time {what} that of line "
            f"{table.line[k - 1]} ({time[k]:.6f} s after {time[k - 1]:.6f} s); sort the file and drop duplicates"
        )


def read_csv(path: Path, comment: str = "") -> Table:
    """Read a table of numbers with or without a header, separated by comma, semicolon, tab or blank.

    The result is kept for the life of the process, as long as the file does not change.

    Parameters
    ----------
    path : Path
        The file: text in UTF-8, UTF-16 or Latin-1.
    comment : str
        Lines that begin with it are left out, wherever they stand.

    Raises
    ------
    LogError
        If the file is absent or empty, or its rows differ in length.
    """
    try:
        status = os.stat(path)
    except OSError:
        raise LogError(f"{path}: there is no such file") from None
    try:
        return _read_csv(path, comment, status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise LogError(f"{path} cannot be read: {error.strerror}") from None


@lru_cache(maxsize=64)
def _read_csv(path: Path, comment: str, _mtime: int, _size: int) -> Table:
    import pyarrow as pa
    from pyarrow import csv

    content, mark = _utf8(path), comment.encode()
    first, blank = "", 0
    for raw in io.BytesIO(content):
        if raw.strip() and not _marked(raw, mark):
            first = raw.decode()
            break
        blank += 1
    first = first.strip("\r\n")
    if not first.strip():
        raise LogError(f"{path}: the file is empty")
    delimiter = next((d for d in _DELIMITERS if d in first), ",")
    blanks = delimiter == " "
    cells = [c.strip().strip('"') for c in (first.split() if blanks else first.split(delimiter))]
    header = not any(_is_number(c) for c in cells)
    names = cells if header else [str(i) for i in range(1, len(cells) + 1)]
    if len(set(names)) != len(names):
        raise LogError(f"{path}, line {blank + 1}: two columns share a name: {', '.join(names)}")
    begin = blank + int(header)  # lines before the data
    text = b"".join(content.split(b"\n", begin)[begin:])
    if not text.strip():
        raise LogError(f"{path}: there are no rows of data")
    numbers: NDArray[np.int64] | None = None
    if blanks or comment:  # columns may be lined up with any number of blanks
        kept = [(n, line) for n, line in enumerate(text.split(b"\n"), begin + 1) if not _marked(line, mark)]
        text = b"\n".join(b" ".join(line.split()) if blanks else line for _, line in kept)
        numbers = np.array([n for n, _ in kept], dtype=np.int64)
    try:
        data = csv.read_csv(
            io.BytesIO(text),
            read_options=csv.ReadOptions(column_names=names, use_threads=False),
            parse_options=csv.ParseOptions(delimiter=delimiter, ignore_empty_lines=False),
            convert_options=csv.ConvertOptions(null_values=_MISSING, strings_can_be_null=True),
        )
    except (pa.ArrowInvalid, pa.ArrowKeyError) as error:
        lines = enumerate(content.split(b"\n")[begin:], begin + 1)
        kept = [(n, line) for n, line in lines if not _marked(line, mark)]
        raise LogError(_ragged(path, kept, delimiter, len(names)) or f"{path}: {error}") from None
    while data.num_rows and all(c[-1].as_py() is None for c in data.columns):  # empty lines at the end
        data = data.slice(0, data.num_rows - 1)
    columns: dict[str, NDArray[np.float64] | NDArray[np.object_]] = {}
    for name in names:
        column = data.column(name)
        if pa.types.is_integer(column.type) or pa.types.is_floating(column.type) or pa.types.is_null(column.type):
            columns[name] = np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)
        else:
            columns[name] = np.array([None if c is None else str(c) for c in column.to_pylist()], dtype=object)
    if data.num_rows == 0:
        raise LogError(f"{path}: there are no rows of data")
    if numbers is None:
        numbers = np.arange(begin + 1, begin + 1 + data.num_rows)
    return Table(str(path), columns, numbers[: data.num_rows])


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _marked(line: bytes, mark: bytes) -> bool:
    """Whether a line is a comment."""
    return bool(mark) and line.lstrip().startswith(mark)


def _utf8(path: Path) -> bytes:
    """The content of a text file in UTF-8, which may have been in UTF-16 or in Latin-1."""
    content = path.read_bytes()
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        with contextlib.suppress(UnicodeDecodeError):
            return content.decode("utf-16").encode()
    try:
        return content.decode("utf-8-sig").encode()
    except UnicodeDecodeError:
        return content.decode("latin-1").encode()


def _ragged(path: Path, lines: Iterable[tuple[int, bytes]], delimiter: str, width: int) -> str:
    """The sentence for the first line whose number of cells is not that of the first."""
    for number, raw in lines:
        line = raw.decode().rstrip("\r")
        count = len(line.split()) if delimiter == " " else line.count(delimiter) + 1
        if line.strip() and count != width:
            return (
                f"{path}, line {number}: {count} cells where the first line has {width}; lines that are no data are "
                "left out by 'comment', the mark that they begin with"
            )
    return ""
