"""The formats of log files that simnav reads. The import of this module registers their readers."""

from __future__ import annotations

from simnav.log.delimited import read_csv
from simnav.log.nmea import read_nmea

__all__ = ["read_csv", "read_nmea"]
