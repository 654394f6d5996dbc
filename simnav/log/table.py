"""The content of a log file as named columns.

A `Table` has float columns and knows the line of each row in the file, so that every complaint can name it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from simnav.spec import SpecError, closest
from simnav.types import Array

__all__ = ["LogError", "LogWarning", "Table", "check_ascending", "utc_seconds"]


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
            raise LogError(f"{table.source}, line {table.line[k]}, column {column!r}: the time is missing; 'where' "
                           f"leaves such rows out, like where = '`{column}` > 0'")  # fmt: skip
        if len(time) > 2 and time[k - 1] > time[-1] and (k < 2 or time[k] > time[k - 2]):
            raise LogError(
                f"{table.source}, line {table.line[k - 1]}, column {column!r}: the time {time[k - 1]:.10g} s is after "
                f"that of all later rows, the last of which is at {time[-1]:.10g} s; leave the row out by 'where'"
            )
        same = time[k] == time[k - 1]
        what = "is the same as" if same else "is before"
        right = (
            "say what to do with such rows: same_time = 'first', 'last' or 'spread' of the file"
            if same
            else "sort the file, or choose the rows of one instrument by 'where'"
        )
        raise LogError(
            f"{table.source}, line {table.line[k]}, column {column!r}: the time {what} that of line "
            f"{table.line[k - 1]} ({_seconds(time[k])} after {_seconds(time[k - 1])}); {right}"
        )


def _seconds(time: float) -> str:
    return f"{time:.6f} s" if abs(time) < 1e12 else f"{time:.6g} s"


def utc_seconds(text: str) -> float:
    """Seconds since 1970 of a date like ``2014-08-01T00:00:00.124Z`` or ``2014/08/01 00:00:00.124``.

    UTC where it names no zone. Some loggers of ships give year and day of the year: ``14+213:00:00:00.124``.

    Raises
    ------
    ValueError
        If it is not one.
    """
    text = text.strip()
    if text[2:3] == "+":
        return datetime.strptime(text, "%y+%j:%H:%M:%S.%f").replace(tzinfo=UTC).timestamp()
    if text[4:5] == "/" and text[7:8] == "/":
        text = text[:10].replace("/", "-") + text[10:]
    moment = datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
