"""Rows with the time of the row before: left out, or spread over the time to the next one."""

from __future__ import annotations

import warnings
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simnav.log.table import LogWarning, Table
from simnav.types import Array

__all__ = ["SameTime", "settle"]

#: What is done with rows of one time: an error, keep the first or the last of them, or spread them.
SameTime = Literal["refuse", "first", "last", "spread"]


def settle(time: Array, rows: NDArray[np.int64], table: Table, how: SameTime) -> tuple[Array, NDArray[np.int64]]:
    """Settle rows that have the time of the row before.

    Parameters
    ----------
    time : (n,) array
        Time of every row of the table [s].
    rows : (m,) int array
        Rows that count, ascending.
    table : Table
        For messages.
    how : SameTime
        ``spread``: k rows of one time are put at equal distances up to the next time, as they were where a logger
        stamps with whole seconds. The last ones have the spacing of those before.

    Returns
    -------
    (n,) array, (m',) int array
        Times, and the rows that still count. Times that go back are left for others to refuse.
    """
    own = time[rows]
    with np.errstate(invalid="ignore"):
        repeated = np.flatnonzero(np.diff(own) == 0.0) + 1
    if how == "refuse" or not repeated.size:
        return time, rows
    if how == "spread":
        begins = np.concatenate([[0], np.flatnonzero(np.diff(own) != 0.0) + 1])
        count = np.diff(np.append(begins, len(own)))
        length = np.diff(own[begins])
        if not length.size:
            return time, rows  # a single time: refused by who checks that times ascend
        length = np.append(length, length[-1] * count[-1] / count[-2])
        place = np.arange(len(own)) - np.repeat(begins, count)
        time = time.copy()
        time[rows] = own + place * np.repeat(length / count, count)
        return time, rows
    left, side = (repeated, "before") if how == "first" else (repeated - 1, "after")
    message = (
        f"{len(left)} of {len(rows)} rows at the time of the one {side} are left out, the first is line "
        f"{table.line[rows[left[0]]]}"
    )
    if len(left) > 0.1 * len(rows):
        message += "; if the logger stamps in coarse steps, same_time = 'spread' of the file keeps them"
    warnings.warn(f"{table.source}: {message}", LogWarning, 3)
    return time, np.delete(rows, left)
