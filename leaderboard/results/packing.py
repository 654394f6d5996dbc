"""Results as they are passed on: a folder of results without series, with one file for each estimator.

A packed folder is a folder of results like any other: it can be ranked, merged, verified and shown. Another run of one
estimator changes one file of it.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from . import store
from .result import Result, to_table, write_tables
from .scratch import scratch

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["pack", "shortened", "write_packed"]

_ROWS = 4096  # of a group in a file


def pack(
    folder: str | os.PathLike[str],
    target: str | os.PathLike[str],
    estimators: Collection[str] | None = None,
    runs: Mapping[str, int] | None = None,
) -> list[Result]:
    """Write the current results of a folder into another one, without series and trials.

    Parameters
    ----------
    folder : path
        Of the results. It stays as it is.
    target : path
        New, or a folder of results, which is replaced.
    estimators : collection of str, optional
        Labels of those that are taken. Default: all.
    runs : mapping of str to int, optional
        Number of seeds that are taken of each scenario, by versioned id. Default: all.

    Returns
    -------
    list of Result
        Results that were written, in order of scenario, estimator and seed.

    Raises
    ------
    StoreError
        If a folder cannot be used, or the target holds something else. Then the target is as it was.
    """
    source, place = Path(folder), Path(target)
    found = [
        replace(r, series={}, seconds=round(r.seconds, 3))
        for r in store.load(source, series=False)
        if (estimators is None or r.estimator in estimators) and (runs is None or r.seed < runs.get(r.scenario, 0))
    ]
    write_packed(found, place)
    return found


def write_packed(found: Iterable[Result], place: Path) -> None:
    """Write results without series as a packed folder, in the place of one that is there.

    Raises
    ------
    StoreError
        If there is a folder of something else, or it cannot be written. Then it is as it was.
    """
    if place.exists():
        store.create(place)  # refuses a folder of something else
    place.parent.mkdir(parents=True, exist_ok=True)
    # Where the place is empty, an older draft may hold what was there: its process was killed between the two moves.
    with scratch("draft", place.parent, sweeping=place.exists()) as draft:
        made = store.create(draft / "results")
        by: dict[str, list[Result]] = {}
        current: dict[str, tuple[str, dict[str, str]]] = {}
        for result in found:
            by.setdefault(result.estimator, []).append(result)
            current.setdefault(result.scenario, (result.recording, {}))[1][result.estimator] = result.variant
            store.keep_provenance(made, result.provenance)
        for label, mine in by.items():
            with store.atomic(made / "compacted" / f"part-{_file_name(label)}.parquet") as file:
                write_tables(file, _tables(mine), level=19, split=True)
        store.select(made, current)
        shutil.rmtree(made / "results")
        old = draft / "old"
        if place.exists():
            os.replace(place, old)
        os.replace(made, place)


def shortened(results: Iterable[Result]) -> list[Result]:
    """Results with scores in single precision, and with the draws of a run at its first estimator only.

    They take less than half the space.
    """
    kept, found = set[tuple[str, int]](), []
    for r in results:
        scores = {name: float(np.float32(value)) for name, value in r.scores.items()}
        draws = {} if (r.scenario, r.seed) in kept else r.draws
        kept.add((r.scenario, r.seed))
        found.append(replace(r, scores=scores, draws=draws))
    return found


def _tables(results: list[Result]) -> Iterator[pa.Table]:
    import pyarrow as pa

    for first in range(0, len(results), _ROWS):
        yield pa.concat_tables([to_table(r) for r in results[first : first + _ROWS]]).combine_chunks()


def _file_name(label: str) -> str:
    """A file name for a label: plain characters only, and none twice.

    >>> _file_name("ekf"), _file_name("ekf(gate=3)")
    ('ekf', 'ekf-gate-3-499a09')
    """
    plain = re.sub(r"[^a-z0-9]+", "-", label.lower()).strip("-")[:60]
    if plain == label:
        return label
    return f"{plain}-{hashlib.blake2b(label.encode(), digest_size=3).hexdigest()}"
