"""MATLAB files (``.mat`` until version 7): arrays and structures, by names like ``imu.acc``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.formats.apart import ApartError, apart
from simnav.log.formats.arrays import rows_of_arrays
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError
from simnav.types import Array

_DEEPEST = 8


@register_reader("mat", title="a MATLAB file")
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """``time`` of the file is the name of the array of the times."""
    if path.read_bytes()[:10] == b"MATLAB 7.3":
        raise LogError(f"{path}: a MATLAB file of version 7.3 is HDF5; say format = 'hdf5'")
    try:
        arrays = apart(_load, path)
    except ApartError as error:
        raise LogError(f"{path}: it is no MATLAB file of version 4 to 7, or damaged ({error})") from None
    return rows_of_arrays(path, file, arrays)


def _load(path: Path) -> dict[str, Array]:
    """All arrays of numbers of a file, by name."""
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    return dict(_numbers("", {k: v for k, v in content.items() if not k.startswith("__")}, 0))


def _numbers(name: str, value: Any, depth: int) -> Iterator[tuple[str, Array]]:
    """The arrays of numbers inside, with their names."""
    if isinstance(value, dict) and depth < _DEEPEST:
        for key, inner in value.items():
            yield from _numbers(f"{name}.{key}" if name else str(key), inner, depth + 1)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and 1 <= value.ndim <= 2 and value.size:
        yield name, value
