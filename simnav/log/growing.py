"""A table that grows row by row, in arrays of numbers: a long log takes eight bytes a value."""

from __future__ import annotations

import math
import sys
from array import array
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from simnav.log.table import Table

__all__ = ["GrowingTable"]


class GrowingTable:
    """Rows of named values, which a reader adds one by one.

    Attributes
    ----------
    line : array of int
        Line, or number, of each row in the file.
    """

    def __init__(self) -> None:
        self.line = array("q")
        self._columns: dict[str, array[float] | list[str | None]] = {}

    def __len__(self) -> int:
        return len(self.line)

    def add(self, row: Mapping[str, float | str], line: int) -> None:
        """Add a row; a value that it lacks, or that earlier rows lack, is missing there.

        Parameters
        ----------
        row : mapping of str to float or str
            Values by the name of their column. A column holds either numbers or text.
        line : int
            Line of the row in the file.
        """
        n = len(self.line)
        for name, value in row.items():
            column = self._columns.get(name)
            if column is None:
                column = [None] * n if isinstance(value, str) else array("d", [math.nan]) * n
                self._columns[name] = column
            if isinstance(column, list):
                column.append(sys.intern(value) if isinstance(value, str) else None)
            else:
                column.append(math.nan if isinstance(value, str) else value)
        if len(row) < len(self._columns):
            for column in self._columns.values():
                if len(column) == n:
                    column.append(None) if isinstance(column, list) else column.append(math.nan)
        self.line.append(line)

    def table(self, source: str) -> Table:
        """The rows so far as a table without numbered columns."""
        columns: dict[str, NDArray[np.float64] | NDArray[np.object_]] = {}
        for name, column in self._columns.items():
            if isinstance(column, list):
                columns[name] = np.array(column, dtype=object)
            else:
                columns[name] = np.array(column, dtype=np.float64)
        return Table(source, columns, np.array(self.line, dtype=np.int64), numbered=False)
