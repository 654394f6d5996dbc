"""Writes a data set: part after part, in several processes, where it was left off."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.seal import Seal
from simnav.leaderboard.campaign.worker import start_worker
from simnav.leaderboard.results.errors import mistakes
from simnav.leaderboard.results.files import write_whole
from simnav.scenario import Scenario

from .card import card
from .manifest import Manifest, SplitReport
from .parts import WrittenPart, part_numbers, voyages_in, write_part

__all__ = ["DatasetReport", "make"]


@dataclass(frozen=True)
class DatasetReport:
    """A data set, and how long it took.

    Attributes
    ----------
    family : str
        Versioned id of the family.
    folder : Path
        Where it is.
    splits : dict of str to SplitReport
        The splits.
    written : int
        Voyages that were written now; the others were there.
    seconds, processor : float
        Time that it took, and processor time of all processes [s].
    """

    family: str
    folder: Path
    splits: Mapping[str, SplitReport] = field(default_factory=dict)
    written: int = 0
    seconds: float = 0.0
    processor: float = 0.0

    @property
    def pace(self) -> float:
        """Voyages a minute of processor time; 0 if none was written."""
        return 60.0 * self.written / self.processor if self.written else 0.0

    @property
    def density(self) -> float:
        """Bytes a second of voyage."""
        return sum(s.size for s in self.splits.values()) / sum(s.duration for s in self.splits.values())

    def to_dict(self) -> dict[str, Any]:
        """Plain: what ``simnav dataset --json`` prints."""
        return {
            "family": self.family,
            "folder": str(self.folder),
            "splits": {name: vars(split) for name, split in self.splits.items()},
            "written": self.written,
            "seconds": self.seconds,
            "processor_seconds": self.processor,
            "voyages_per_processor_minute": self.pace,
            "bytes_per_second_of_voyage": self.density,
        }


def make(
    family: Scenario,
    sizes: Mapping[str, int],
    folder: Path,
    seal: Seal,
    workers: int = 1,
    progress: Callable[..., None] | None = None,
) -> DatasetReport:
    """Write the parts of a data set that are missing, and its card.

    Parameters
    ----------
    family : Scenario
        A training family.
    sizes : mapping of str to int
        Number of voyages of each split that is to be written. Of a split that has more, the larger number counts.
    folder : Path
        New, empty, or with a data set that is continued.
    seal : Seal
        Of the seeds of split ``test``.
    workers : int
        Number of processes.
    progress : callable, optional
        Called with the numbers of voyages that are done and that are to be written.

    Raises
    ------
    RequestError
        If the folder holds something else, or cannot be written.
    """
    begin = time.perf_counter()
    manifest = Manifest.begun(folder, family, sizes, seal)
    manifest.write(folder)
    jobs = [
        (split, part, numbers)
        for split in sizes
        for part, numbers in enumerate(part_numbers(manifest.sizes[split]))
        if voyages_in(folder, split, part) < len(numbers)
    ]
    total, written, processor = sum(len(numbers) for *_, numbers in jobs), 0, 0.0
    with mistakes(ValueError, OSError):
        for part in _run([(folder, family, *job, seal) for job in jobs], workers):
            written, processor = written + part.voyages, processor + part.processor
            if progress is not None:
                progress(written, total)
        seconds = time.perf_counter() - begin
        splits = {split: _report(folder, split) for split in manifest.sizes}
        report = DatasetReport(family.id, folder, splits, written, seconds, processor)
        write_whole(folder / "README.md", card(family, manifest, splits))
    return report


def _run(jobs: list[tuple[Any, ...]], workers: int) -> Iterator[WrittenPart]:
    """The outcome of each part, as they are finished."""
    if workers == 1 or len(jobs) < 2:
        yield from (write_part(*job) for job in jobs)
        return
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", n_jobs=workers, inner_max_num_threads=1):
        parallel = Parallel(
            return_as="generator_unordered", batch_size=1, initializer=start_worker, initargs=(os.getpid(),)
        )
        yield from parallel(delayed(write_part)(*job) for job in jobs)


def _report(folder: Path, split: str) -> SplitReport:
    """What the files of a split hold."""
    from pyarrow import parquet

    voyages, duration, size = 0, 0.0, 0
    for path in sorted((folder / split).glob("[0-9]*/*.parquet")):
        size += path.stat().st_size
        if path.stem == "voyages":
            durations = parquet.read_table(path, columns=["duration_s"])["duration_s"].to_numpy()
            voyages, duration = voyages + len(durations), duration + float(durations.sum())
    return SplitReport(voyages, duration, size)
