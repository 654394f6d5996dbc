"""The series of a stored result, read from its file when they are asked for.

Series are nearly all of what a result takes (26 kB a run). Whoever loads a hundred thousand results needs few of them,
so that they stay on disk until then; a few row groups are kept in memory.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

from .errors import StoreError
from .folder import StoreWarning, set_aside
from .result import Series, SeriesColumn

__all__ = ["LostSeriesError", "StoredSeries", "read_ahead"]

_KEPT = 8  # row groups in memory, of a few hundred results each
_AHEAD = 2  # row groups that are read beside the work on another
_NOTHING: Mapping[str, Series] = MappingProxyType({})


class LostSeriesError(StoreError):
    """The file of the series is gone or damaged; one that is damaged was set aside."""


class StoredSeries(Mapping[str, Series]):
    """The series of one result, by name; `LostSeriesError` where its file is gone or damaged when they are read.

    Parameters
    ----------
    path : str
        File of results.
    group, row : int
        Row group of the file, and row in it.
    """

    __slots__ = ("group", "path", "row")

    def __init__(self, path: str, group: int, row: int):
        self.path, self.group, self.row = path, group, row

    def held(self) -> Mapping[str, Series]:
        """The same series in memory: several of them are had more quickly in this way."""
        return _group(self.path, self.group)[self.row]

    def __getitem__(self, name: str) -> Series:
        return _group(self.path, self.group)[self.row][name]

    def __iter__(self) -> Iterator[str]:
        return iter(_group(self.path, self.group)[self.row])

    def __len__(self) -> int:
        return len(_group(self.path, self.group)[self.row])

    def __reduce__(self) -> tuple[type[StoredSeries], tuple[str, int, int]]:
        return StoredSeries, (self.path, self.group, self.row)


@lru_cache(maxsize=_KEPT)
def _group(path: str, group: int) -> SeriesColumn:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with open(path, "rb") as source:
            table = pq.ParquetFile(source, page_checksum_verification=True).read_row_group(
                group, ["series"], use_threads=False
            )
        return SeriesColumn(table.column("series"))
    except (FileNotFoundError, PermissionError) as error:
        raise LostSeriesError(f"{path} cannot be read any more: {error.strerror}") from None
    except MemoryError:  # pyarrow's is an ArrowException, too; the file is whole
        raise StoreError(f"{path} cannot be read: there is not enough memory") from None
    except (pa.ArrowException, ValueError, OSError) as error:
        set_aside(Path(path), error)
        raise LostSeriesError(
            f"{path} was damaged and is set aside; 'simnav campaign' computes its runs again"
        ) from None


def read_ahead(series: Iterable[Mapping[str, Series]]) -> Iterator[tuple[Mapping[str, Series], Mapping[str, Series]]]:
    """Pairs of each of these series and the same series in memory.

    Stored ones come in the order of their places in the files, while threads read the next row groups. Where a file is
    damaged or gone, the series in memory are empty, and a `StoreWarning` names it.
    """
    stored = sorted((s for s in series if isinstance(s, StoredSeries)), key=lambda s: (s.path, s.group, s.row))
    groups = list(dict.fromkeys((s.path, s.group) for s in stored))
    with ThreadPoolExecutor(_AHEAD) as pool:
        waiting = deque(pool.submit(_group, *place) for place in groups[:_AHEAD])
        current = -1
        lost: dict[str, None] = {}
        for s in stored:
            if current < 0 or groups[current] != (s.path, s.group):
                reading = waiting.popleft()
                whole = not isinstance(reading.exception(), LostSeriesError)
                if whole:
                    reading.result()
                current += 1
                if current + _AHEAD < len(groups):
                    waiting.append(pool.submit(_group, *groups[current + _AHEAD]))
            if not whole:
                lost[s.path] = None
            yield s, s.held() if whole else _NOTHING
    for path in lost:
        what = f"{path} is damaged or gone: the charts lack its runs; 'simnav campaign' computes them again"
        warnings.warn(what, StoreWarning, 2)
    yield from ((s, s) for s in series if not isinstance(s, StoredSeries))
