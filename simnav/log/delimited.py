"""Tables of numbers: any file with columns, separated by comma, semicolon, tab or blank, read once per process."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simnav.log.binary import refuse_binary
from simnav.log.files import FileSpec
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table, utc_seconds
from simnav.log.text_forms import form_of_text
from simnav.log.units import factor
from simnav.types import Array

__all__ = ["date_and_time", "read_csv", "rows_of"]

_DELIMITERS = (",", ";", "\t", " ")
_MISSING = ["", "nan", "NaN", "NAN", "NA", "null"]
_SOMETHING = re.compile(rb"\S")
_DECIMAL_COMMA = re.compile(rb'\s*"?[+-]?\d+,\d+(?:[eE][+-]?\d+)?"?\s*')
_DECIMAL_POINT = re.compile(rb'\s*"?[+-]?\d+\.\d+(?:[eE][+-]?\d+)?"?\s*')
#: So many bytes tell whether numbers have decimal commas.
_HEAD = 4096
#: Arrow's words for a cell that does not fit the type of its column: the number of the column, and the type.
_NOT_OF_TYPE = re.compile(r"In CSV column #(\d+): .*?conversion error to (\w+)", re.DOTALL)


@register_reader("csv", title="a table")
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    table = read_csv(path, file.comment)
    if len(table) <= file.skip_rows:
        raise LogError(f"{table.source}: {len(table)} rows, of which skip_rows = {file.skip_rows} leaves none")
    table = table.without_first(file.skip_rows)  # before anything is taken for a number: it may be a row of units
    return rows_of(table, file)


def rows_of(table: Table, file: FileSpec) -> Rows:
    """The rows of a table with the times of its time column, or of its columns of date and time of day.

    Raises
    ------
    LogError
        If there is no such column, or a cell is no time.
    """
    if isinstance(file.time, tuple):
        date, clock = (table.resolve(c)[1] for c in file.time)
        return Rows(table, date_and_time(table, date, clock), f"{date} {clock}", first=file.skip_rows)
    _, column = table.resolve(file.time)
    return Rows(table, _time(table, file, column), column, first=file.skip_rows)


_DATE = re.compile(r"(\d{4})[-/.]?(\d{1,2})[-/.]?(\d{1,2})(?:\.0)?")
_TIME_OF_DAY = re.compile(r"(\d{1,2}):?(\d{2}):?(\d{2}(?:\.\d*)?)Z?")


def date_and_time(table: Table, date: str, clock: str) -> Array:
    """Seconds since 1970 from a column of dates and one of times of day, both in UTC.

    Dates are like ``2024-05-01``, ``2024/05/01`` or ``20240501``, times like ``10:00:00.25`` or ``100000.25``.

    Raises
    ------
    LogError
        If a cell is neither.
    """
    days: dict[str, float] = {}
    out = np.empty(len(table))
    dates, clocks = table.columns[date], table.columns[clock]
    packed = clocks.dtype != object  # 1.5 is 00:00:01.5: leading zeros are lost
    for k in range(len(table)):
        day = str(dates[k]).strip()
        if day not in days:
            match = _DATE.fullmatch(day)
            try:
                year, month, first = (int(x) for x in match.groups()) if match else (0, 0, 0)
                days[day] = datetime(year, month, first, tzinfo=UTC).timestamp()
            except ValueError:
                raise LogError(
                    f"{table.source}, line {table.line[k]}, column {date!r}: {day!r} is not a date like 2024-05-01, "
                    "2024/05/01 or 20240501"
                ) from None
        text = f"{clocks[k]:013.6f}" if packed and np.isfinite(clocks[k]) else str(clocks[k]).strip()
        match = _TIME_OF_DAY.fullmatch(text)
        if match is None or int(match[1]) > 23 or int(match[2]) > 59 or float(match[3]) >= 61.0:
            raise LogError(
                f"{table.source}, line {table.line[k]}, column {clock!r}: {text!r} is not a time of day like "
                "10:00:00.25 or 100000.25"
            )
        out[k] = days[day] + 3600.0 * int(match[1]) + 60.0 * int(match[2]) + float(match[3])
    return out


def _time(table: Table, file: FileSpec, column: str) -> Array:
    if file.time_unit != "iso":
        sign, values = table.column(column)
        return sign * values * factor(file.time_unit)
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


@kept(64)
def read_csv(path: Path, comment: str = "") -> Table:
    """Read a table of numbers with or without a header, separated by comma, semicolon, tab or blank.

    With semicolons or tabs between them, numbers may have a decimal comma. The result is kept for the life of the
    process, as long as the file does not change.

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
    import pyarrow as pa

    refuse_binary(path, "csv")
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
    if delimiter == "," and ";" in first and all(_is_number(c.replace(",", ".", 1)) for c in first.split(";")):
        delimiter = ";"  # numbers with decimal commas
    blanks = delimiter == " "
    cells = [c.strip().strip('"') for c in (first.split() if blanks else first.split(delimiter))]
    header = not any(_is_number(c.replace(",", ".", 1)) for c in cells)
    names = cells if header else [str(i) for i in range(1, len(cells) + 1)]
    if len(set(names)) != len(names):
        raise LogError(f"{path}, line {blank + 1}: two columns share a name: {', '.join(names)}")
    begin = blank + int(header)  # lines before the data
    start = 0
    for _ in range(begin):
        start = content.find(b"\n", start) + 1 or len(content)
    end = _end_of_rows(content, start, path, delimiter, len(names), mark)
    if not _SOMETHING.search(content, start, end):
        raise LogError(f"{path}: there are no rows of data")
    numbers: NDArray[np.int64] | None = None
    commas = _decimal_commas(content[start : min(end, start + _HEAD)], delimiter)
    rows = pa.py_buffer(content).slice(start, end - start)
    if blanks or comment:  # columns may be lined up with any number of blanks
        lines = enumerate(content[start:end].split(b"\n"), begin + 1)
        kept = [(n, line) for n, line in lines if not _marked(line, mark)]
        rows = pa.py_buffer(b"\n".join(b" ".join(line.split()) if blanks else line for _, line in kept))
        numbers = np.array([n for n, _ in kept], dtype=np.int64)
    try:
        data = _parsed(rows, names, delimiter, "," if commas else ".")
    except (pa.ArrowInvalid, pa.ArrowKeyError) as error:
        lines = enumerate(content.split(b"\n")[begin:], begin + 1)
        kept = [(n, line) for n, line in lines if not _marked(line, mark)]
        what = " ".join(str(error).split())[:200]
        raise LogError(
            _ragged(path, kept, delimiter, len(names))
            or f"{path}: {what} (is there a quotation mark that is not closed?)"
        ) from None
    del content, rows
    while data.num_rows and all(c[-1].as_py() is None for c in data.columns):  # empty lines at the end
        data = data.slice(0, data.num_rows - 1)
    columns: dict[str, NDArray[np.float64] | NDArray[np.object_]] = {}
    count = data.num_rows
    for name in names:
        column = data.column(name)
        data = data.drop_columns([name])  # so that no more than one is there twice
        if pa.types.is_integer(column.type) or pa.types.is_floating(column.type) or pa.types.is_null(column.type):
            columns[name] = np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
        else:
            columns[name] = np.array([None if c is None else str(c) for c in column.to_pylist()], dtype=object)
    if count == 0:
        raise LogError(f"{path}: there are no rows of data")
    if numbers is None:
        numbers = np.arange(begin + 1, begin + 1 + count)
    return Table(str(path), columns, numbers[:count])


def _decimal_commas(head: bytes, delimiter: str) -> bool:
    """Whether the numbers of the first rows have a comma before their fraction, and none a point."""
    if delimiter not in (";", "\t"):
        return False
    cells = [cell for line in head.split(b"\n")[:6] for cell in line.strip().split(delimiter.encode())]
    return any(map(_DECIMAL_COMMA.fullmatch, cells)) and not any(map(_DECIMAL_POINT.fullmatch, cells))


def _parsed(rows: Any, names: Sequence[str], delimiter: str, decimal: str) -> Any:
    """The columns of a buffer of rows, as a table of pyarrow.

    Arrow takes the type of a column from its first megabyte. Where a later cell does not fit, the column is read again
    as numbers with a fraction, and then as text.
    """
    import pyarrow as pa
    from pyarrow import csv

    types: dict[str, Any] = {}
    while True:
        try:
            return csv.read_csv(
                pa.BufferReader(rows),
                read_options=csv.ReadOptions(column_names=list(names), use_threads=False),
                parse_options=csv.ParseOptions(delimiter=delimiter, ignore_empty_lines=False),
                convert_options=csv.ConvertOptions(
                    null_values=_MISSING,
                    strings_can_be_null=True,
                    column_types=types or None,
                    decimal_point=decimal,
                ),
            )
        except pa.ArrowInvalid as error:
            found = _NOT_OF_TYPE.search(str(error))
            if found is None or types.get(name := names[int(found[1])]) == pa.string():
                raise
            types[name] = pa.float64() if found[2] in ("int64", "null") and name not in types else pa.string()


def _end_of_rows(content: bytes, start: int, path: Path, delimiter: str, width: int, mark: bytes) -> int:
    """Where the rows end: before the last one if it has too few cells, since the logger was switched off meanwhile."""
    end = len(content)
    while end > start and content[end - 1] in b"\r\n":
        end -= 1
    cut = content.rfind(b"\n", start, end)
    last = content[cut + 1 : end]
    cells = len(last.split()) if delimiter == " " else last.count(delimiter.encode()) + 1
    alone = cut < start or not _SOMETHING.search(content, start, cut)
    if alone or not last.strip() or _marked(last, mark) or cells >= width:
        return len(content)
    warnings.warn(
        f"{path}: the last row has {cells} cells where the first line has {width}; it is incomplete, and left out",
        LogWarning,
        5,
    )
    return cut + 1


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
    """The content of a text file in UTF-8, which may have been in UTF-16 or in Latin-1; lines end in a line feed."""
    content = _decoded(path.read_bytes())
    return content if b"\n" in content else content.replace(b"\r", b"\n")  # the ends of lines of old systems


def _decoded(content: bytes) -> bytes:
    if content.isascii():
        return content
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
            form = form_of_text(path)
            right = (
                "lines that are no data are left out by 'comment', the mark that they begin with"
                if form is None
                else f"it looks like a file of format = {form!r}"
            )
            return f"{path}, line {number}: {count} cells where the first line has {width}; {right}"
    return ""
