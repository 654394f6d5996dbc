"""GPS time as a week and seconds of the week.

GPS time counts weeks from 6 January 1980, without leap seconds. A double of seconds since 1980 resolves 0.2
microseconds, in which a satellite moves by a millimetre, so the two parts are kept apart. Galileo's system time agrees
with GPS time to some nanoseconds, and its weeks in RINEX are those of GPS. BeiDou's time is 14 s behind.

Source: *RINEX, The Receiver Independent Exchange Format, Version 3.05*, IGS/RTCM 2020, section 4.1; *IS-GPS-200N*,
2022, section 20.3.3.5.2.4.
"""

from __future__ import annotations

from datetime import datetime
from typing import NamedTuple

__all__ = ["BEIDOU_BEHIND_GPS", "SECONDS_OF_WEEK", "GpsTime", "gps_time"]

SECONDS_OF_WEEK = 604800.0
#: BeiDou's time is this much behind GPS time [s].
BEIDOU_BEHIND_GPS = 14.0
_ORIGIN = datetime(1980, 1, 6)


class GpsTime(NamedTuple):
    """A time of GPS.

    Attributes
    ----------
    week : int
        Weeks since 6 January 1980.
    seconds : float
        Seconds of the week [s].
    """

    week: int
    seconds: float

    def since(self, week: int) -> float:
        """Seconds since the beginning of a week [s]."""
        return (self.week - week) * SECONDS_OF_WEEK + self.seconds

    def __str__(self) -> str:
        return f"second {self.seconds:g} of GPS week {self.week}"


def gps_time(moment: datetime) -> GpsTime:
    """The GPS time of a date and a time of day, both in GPS time.

    Parameters
    ----------
    moment : datetime
        Without a time zone, from 1980 on.

    Raises
    ------
    ValueError
        If it is before 1980.

    Examples
    --------
    >>> gps_time(datetime(2023, 3, 12, 12, 30))
    GpsTime(week=2253, seconds=45000.0)
    """
    if moment < _ORIGIN:
        raise ValueError(f"{moment} is before 6 January 1980, when GPS time begins")
    elapsed = moment - _ORIGIN
    week, days = divmod(elapsed.days, 7)
    return GpsTime(week, days * 86400.0 + elapsed.seconds + elapsed.microseconds * 1e-6)
