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

from simnav.log.binary import refuse_binary, utf16_of
from simnav.log.files import FileSpec
from simnav.log.kept import kept
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError, LogWarning, Table, utc_seconds
from simnav.log.text_forms import form_of_text
from simnav.log.units import factor, units_row
from simnav.types import Array

__all__ = ["date_and_time", "lines_above", "read_csv", "rows_of"]

_DELIMITERS = (",", ";", "\t", " ")
_MISSING = ["", "nan", "NaN", "NAN", "NA", "null"]
_SOMETHING = re.compile(rb"\S")
_DECIMAL_COMMA = re.compile(rb'\s*"?[+-]?\d+,\d+(?:[eE][+-]?\d+)?"?\s*')
_DECIMAL_POINT = re.compile(rb'\s*"?[+-]?\d+\.\d+(?:[eE][+-]?\d+)?"?\s*')
#: So many bytes tell whether numbers have decimal commas.
_HEAD = 4096
#: So many lines show where a table begins, if so many of them are its header and rows.
_SEEN, _LEAST = 200, 4
#: Arrow's words for a cell that does not fit the type of its column: the number of the column, and the type.
_NOT_OF_TYPE = re.compile(r"In CSV column #(\d+): .*?conversion error to (\w+)", re.DOTALL)


@register_reader("csv", title="a table")
def _read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    return rows_of(read_csv(path, file.comment, file.skip_lines, file.skip_rows), file)


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
def read_csv(path: Path, comment: str = "", skip_lines: int = 0, skip_rows: int = 0) -> Table:
    """Read a table of numbers with or without a header, separated by comma, semicolon, tab or blank.

    With semicolons or tabs between them, numbers may have a decimal comma. The result is kept for the life of the
    process, as long as the file does not change.

    Parameters
    ----------
    path : Path
        The file: text in UTF-8, UTF-16 or Latin-1.
    comment : str
        Lines that begin with it are left out, wherever they stand.
    skip_lines, skip_rows : int
        Lines above the header, and rows below it, that are left out: see `simnav.log.files.FileSpec`.

    Raises
    ------
    LogError
        If the file is absent or empty, or its rows differ in length.
    """
    import pyarrow as pa

    refuse_binary(path, "csv")
    content, mark = _utf8(path), comment.encode()
    if nuls := content.count(b"\0"):
        line = content.count(b"\n", 0, content.index(b"\0")) + 1
        raise LogError(
            f"{path}, line {line}: it has {'a NUL byte' if nuls == 1 else f'the first of {nuls} NUL bytes'}, which a "
            "logger leaves that loses its power; take such lines out of the file"
        )
    below = io.BytesIO(content)
    first, blank = _next_line(below, mark, skip_lines)
    if not first.strip():
        raise LogError(f"{path}: the file is empty" + (f" below skip_lines = {skip_lines}" if skip_lines else ""))
    delimiter = _delimiter(first)
    blanks = delimiter == " "
    cells = _cells(first, delimiter)
    header = not any(map(_is_a_number, cells))
    names = cells if header else [str(i) for i in range(1, len(cells) + 1)]
    if len(set(names)) != len(names):
        raise LogError(f"{path}, line {blank + 1}: two columns share a name: {', '.join(names)}")
    begin = blank + int(header)  # lines before the data
    for _ in range(skip_rows):
        begin += _next_line(below, mark, 0, empty=True)[1] + 1
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


def lines_above(path: Path, comment: str = "") -> int | None:
    """How many lines of other text stand above the header of a table.

    The first lines of the file show the table by their number of cells: it reaches up from the last of them. Above its
    numbers must be a line of names, or no line with as many cells.

    Parameters
    ----------
    path : Path
        A file of text.
    comment : str
        Lines that begin with it do not count.

    Returns
    -------
    int or None
        0 also where it is not clear; None where no line looks like a row of a table.
    """
    mark = comment.encode()
    head = [line.decode() for line in _utf8(path).split(b"\n")[:_SEEN]]
    shown = [(n, line) for n, line in enumerate(head[:-1]) if line.strip() and not _marked(line.encode(), mark)]
    if not shown:
        return None
    delimiter = _delimiter(shown[-1][1])
    rows = [(n, _cells(line, delimiter)) for n, line in shown]
    width = len(rows[-1][1])
    if not any(len(cells) > 1 and any(map(_is_a_number, cells)) for _, cells in rows):
        return None
    first = next((k for k in range(len(rows) - 1, -1, -1) if len(rows[k][1]) != width), -1) + 1
    named = next((k for k in range(first, len(rows)) if any(map(_is_a_number, rows[k][1]))), len(rows))
    if width < 2 or len(rows) < _LEAST or len(rows) - named < _LEAST - 1:
        return 0
    texts = named - first  # names, a row of units, and a line above that has as many cells by chance
    if not texts:
        return 0 if any(len(cells) == width for _, cells in rows[:first]) else rows[first][0]
    of_units = texts > 1 and units_row(rows[named - 1][1]) is not None
    return rows[named - 1 - int(of_units)][0]


def _delimiter(line: str) -> str:
    """What separates the cells of a line."""
    found = next((d for d in _DELIMITERS if d in line.strip()), ",")
    if found == "," and ";" in line and all(map(_is_a_number, line.split(";"))):
        return ";"  # numbers with decimal commas
    return found


def _cells(line: str, delimiter: str) -> list[str]:
    return [c.strip().strip('"') for c in (line.split() if delimiter == " " else line.split(delimiter))]


def _next_line(lines: Iterable[bytes], mark: bytes, skip: int, *, empty: bool = False) -> tuple[str, int]:
    """The next line that counts, and how many stand before it."""
    before = 0
    for raw in lines:
        if before >= skip and (empty or raw.strip()) and not _marked(raw, mark):
            return raw.decode().strip("\r\n"), before
        before += 1
    return "", before


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


def _is_a_number(cell: str) -> bool:
    """Whether a cell is a number, also with a decimal comma."""
    try:
        float(cell.replace(",", ".", 1))
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
    codec = utf16_of(content)
    if codec is None and content.isascii():
        return content
    if codec is not None:
        with contextlib.suppress(UnicodeDecodeError):
            return content.decode(codec).encode()
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
            form, above = form_of_text(path), lines_above(path)
            right = (
                ("no header of a table is found; " if above is None else "")
                + "lines that are no data are left out by 'comment', the mark that they begin with"
                + (f"; the table seems to begin in line {above + 1}: write skip_lines = {above}" if above else "")
                if form is None
                else f"it looks like a file of format = {form!r}"
            )
            return f"{path}, line {number}: {count} cells where the first line has {width}; {right}"
    return ""
