"""Text files of numbers without names, and binary files of doubles, whose columns a format names."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from simnav.log.binary import refuse_binary, signature
from simnav.log.delimited import read_csv
from simnav.log.table import LogError, LogWarning, Table

__all__ = ["named_columns", "records"]


def named_columns(path: Path, form: str, names: Sequence[str], comment: str = "#") -> Table:
    """A table whose columns get the names of a format.

    Parameters
    ----------
    path : Path
        A text file of numbers; a header is allowed, and not read.
    form : str
        The format, for messages.
    names : sequence of str
        Of the columns.
    comment : str
        Lines that begin with it are left out.

    Raises
    ------
    LogError
        If the file has another number of columns, or a cell is no number.
    """
    refuse_binary(path, form)
    table = read_csv(path, comment)
    if len(table.names) != len(names):
        raise LogError(f"{path}: {len(table.names)} columns; format = {form!r} has {len(names)}: {', '.join(names)}")
    columns = {new: table.column(old)[1] for new, old in zip(names, table.names, strict=True)}
    return Table(table.source, dict(columns), table.line)


def records(path: Path, form: str, names: Sequence[str]) -> Table:
    """A table of records of doubles, little-endian; the line of a row is the number of its record.

    An incomplete record at the end is left out, with a warning.

    Raises
    ------
    LogError
        If the file has no record, or its numbers are not sensible.
    """
    content = path.read_bytes()
    size = 8 * len(names)
    if signature(path) is None:
        raise LogError(f"{path}: it is text, and no binary file as format = {form!r} wants")
    whole = len(content) // size * size
    if not whole:
        raise LogError(
            f"{path}: {len(content)} bytes are no record of {size} bytes ({len(names)} doubles), as format = {form!r} "
            "has them"
        )
    values = np.frombuffer(content[:whole], dtype="<f8").reshape(-1, len(names))
    bad = np.flatnonzero(~(np.abs(values) < 1e15).all(axis=1))
    if bad.size:
        i = int(np.flatnonzero(~(np.abs(values[bad[0]]) < 1e15))[0])
        raise LogError(
            f"{path}, record {bad[0] + 1} (offset {bad[0] * size}): {names[i]} = {values[bad[0], i]:g} is no sensible "
            f"number; is the file of format = {form!r}?"
        )
    if whole < len(content):
        warnings.warn(
            f"{path}: the last record, at offset {whole}, has {len(content) - whole} bytes where format = {form!r} has "
            f"{size} ({len(names)} doubles); it is incomplete, and left out",
            LogWarning,
            5,
        )
    columns = {name: values[:, i].astype(np.float64) for i, name in enumerate(names)}
    return Table(str(path), dict(columns), np.arange(1, len(values) + 1))
