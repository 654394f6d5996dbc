"""The files of a data set: a folder for each part of a split, with one file for each table.

A part has `PART` voyages, the last one may have fewer. The i-th row group of each file is the i-th voyage of the part.
A part appears under its name when it is complete, so a data set that was stopped continues where it was.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from simnav.leaderboard.campaign.seal import Seal
from simnav.leaderboard.results.errors import RequestError, mistakes
from simnav.scenario import Scenario

from .schemas import byte_streams, dictionaries, schemas
from .splits import TEST
from .tables import from_tables, to_tables
from .voyages import recordings

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

    from simnav.recording import Recording

__all__ = ["PART", "WrittenPart", "part_numbers", "read_recordings", "voyages_in", "write_part"]

#: Voyages of a part.
PART = 100


@dataclass(frozen=True)
class WrittenPart:
    """What it took to write a part.

    Attributes
    ----------
    voyages : int
        How many were written.
    processor : float
        Processor time [s].
    """

    voyages: int
    processor: float


def _folder(folder: Path, split: str, part: int) -> Path:
    return folder / split / f"{part:05d}"


def part_numbers(size: int) -> list[range]:
    """The numbers of the voyages in each part of a split.

    >>> part_numbers(250)
    [range(0, 100), range(100, 200), range(200, 250)]
    """
    return [range(first, min(first + PART, size)) for first in range(0, size, PART)]


def voyages_in(folder: Path, split: str, part: int) -> int:
    """How many voyages a part holds; 0 if it is not there, or damaged."""
    from pyarrow import ArrowInvalid, parquet

    try:
        return int(parquet.read_metadata(_folder(folder, split, part) / "voyages.parquet").num_rows)
    except (OSError, ArrowInvalid):
        return 0


def write_part(folder: Path, family: Scenario, split: str, part: int, numbers: range, seal: Seal) -> WrittenPart:
    """Simulate the voyages of a part, and write it completely or not at all.

    Returns
    -------
    WrittenPart
        How many voyages were written.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    from pyarrow import parquet

    begin = time.process_time()
    told, target = split != TEST, _folder(folder, split, part)
    partial = target.with_name(f".{target.name}.part")
    shutil.rmtree(partial, ignore_errors=True)  # of a run that was stopped
    partial.mkdir(parents=True)
    try:
        with ExitStack() as stack:
            writers = {
                name: stack.enter_context(parquet.ParquetWriter(
                    partial / f"{name}.parquet", schema, compression="zstd", use_dictionary=dictionaries(schema),
                    use_byte_stream_split=byte_streams(schema), write_statistics=["voyage"],
                ))
                for name, schema in schemas(told).items()
            }  # fmt: skip
            for number, recording in zip(numbers, recordings(family, split, numbers, seal), strict=True):
                for name, table in to_tables(recording, number, told).items():
                    writers[name].write_table(table)
        shutil.rmtree(target, ignore_errors=True)  # a part with fewer voyages
        os.replace(partial, target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return WrittenPart(len(numbers), time.process_time() - begin)


def read_recordings(folder: Path, family: str, split: str, numbers: Iterable[int]) -> Iterator[Recording]:
    """Read voyages of a split, in any order.

    Parameters
    ----------
    folder : Path
        Folder of the data set.
    family : str
        Versioned id of the family.
    split : str
        The split.
    numbers : iterable of int
        Numbers of the voyages in the split.

    Raises
    ------
    RequestError
        If a voyage is not there, or a file is damaged.
    """
    part = -1
    files: dict[str, ParquetFile] = {}
    names = list(schemas(split != TEST))
    try:
        for number in numbers:
            if number // PART != part or not files:
                _close(files)
                part = number // PART
                files = _opened(_folder(folder, split, part), names)
            row = number - part * PART
            with mistakes(OSError, ValueError, KeyError, TypeError):
                if row >= files["voyages"].num_row_groups:
                    raise RequestError(f"{folder}: there is no voyage {number} of split {split}")
                found = from_tables({name: file.read_row_group(row) for name, file in files.items()}, family)
            yield found
    finally:
        _close(files)


def _opened(folder: Path, names: list[str]) -> dict[str, ParquetFile]:
    from pyarrow import parquet

    if not folder.is_dir():
        raise RequestError(f"{folder} is missing; 'simnav dataset' with the same folder writes what is missing")
    with mistakes(OSError, ValueError):
        return {name: parquet.ParquetFile(folder / f"{name}.parquet") for name in names}


def _close(files: dict[str, ParquetFile]) -> None:
    for file in files.values():
        file.close()
    files.clear()
