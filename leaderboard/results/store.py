"""The result store: one file a result, written atomically; then compacted to Parquet.

`simnav.leaderboard.results.folder` says what a folder of results holds. A result's key names everything that decides it
(`simnav.leaderboard.campaign.fingerprint`), so a campaign that was killed goes on where it was. Whatever moment it was
killed at: a result that is both loose and compacted counts once, and nothing is deleted before the file that replaces
it is on disk.

Results of an older scenario, simulator or estimator stay in the folder, but only those of the last
campaign's versions are current and come back from `load`.
"""

from __future__ import annotations

import contextlib
import json
import os
import uuid
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from .admission import admitted
from .errors import StoreError
from .folder import (
    COMPACTED,
    FILES,
    LOOSE,
    PROVENANCE,
    TRIALS,
    DamagedError,
    SetAsideWarning,
    StoreWarning,
    atomic,
    contents,
    create,
    delete_unfinished,
    described,
    failure,
    files_of,
    opened,
    read_marker,
    select,
    set_aside,
    steadily,
    tables_of,
)
from .provenance import Provenance
from .result import BATCH, FORMAT, Result, listed, of_scenarios, rows, schema, to_table, write_tables
from .stored_series import StoredSeries

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = [
    "FILES",
    "FORMAT",
    "Ending",
    "Result",
    "SetAsideWarning",
    "StoreError",
    "StoreWarning",
    "atomic",
    "compact",
    "create",
    "described",
    "drop",
    "keep_provenance",
    "keys",
    "load",
    "provenances",
    "readdress",
    "rescore",
    "select",
    "write",
]

_SENTENCES = 3  # of a warning
#: More files with many results than this are merged into one.
MOST_PARTS = 16


class Ending(NamedTuple):
    """How a stored run ended.

    Attributes
    ----------
    status : str
        Status of the run.
    time_limit : float
        Time limit of the run [s]; 0 where it is not known.
    memory_limit : int
        [bytes]; 0 where it is not known.
    scoring : str
        Digest of the code of the scores, as in `Result`.
    provenance : str
        Id of the provenance; empty where it is not known.
    """

    status: str
    time_limit: float
    memory_limit: int
    scoring: str
    provenance: str


def write(folder: str | os.PathLike[str], result: Result) -> None:
    """Write one result, atomically, and its provenance where the folder does not have it.

    Raises
    ------
    StoreError
        If it cannot be written, e.g. because the disk is full; nothing is left behind.
    """
    table = to_table(result)
    keep_provenance(Path(folder), result.provenance)
    with atomic(Path(folder) / LOOSE / f"{result.key}.parquet") as file:
        write_tables(file, iter([table]))


def keep_provenance(path: Path, provenance: Provenance) -> None:
    """Keep a provenance in a folder of results, unless it is there."""
    target = path / PROVENANCE / f"{provenance.id}.json"
    if not provenance.id or provenance.identity or target.exists():
        return
    try:
        target.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise failure(target, error) from None
    with atomic(target) as file:
        file.write(json.dumps(provenance.to_dict(), indent=1).encode())


def provenances(folder: str | os.PathLike[str]) -> dict[str, Provenance]:
    """All that the folder knows, by id; a damaged file is set aside."""
    found = {}
    for file in sorted((Path(folder) / PROVENANCE).glob("*.json")):
        try:
            if not file.is_file():  # a pipe, on which a reader would wait for ever
                continue
            values = json.loads(file.read_bytes())
            one = Provenance.from_dict(values)
            if values["id"] != file.stem:
                raise ValueError(f"it is called {file.stem}, and its id is {values['id']}")
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            set_aside(file, error)
            continue
        except OSError as error:
            raise StoreError(f"{file} cannot be read: {error.strerror}") from None
        found[file.stem] = one
    return found


def keys(folder: str | os.PathLike[str]) -> dict[str, Ending]:
    """How each result that is there and whole ended, by key; damaged files are set aside."""
    path = opened(folder)
    delete_unfinished(path)

    def scan() -> dict[str, Ending]:
        found: dict[str, Ending] = {}
        # A loose file is read as a whole, to know that it is. Of a part only what is asked for is read, or a resumed
        # campaign of many results would wait; what is damaged elsewhere in it is found when it is loaded.
        for _, tables in contents(path, ["key", *Ending._fields], schema().names):
            for table in tables:
                columns = [listed(table.column(name)) for name in ("key", *Ending._fields)]
                for key, *ending in zip(*columns, strict=True):
                    found.setdefault(key, Ending(*ending))
        return found

    return steadily(scan)


def drop(folder: str | os.PathLike[str], keys: Collection[str]) -> None:
    """Take results out of a folder, because they are to be computed again.

    Each file is replaced as a whole or deleted, so that other results are safe whatever happens.

    Parameters
    ----------
    folder : path
        Folder of the results.
    keys : collection of str
        Keys of the results.

    Raises
    ------
    StoreError
        If a file cannot be written or deleted.
    """

    def without(table: pa.Table) -> pa.Table:
        import pyarrow as pa

        return table.filter(pa.array([key not in keys for key in table.column("key").to_pylist()]))

    path = opened(folder)
    for key in keys:
        (path / LOOSE / f"{key}.parquet").unlink(missing_ok=True)
    _rewrite(path, keys, without)


def rescore(folder: str | os.PathLike[str], scores: Mapping[str, Mapping[str, float]], scoring: str) -> None:
    """Give results other scores.

    Each file is replaced as a whole, so that a result has its old scores or its new ones, whatever happens.

    Parameters
    ----------
    folder : path
        Folder of the results.
    scores : mapping of str to mapping
        All scores of each result, by key.
    scoring : str
        Digest of the code that computed them.

    Raises
    ------
    StoreError
        If a file cannot be written; then the results in it have their old scores.
    """

    path = opened(folder)
    known = provenances(path)

    def changed(table: pa.Table) -> pa.Table:
        import pyarrow as pa

        if not len(table):
            return table
        results = [
            replace(r, scores=dict(scores[r.key]), scoring=scoring) if r.key in scores else r
            for r in rows(table, known)
        ]
        return pa.concat_tables([to_table(r) for r in results]).combine_chunks()

    _rewrite(path, scores, changed)


def readdress(folder: str | os.PathLike[str], address: Mapping[str, tuple[str, str]]) -> None:
    """Give results other keys; safe to kill and to repeat, as each file is replaced as a whole.

    Parameters
    ----------
    folder : path
        Folder of the results. Which of them are current is not changed.
    address : mapping of str to (str, str)
        Key -> the new key, and the new ``Result.recording``.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """

    def changed(table: pa.Table) -> pa.Table:
        import pyarrow as pa

        keys, recordings = (table.column(name).to_pylist() for name in ("key", "recording"))
        new = [address.get(key, (key, recording)) for key, recording in zip(keys, recordings, strict=True)]
        for k, name in enumerate(("key", "recording")):
            column = pa.array([pair[k] for pair in new], pa.string())
            table = table.set_column(table.column_names.index(name), schema().field(name), column)
        return table

    path = opened(folder)
    compact(path)  # the files with one result are named by their keys
    _rewrite(path, address, changed)
    for trial in (path / TRIALS).glob("*.parquet"):
        if trial.stem in address:
            trial.rename(trial.with_stem(address[trial.stem][0]))


def _rewrite(path: Path, keys: Collection[str], change: Callable[[pa.Table], pa.Table]) -> None:
    """Write the files that hold some of the keys again, each whole or not at all."""
    for file in files_of(path):
        with contextlib.suppress(DamagedError, FileNotFoundError):
            if not any(key in keys for table in tables_of(file, ["key"]) for key in table.column("key").to_pylist()):
                continue
            tables = [change(table) for table in tables_of(file)]
            with atomic(file) as target:
                write_tables(target, iter(tables))


def load(
    folder: str | os.PathLike[str],
    *,
    series: bool = True,
    scores: Collection[str] | None = None,
    scenarios: Collection[str] | None = None,
) -> list[Result]:
    """The current results of a folder, each once, in order of scenario, estimator and seed.

    Only the columns that are needed are read, so that a hundred thousand results take seconds. Results that cannot be
    those of a campaign (`simnav.leaderboard.results.admission`) are left out, with a warning.

    Parameters
    ----------
    folder : path
        Folder of the results.
    series : bool
        False leaves the series out. Otherwise they stay in their files until they are asked for.
    scores : collection of str, optional
        Only these are read. Default: all.
    scenarios : collection of str, optional
        Only results of these versioned ids are read, without series. Default: all.

    Raises
    ------
    StoreError
        If it is no folder of results, or one of another format.
    """
    path = opened(folder)
    current = read_marker(path)["current"]
    columns = [n for n in schema().names if n != "series"]
    known = provenances(path)
    found: dict[str, Result] = {}
    others: set[tuple[str, str]] = set()
    variants = {(s, e): v for s, entry in current.items() for e, v in entry.get("estimators", {}).items()}

    def scan() -> None:
        for file, tables in contents(path, columns):
            for group, whole in enumerate(tables):
                stored = partial(StoredSeries, str(file), group) if series and scenarios is None else None
                table = whole if scenarios is None else of_scenarios(whole, scenarios)
                for result in rows(table, known, scores=scores, series=stored):
                    variant = variants.get((result.scenario, result.estimator))
                    if variant == result.variant:
                        found.setdefault(result.key, result)
                    elif variant is None:
                        others.add((result.scenario, result.estimator))

    steadily(scan)
    if others:
        scenario, label = min(others)
        more = f" (and {len(others) - 1} more)" if len(others) > 1 else ""
        warnings.warn(
            f"{path}: results of {label} on {scenario}{more} are left out, for the scenario or the simulator has "
            "changed since; run the campaign again with them",
            StoreWarning,
            2,
        )
    taken, refused = admitted(found.values())
    if refused:
        more = f"; and {len(refused) - _SENTENCES} reasons more" if len(refused) > _SENTENCES else ""
        warnings.warn(f"{path}: {'; '.join(refused[:_SENTENCES])}{more}", SetAsideWarning, 2)
    return sorted(taken, key=lambda r: (r.scenario, r.estimator, r.seed))


def compact(folder: str | os.PathLike[str]) -> None:
    """Gather the files with one result into one with many; safe to kill and to run twice at once.

    Raises
    ------
    StoreError
        If it cannot be written; then all is as before.
    """
    path = opened(folder)
    files = files_of(path)
    parts = [f for f in files if f.parent.name == COMPACTED]
    loose = files[len(parts) :]
    merged = [*(parts if len(parts) >= MOST_PARTS else []), *loose]
    if not merged:
        return
    done: list[Path] = []

    def tables() -> Iterator[pa.Table]:
        import pyarrow as pa

        seen: set[str] = set()
        pending: list[pa.Table] = []
        for file in merged:
            with contextlib.suppress(FileNotFoundError, DamagedError):  # its whole pages are kept
                for table in tables_of(file):
                    fresh = [k not in seen for k in table.column("key").to_pylist()]
                    seen.update(table.column("key").to_pylist())
                    pending.append(table.filter(pa.array(fresh)))
                done.append(file)
            if sum(map(len, pending)) >= BATCH:
                yield pa.concat_tables(pending).combine_chunks()
                pending = []
        if pending:
            yield pa.concat_tables(pending).combine_chunks()

    part = path / COMPACTED / f"part-{uuid.uuid4().hex[:16]}.parquet"
    with atomic(part) as file:
        write_tables(file, tables())
    try:
        for old in done:
            old.unlink(missing_ok=True)
    except OSError as error:
        raise failure(part, error) from None
