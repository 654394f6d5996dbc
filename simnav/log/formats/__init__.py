"""The formats of log files that simnav reads, one file each. The import of this module registers their readers."""

from __future__ import annotations

from simnav.log.delimited import read_csv
from simnav.log.formats import (
    bags,
    dataflash,
    euroc,
    hdf5,
    kf_gins,
    mat,
    n2k,
    parquet,
    pd0,
    pd6,
    rinex,
    rtklib,
    sbet,
    tum,
    ubx,
    ulog,
)
from simnav.log.nmea import read_nmea

__all__ = [
    "bags",
    "dataflash",
    "euroc",
    "hdf5",
    "kf_gins",
    "mat",
    "n2k",
    "parquet",
    "pd0",
    "pd6",
    "read_csv",
    "read_nmea",
    "rinex",
    "rtklib",
    "sbet",
    "tum",
    "ubx",
    "ulog",
]
