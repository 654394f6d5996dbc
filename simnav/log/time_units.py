"""In which unit the times of a stream probably are: by its rate, and by the times of the other streams."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.units import DIMENSIONS, factor
from simnav.types import Array

__all__ = ["MONTH", "SLOWEST_IMU", "other_unit", "unit_to_write"]

#: Units that loggers count in, each a thousandth of the one before.
_UNITS = DIMENSIONS["time"][:4]
#: An IMU has at least this rate [Hz].
SLOWEST_IMU = 1.0
#: Rates that the times should have in another unit [Hz]: of an IMU, and of other instruments.
_OF_IMU, _OF_OTHERS = (5.0, 2e4), (0.01, 250.0)
#: Streams have no times in common below the first part of both spans together, and the same ones from the second on.
_APART, _ALIKE = 0.01, 0.5
#: Times since 1970 are seconds between these.
_SINCE_1970 = 1e9, 1e10
#: A log that seems to last longer, with less than a row a minute, is read in a wrong unit [s].
MONTH, _MINUTE = 30.0 * 86400.0, 60.0


def other_unit(
    unit: str, time: Array, others: Iterable[Array], *, inertial: bool, longest: float = MONTH
) -> str | None:
    """The unit in which times probably are, if it is another one than that in which they were read.

    Parameters
    ----------
    unit : str
        In which they were read.
    time : (n,) array
        Times of a stream, ascending [s].
    others : iterable of arrays
        Times of the other streams of the log [s].
    inertial : bool
        Whether the stream is of an IMU.
    longest : float
        A log with less than a row a minute is no longer than this [s].

    Returns
    -------
    str or None
        A unit of time, with which the stream and another one have the same times, or an IMU a possible rate; None
        where the unit fits, or nothing tells another one.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        spacing = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    if unit not in _UNITS or not 0.0 < spacing < np.inf:
        return None
    low, high = _OF_IMU if inertial else _OF_OTHERS
    times = {u: time * (factor(u) / factor(unit)) for u in _UNITS if u != unit}
    times = {u: t for u, t in times.items() if low <= factor(unit) / (factor(u) * spacing) <= high}
    for other in others:
        if _common(time, other) < _APART:
            for u, changed in times.items():
                if _common(changed, other) > _ALIKE:
                    return u
    stamped = _SINCE_1970[0] < abs(time[0]) < _SINCE_1970[1] and spacing < 10.0
    if inertial and not stamped and (spacing >= 1.0 / SLOWEST_IMU or spacing < 1.0 / high):
        return next(iter(times), None)
    if not inertial and spacing > _MINUTE and time[-1] - time[0] > longest:
        return next((u for u, t in times.items() if t[-1] - t[0] < MONTH), None)
    return None


def unit_to_write(file: FileSpec, time: Array, others: Iterable[Array], *, inertial: bool) -> str:
    """The line of a file with which its times fit the other streams, or an IMU has a possible rate; empty for none."""
    known = file.time_unit in _UNITS
    found = other_unit(file.time_unit if known else "s", time, others, inertial=inertial)
    if found is None:
        return ""
    if known and file.format in ("csv", "parquet", "mat", "hdf5"):
        return f"time_unit = {found!r}"
    return f"scale = {file.scale * factor(found):g}"


def _common(one: Array, other: Array) -> float:
    """The part of the spans of two streams that they have in common."""
    if len(one) < 2 or len(other) < 2:
        return 1.0
    both = min(one[-1], other[-1]) - max(one[0], other[0])
    return float(max(0.0, both) / (max(one[-1], other[-1]) - min(one[0], other[0])))
