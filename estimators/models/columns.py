"""Columns of the factors and nodes of a window: arrays whose rows come at the end and leave at the front."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from simnav.records import Record

__all__ = ["Columns", "Made"]

Kind = TypeVar("Kind", bound=Record)


class Made(dict[Any, Any]):
    """What is made of whole columns, by any key. A copy is empty, because it would refer to the arrays of the other.

    Attributes
    ----------
    rows : object
        Where the rows are, as long as it is so; else None.
    """

    rows: Any = None

    def __reduce__(self) -> tuple[Any, ...]:
        return Made, ()

    def once(self, kind: type[Kind], make: Callable[[], Kind]) -> Kind:
        """The record of a kind; it is made if there is none."""
        found: Kind | None = self.get(kind)
        if found is None:
            found = self[kind] = make()
        return found


class Columns(dict[str, Any]):
    """Named columns of equal length; rows are appended at the end and dropped at the front.

    An item is a view of a column, (rows, ...). Views are kept until the number of rows changes. A kernel takes whole
    columns as a record (`record`) with the indices of their rows, and may append rows itself (`grow`).

    Parameters
    ----------
    made : Made, optional
        What others make of whole columns, by any key; it is emptied when an array is replaced.
    **columns : tuple of int, or dtype
        Shape of a row's float64 entry, or the type of a scalar.

    Attributes
    ----------
    first, last : int
        Indices in whole columns of the first row, and of the first free one after the rows.

    Examples
    --------
    >>> c = Columns(time=(), value=(2,))
    >>> for t in range(3):
    ...     c.append(time=t, value=(t, -t))
    >>> c.drop(1)
    >>> c["time"].tolist(), c["value"][0].tolist()
    ([1.0, 2.0], [1.0, -1.0])
    """

    def __init__(self, made: Made | None = None, /, **columns: Any):
        self._capacity = 64
        self._columns: dict[str, Any] = {}
        self._made = Made() if made is None else made
        self.first = self.last = 0
        self.add(**columns)

    def add(self, **columns: Any) -> None:
        """More columns; the rows that there are have zeros in them."""
        for name, what in columns.items():
            shape, dtype = ((self._capacity, *what), float) if isinstance(what, tuple) else ((self._capacity,), what)
            self._columns[name] = np.zeros(shape, dtype)
        self._made.clear()

    def __len__(self) -> int:
        return self.last - self.first

    def __missing__(self, name: str) -> Any:
        view = self[name] = self._columns[name][self.first : self.last]
        return view

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (vars(self),)  # copies have views of their own

    def __deepcopy__(self, memo: dict[int, Any]) -> Columns:
        """A copy of the rows. Those that are free, the most and the largest part, are zero in it."""
        for column in self._columns.values():
            if id(column) not in memo:
                memo[id(column)] = made = np.zeros(column.shape, column.dtype)
                made[self.first : self.last] = column[self.first : self.last]
        return _restored(copy.deepcopy(vars(self), memo))

    def clear(self) -> None:
        """Forget the views, and where the rows are: their number has changed."""
        super().clear()
        self._made.rows = None

    def newest(self, name: str) -> Any:
        """A view of the last row's entry in a column."""
        return self._columns[name][self.last - 1]

    def record(self, kind: type[Kind], prefix: str = "") -> Kind:
        """The columns that have the names of the fields of a record, after a prefix: (capacity, ...) arrays."""
        return kind(**{name: self._columns[prefix + name] for name in kind.numba_fields})

    @property
    def names(self) -> set[str]:
        """Names of the columns."""
        return set(self._columns)

    @property
    def free(self) -> int:
        """Number of rows that can be appended before the rows have to be moved."""
        return self._capacity - self.last

    def reserve(self, count: int) -> None:
        """Move the rows to the front, or make more space, unless ``count`` rows are free."""
        if self.last + count > self._capacity:
            self._make_room(count)

    def grow(self, count: int) -> None:
        """Count rows that a kernel has written from index ``last`` on; ``count`` is at most ``free``."""
        self.last += count
        self.clear()

    def append(self, **values: Any) -> None:
        """Add a row; what is not given keeps any value."""
        if self.last == self._capacity:
            self._make_room()
        for name, value in values.items():
            self._columns[name][self.last] = value
        self.last += 1
        self.clear()

    def append_rows(self, count: int, **values: Any) -> None:
        """Add rows with given entries, or one entry for all; what is not given keeps any value."""
        if self.last + count > self._capacity:
            self._make_room(count)
        for name, value in values.items():
            self._columns[name][self.last : self.last + count] = value
        self.last += count
        self.clear()

    def drop(self, count: int) -> None:
        """Take ``count`` rows off the front."""
        self.first += count
        self.clear()

    def drop_newest(self, count: int) -> None:
        """Take ``count`` rows off the end."""
        self.last -= count
        self.clear()

    def _make_room(self, count: int = 1) -> None:
        """Move the rows to the front; more space where they fill more than half of it, or more rows do not fit."""
        rows, grown = len(self), self._capacity
        while 2 * rows > grown or rows + count > grown:
            grown *= 2
        self.clear()
        if grown > self._capacity:  # before the arrays are replaced, so that none is held longer
            self._made.clear()
        for name, column in self._columns.items():
            if grown > self._capacity:
                new = np.zeros((grown, *column.shape[1:]), column.dtype)
                new[:rows] = column[self.first : self.last]
                self._columns[name] = new
            else:
                column[:rows] = column[self.first : self.last].copy()
        self._capacity, self.first, self.last = grown, 0, rows


def _restored(state: dict[str, Any]) -> Columns:
    columns = Columns()
    vars(columns).update(state)
    return columns
