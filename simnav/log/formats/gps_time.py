"""From GPS time to UTC."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from simnav.types import Array

__all__ = ["GPS_EPOCH", "leap_seconds", "utc_of_gps"]

#: 1980-01-06, in seconds since 1970.
GPS_EPOCH = 315964800.0
#: Days from which GPS time is ahead of UTC by one second more (IERS Bulletin C).
_STEPS = np.array([
    datetime(year, month, 1, tzinfo=UTC).timestamp()
    for year, month in [
        (1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7), (1993, 7), (1994, 7),
        (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7), (2015, 7), (2017, 1),
    ]
])  # fmt: skip


def leap_seconds(time: Array) -> Array:
    """By how much GPS time is ahead of UTC [s], at n times in seconds since 1970."""
    return np.searchsorted(_STEPS, time, side="right").astype(np.float64)


def utc_of_gps(week: Array, second: Array) -> Array:
    """Seconds since 1970 in UTC, of GPS weeks and seconds of the week."""
    time = GPS_EPOCH + 604800.0 * np.asarray(week, dtype=np.float64) + second
    return np.asarray(time - leap_seconds(time))
