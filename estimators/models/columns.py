"""Columns of the factors and nodes of a window: arrays whose rows come at the end and leave at the front."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["Columns"]


class Columns(dict[str, Any]):
    """Named columns of equal length; rows are appended at the end and dropped at the front.

    An item is a view of a column, (rows, ...). Views are kept until the number of rows changes.

    Parameters
    ----------
    **columns : tuple of int, or dtype
        Shape of a row's float64 entry, or the type of a scalar.

    Examples
    --------
    >>> c = Columns(time=(), value=(2,))
    >>> for t in range(3):
    ...     c.append(time=t, value=(t, -t))
    >>> c.drop(1)
    >>> c["time"].tolist(), c["value"][0].tolist()
    ([1.0, 2.0], [1.0, -1.0])
    """

    def __init__(self, **columns: Any):
        self._capacity = 64
        self._columns: dict[str, Any] = {}
        self._first = self._last = 0
        self.add(**columns)

    def add(self, **columns: Any) -> None:
        """More columns; the rows that there are have zeros in them."""
        for name, what in columns.items():
            shape, dtype = ((self._capacity, *what), float) if isinstance(what, tuple) else ((self._capacity,), what)
            self._columns[name] = np.zeros(shape, dtype)

    def __len__(self) -> int:
        return self._last - self._first

    def __missing__(self, name: str) -> Any:
        view = self[name] = self._columns[name][self._first : self._last]
        return view

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (vars(self),)  # copies have views of their own

    def newest(self, name: str) -> Any:
        """A view of the last row's entry in a column."""
        return self._columns[name][self._last - 1]

    def append(self, **values: Any) -> None:
        """Add a row; what is not given keeps any value."""
        if self._last == self._capacity:
            self._make_room()
        for name, value in values.items():
            self._columns[name][self._last] = value
        self._last += 1
        self.clear()

    def append_rows(self, count: int, **values: Any) -> None:
        """Add rows with given entries, or one entry for all; what is not given keeps any value."""
        if self._last + count > self._capacity:
            self._make_room(count)
        for name, value in values.items():
            self._columns[name][self._last : self._last + count] = value
        self._last += count
        self.clear()

    def drop(self, count: int) -> None:
        """Take ``count`` rows off the front."""
        self._first += count
        self.clear()

    def drop_newest(self, count: int) -> None:
        """Take ``count`` rows off the end."""
        self._last -= count
        self.clear()

    def _make_room(self, count: int = 1) -> None:
        """Move the rows to the front; more space where they fill more than half of it, or more rows do not fit."""
        rows, grown = len(self), self._capacity
        while 2 * rows > grown or rows + count > grown:
            grown *= 2
        for name, column in self._columns.items():
            if grown > self._capacity:
                new = np.zeros((grown, *column.shape[1:]), column.dtype)
                new[:rows] = column[self._first : self._last]
                self._columns[name] = new
            else:
                column[:rows] = column[self._first : self._last].copy()
        self._capacity, self._first, self._last = grown, 0, rows


def _restored(state: dict[str, Any]) -> Columns:
    columns = Columns()
    vars(columns).update(state)
    return columns
