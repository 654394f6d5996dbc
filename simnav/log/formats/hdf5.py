"""HDF5 files, and MATLAB files of version 7.3: data sets by their paths, like ``imu/acc`` (an extra: h5py)."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from simnav.log.files import FileSpec
from simnav.log.formats.apart import ApartError, apart
from simnav.log.formats.arrays import rows_of_arrays
from simnav.log.reader import Rows, register_reader
from simnav.log.table import LogError
from simnav.types import Array

#: Data sets with more numbers are refused: they are no log that fits in memory.
_MOST = 1 << 30


@register_reader("hdf5", title="an HDF5 file")
def read(path: Path, file: FileSpec, sentence: str | None, talker: str | None) -> Rows:
    """``time`` of the file is the path of the data set of the times."""
    if find_spec("h5py") is None:
        raise LogError(f"{path}: format = 'hdf5' needs the library h5py: pip install 'simnav[logs]'")
    if not path.is_file():
        raise FileNotFoundError
    try:
        arrays = apart(_load, path)
    except ApartError as error:
        raise LogError(f"{path}: it is no HDF5 file, or damaged ({error})") from None
    return rows_of_arrays(path, file, arrays)


def _load(path: Path) -> dict[str, Array]:
    """All data sets of numbers of a file, by path."""
    import h5py

    arrays: dict[str, Array] = {}

    def take(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and 1 <= len(item.shape) <= 2 and item.dtype.kind in "biuf":
            if item.size > _MOST:
                raise ValueError(f"the data set {name!r} claims {item.size} numbers")
            arrays[name] = np.asarray(item[()])

    with h5py.File(path, "r") as content:
        content.visititems(take)
    return arrays
