"""The series of a stored result, read from its file when they are asked for.

Series are nearly all of what a result takes (26 kB a run). Whoever loads a hundred thousand results needs few of them,
so that they stay on disk until then; a few row groups are kept in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

from simnav.leaderboard.results.result import Series, decoded_series

__all__ = ["StoredSeries", "read_ahead"]

_KEPT = 8  # row groups in memory, of a few hundred results each


class StoredSeries(Mapping[str, Series]):
    """The series of one result, by name; an `OSError` where its file is gone or damaged when they are read.

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

    def __getitem__(self, name: str) -> Series:
        return _group(self.path, self.group)[self.row][name]

    def __iter__(self) -> Iterator[str]:
        return iter(_group(self.path, self.group)[self.row])

    def __len__(self) -> int:
        return len(_group(self.path, self.group)[self.row])

    def __reduce__(self) -> tuple[type[StoredSeries], tuple[str, int, int]]:
        return StoredSeries, (self.path, self.group, self.row)


@lru_cache(maxsize=_KEPT)
def _group(path: str, group: int) -> list[dict[str, Series]]:
    import pyarrow.parquet as pq

    with open(path, "rb") as source:
        table = pq.ParquetFile(source, page_checksum_verification=True).read_row_group(group, ["series"])
    return list(decoded_series(table.column("series")))


def read_ahead(series: Iterable[Mapping[str, Series]]) -> Iterator[Mapping[str, Series]]:
    """The same series in the order of their places in the files, while a thread reads the next row group."""
    stored = sorted((s for s in series if isinstance(s, StoredSeries)), key=lambda s: (s.path, s.group, s.row))
    groups = list(dict.fromkeys((s.path, s.group) for s in stored))
    with ThreadPoolExecutor(1) as pool:
        waiting = [pool.submit(_group, *place) for place in groups[:1]]
        current = -1
        for s in stored:
            if current < 0 or groups[current] != (s.path, s.group):
                waiting.pop().result()
                current += 1
                if current + 1 < len(groups):
                    waiting.append(pool.submit(_group, *groups[current + 1]))
            yield s
    yield from (s for s in series if not isinstance(s, StoredSeries))
