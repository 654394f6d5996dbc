"""Readers of log files: one function for each format, of simnav or of others (``docs/how-to/add-a-format.md``)."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from simnav.log.files import FileSpec
from simnav.log.table import LogError, Table
from simnav.plugins import Registry, exception_of, place_of
from simnav.types import Array

__all__ = ["READERS", "Reader", "Rows", "register_reader"]


@dataclass(frozen=True, eq=False)
class Rows:
    """What a reader found in a file.

    Attributes
    ----------
    table : Table
        The columns, and the line (or number) of each row in the file.
    time : (n,) array
        Time of each row on the clock of the file [s], before ``scale`` and ``offset`` of the file are applied.
    clock : str
        Where the times come from, for messages: the name of a column.
    counts : (m,) int array or None
        Indices of the rows that count, ascending; None: all.
    first : int
        Number of rows that were left out before the first one, for files whose rows have a fixed spacing.
    """

    table: Table
    time: Array
    clock: str
    counts: NDArray[np.int64] | None = None
    first: int = 0

    def __post_init__(self) -> None:
        time = np.asarray(self.time, dtype=np.float64)
        if time.shape != (len(self.table),):
            raise ValueError(f"{time.shape} times for {len(self.table)} rows")
        object.__setattr__(self, "time", time)


#: Reads a file: its path, its description, and the sentence and the talker that a channel wants (None: not given).
Read: TypeAlias = Callable[[Path, FileSpec, str | None, str | None], Rows]


class Reader:
    """The reader of a format.

    Attributes
    ----------
    name, title : str
        The ``format`` of files, and its name in messages.
    sentences : bool
        Whether a file has tables of several kinds, of which a channel names one (``sentence``). A channel may then
        leave out its columns.
    inertial : bool
        Whether an IMU may be in such a file.
    """

    def __init__(self, function: Read, name: str, title: str, sentences: bool, inertial: bool):
        # As a registered function has them; the place of the code is found through the last.
        self.__qualname__, self.__module__, self.__wrapped__ = function.__qualname__, function.__module__, function
        self.function, self.name, self.title = function, name, title
        self.sentences, self.inertial = sentences, inertial

    def read(self, path: Path, file: FileSpec, sentence: str | None = None, talker: str | None = None) -> Rows:
        """Read a file.

        Raises
        ------
        LogError
            If the file cannot be read. An exception in the code of a reader is one, too; the message names the reader.
        """
        try:
            rows = self.function(path, file, sentence, talker)
        except FileNotFoundError:
            raise LogError(f"{path}: there is no such file") from None
        except (LogError, MemoryError):
            raise
        except OSError as error:
            if not isinstance(error.filename, (str, bytes)) or Path(os.fsdecode(error.filename)) != path:
                raise LogError(f"{self._label(path)}: {exception_of(self.function, error)}") from error
            raise LogError(f"{path} cannot be read: {error.strerror}") from None
        except Exception as error:
            raise LogError(f"{self._label(path)}: {exception_of(self.function, error)}") from error
        if not isinstance(rows, Rows):
            raise LogError(f"{self._label(path)}: it returned {type(rows).__name__}, where Rows are wanted")
        if not len(rows.table):
            raise LogError(f"{path}: there are no rows of data")
        return rows

    def _label(self, path: Path) -> str:
        return f"{path}: reader {self.name!r} in {Path(place_of(self.function)[0]).name}"


READERS: Registry[Reader] = Registry("log reader", "simnav.log_readers", "simnav.log.formats", term="format")


def register_reader(
    name: str, *, title: str = "", sentences: bool = False, inertial: bool = True
) -> Callable[[Read], Reader]:
    """Register a function as the reader of a format of log files (decorator).

    Parameters
    ----------
    name : str
        The ``format`` in the table ``[log.files.NAME]``, in snake_case.
    title : str
        Its name in messages; by default the same.
    sentences, inertial : bool
        See `Reader`.

    Raises
    ------
    PluginError
        If the name is not in snake_case or another reader has it.
    """

    def wrap(function: Read) -> Reader:
        reader = Reader(function, name, title or name, sentences, inertial)
        READERS.add(name, reader)
        return reader

    return wrap
