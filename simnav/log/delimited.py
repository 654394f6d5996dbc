"""Tables of numbers: any file with columns, separated by comma, semicolon, tab or blank, read once per process."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.log.files import FileSpec
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, Table, utc_seconds
from simnav.log.units import LOG_UNITS
from simnav.types import Array

__all__ = ["read_csv"]

_DELIMITERS = (",", ";", "\t", " ")
_MISSING = ["", "nan", "NaN", "NAN", "NA", "null"]


@register_reader("csv", title="a table")
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    table = read_csv(path, file.comment)
    if len(table) <= file.skip_rows:
        raise LogError(f"{table.source}: {len(table)} rows, of which skip_rows = {file.skip_rows} leaves none")
    table = table.without_first(file.skip_rows)  # before anything is taken for a number: it may be a row of units
    _, column = table.resolve(file.time)
    return Rows(table, _time(table, file, column), column, first=file.skip_rows)


def _time(table: Table, file: FileSpec, column: str) -> Array:
    if file.time_unit != "iso":
        sign, values = table.column(file.time)
        return sign * values * LOG_UNITS[file.time_unit]
    moments = np.empty(len(table))
    for k, cell in enumerate(table.columns[column]):
        try:
            moments[k] = utc_seconds(str(cell))
        except ValueError:
            raise LogError(
                f"{table.source}, line {table.line[k]}, column {column!r}: {cell!r} is not a date like "
                f"2014-08-01T00:00:00.124Z"
            ) from None
    return moments


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
