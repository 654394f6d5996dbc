"""Arrays by name, as MATLAB and HDF5 files hold them, as a table: those that are as long as the time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.reader import Rows
from simnav.log.table import LogError, Table
from simnav.log.units import factor
from simnav.spec import closest
from simnav.types import Array

__all__ = ["rows_of_arrays", "sizes"]

_SHOWN = 12


def sizes(arrays: Mapping[str, Array]) -> str:
    """Names and shapes of the first arrays, as text."""
    shown = [f"{name} {'x'.join(map(str, a.shape))}" for name, a in list(arrays.items())[:_SHOWN]]
    return ", ".join(shown) + (f" and {len(arrays) - _SHOWN} more" if len(arrays) > _SHOWN else "")


def rows_of_arrays(path: Path, file: FileSpec, arrays: Mapping[str, Array]) -> Rows:
    """The rows of the arrays that are as long as that of the time.

    Parameters
    ----------
    path, file
        As a reader gets them; ``file.time`` is the name of an array.
    arrays : mapping of str to array
        Numbers, in one or two dimensions. Of two dimensions each column becomes ``NAME_1``, ``NAME_2``, ...

    Returns
    -------
    Rows

    Raises
    ------
    LogError
        If there is no such array, or its values are no times.
    """
    if not isinstance(file.time, str):
        raise LogError(f"{path}: name the array of the times, like time = 'imu.t'; there are: {sizes(arrays)}")
    if file.time not in arrays:
        raise LogError(f"{path}: there is no array {file.time!r}{closest(file.time, list(arrays))}")
    if file.time_unit == "iso":
        raise LogError(f"{path}: the times of such a file are numbers; time_unit = 'iso' is for text")
    stamps = arrays[file.time]
    if stamps.size != max(stamps.shape, default=0) or stamps.size == 0:
        raise LogError(f"{path}: the array {file.time!r} of the times is {'x'.join(map(str, stamps.shape))}, no vector")
    n = stamps.size
    columns: dict[str, Array] = {}
    for name, values in arrays.items():
        if values.size == n and max(values.shape) == n:
            columns[name] = values.reshape(-1).astype(np.float64)
        elif values.ndim == 2 and n in values.shape:
            table = values if values.shape[0] == n else values.T
            columns |= {f"{name}_{i + 1}": table[:, i].astype(np.float64) for i in range(table.shape[1])}
    found = Table(str(path), dict(columns), np.arange(1, n + 1))
    return Rows(found, stamps.reshape(-1).astype(np.float64) * factor(file.time_unit), file.time)
