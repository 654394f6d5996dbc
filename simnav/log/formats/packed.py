"""Records of a binary log whose layout the log itself describes: fields by name, each kind of record as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simnav.log.files import FileSpec
from simnav.log.reader import Rows
from simnav.log.table import LogError, Table
from simnav.spec import closest
from simnav.types import Array

__all__ = ["Field", "messages_of", "rows_of_message", "topic_of"]


@dataclass(frozen=True)
class Field:
    """A number in a record.

    Attributes
    ----------
    name : str
        Its column.
    kind : str
        Type of NumPy, such as ``<f4``.
    offset : int
        Where in the record it begins [bytes].
    factor : float
        Multiplies it.
    """

    name: str
    kind: str
    offset: int
    factor: float = 1.0


def messages_of(source: str, content: bytes, begins: Sequence[int], fields: Sequence[Field]) -> Table:
    """The records of one kind as a table; the line of a row is the offset of its record in the file.

    Parameters
    ----------
    source : str
        For messages.
    content : bytes
        The file.
    begins : sequence of int
        Where the records begin; each is whole.
    fields : sequence of Field
        Their numbers.
    """
    data, at = np.frombuffer(content, dtype=np.uint8), np.asarray(begins, dtype=np.int64)
    columns: dict[str, Array] = {}
    for field in fields:
        size = np.dtype(field.kind).itemsize
        raw = np.ascontiguousarray(data[(at + field.offset)[:, None] + np.arange(size)])
        values = raw.view(field.kind)[:, 0].astype(np.float64)
        with np.errstate(invalid="ignore", over="ignore"):  # signalling NaNs of a damaged record
            columns[field.name] = values * field.factor
    return Table(source, dict(columns), at, numbered=False)


def topic_of(name: str, instance: int) -> str:
    """The name of a table: that of its messages, and in brackets the number of the instrument if it is not the first.

    Examples
    --------
    >>> topic_of("IMU", 0), topic_of("IMU", 1)
    ('IMU', 'IMU[1]')
    """
    return f"{name}[{instance}]" if instance else name


def rows_of_message(
    path: Path, tables: Mapping[str, Table], file: FileSpec, sentence: str | None, clock: str, unit: float
) -> Rows:
    """The rows of the messages that a channel, or ``options.topic`` of the file, names.

    Parameters
    ----------
    path, file, sentence
        As a reader gets them.
    tables : mapping of str to Table
        All messages of the file, by their names.
    clock : str
        Column of the times.
    unit : float
        Of the times [s].

    Raises
    ------
    LogError
        If no messages are named, there are none of this name, or they have no times.
    """
    topic = sentence or file.options.get("topic")
    if topic is None:
        raise LogError(f"{path}: say which messages (sentence); there are: {', '.join(sorted(tables))}")
    table = tables.get(str(topic))
    if table is None:
        raise LogError(f"{path}: there are no messages {topic!r}{closest(str(topic), list(tables))}")
    if clock not in table.columns:
        raise LogError(f"{table.source}: its messages have no {clock}, so their times are not known")
    time = table.column(clock)[1] * unit
    # A receiver that lost its fix is logged again with its last time.
    counts: NDArray[np.int64] = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    return Rows(table, time, clock, counts)
