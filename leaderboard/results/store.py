"""The result store: one file a result, written atomically; then compacted to Parquet.

A results folder holds::

    simnav-results.json      format of the folder, version of the benchmark, and which results are current
    results/KEY.parquet      one result, fresh from a worker
    compacted/part-*.parquet many results
    provenance/ID.json       versions, machine and day of results that name the id
    trials/KEY.parquet       what the estimator gave, where trials are kept (`simnav.leaderboard.results.trials`)

A result's key names everything that decides it (`simnav.leaderboard.campaign.fingerprint`), so a campaign that was
killed goes on where it was. Whatever moment it was killed at: a file is either whole or not there
(temporary name, fsync, rename), a result that is both loose and compacted counts once, and nothing
is deleted before the file that replaces it is on disk.

Results of an older scenario, simulator or estimator stay in the folder, but only those of the last
campaign's versions are current and come back from `load`.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import time
import uuid
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple, TypeVar

from simnav.leaderboard.results.provenance import BENCHMARK, Provenance
from simnav.leaderboard.results.result import (
    BATCH,
    FORMAT,
    READABLE,
    Result,
    batches,
    listed,
    rows,
    schema,
    to_table,
    write_tables,
)
from simnav.leaderboard.results.stored_series import StoredSeries

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = [
    "FILES",
    "FORMAT",
    "Ending",
    "Result",
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
    "rescore",
    "select",
    "write",
]

_MARKER = "simnav-results.json"
_LOOSE, _COMPACTED, _TRIALS, _PROVENANCE = "results", "compacted", "trials", "provenance"
#: Folders inside a folder of results, those first that others refer to.
FILES = (_PROVENANCE, _TRIALS, _COMPACTED, _LOOSE)
_MOST_PARTS = 16  # more are merged into one
_STALE = 3600.0  # a temporary file of this age was left behind [s]


T = TypeVar("T")


class Ending(NamedTuple):
    """How a stored run ended.

    Attributes
    ----------
    status : str
        Status of the run.
    time_limit : float
        That it ran under [s]; 0 where it is not known.
    memory_limit : int
        [bytes]; 0 where it is not known.
    scoring : str
        With which code it was scored, as in `Result`.
    """

    status: str
    time_limit: float
    memory_limit: int
    scoring: str


class StoreError(RuntimeError):
    """A results folder that cannot be used; the message is one sentence."""


class StoreWarning(UserWarning):
    """A file of a results folder was set aside, or results in it are not current."""


# --- the folder -------------------------------------------------------------------------------------


def create(folder: str | os.PathLike[str]) -> Path:
    """Make a results folder, or check one that is there; return its path.

    Raises
    ------
    StoreError
        If the folder holds something else, or results of another format or version of the benchmark. It is left as it
        is.
    """
    path = Path(folder)
    if _check(path):
        before = _read_marker(path)
        if before["current"] and before.get("benchmark") != BENCHMARK:
            raise StoreError(
                f"the results in {path} belong to {before.get('benchmark', 'a benchmark without a version')}, this "
                f"version of simnav runs {BENCHMARK}, and the two must not be mixed: name another folder"
            )
        return path
    try:
        path.mkdir(parents=True, exist_ok=True)
        _write_marker(path, {})
        for name in (_LOOSE, _COMPACTED):
            (path / name).mkdir(exist_ok=True)
    except OSError as error:
        raise _failure(path, error) from None
    return path


def _check(path: Path) -> bool:
    """Whether it is a results folder (True) or nothing yet (False)."""
    if not path.exists():
        return False
    if not path.is_dir():
        raise StoreError(f"{path} is a file; a folder of results is wanted")
    marker = path / _MARKER
    if not marker.exists():
        if all(p.name.startswith(".") or p.name.startswith(_MARKER) for p in path.iterdir()) or (
            (path / _LOOSE).is_dir() and (path / _COMPACTED).is_dir()
        ):
            return False
        raise StoreError(f"{path} holds other files and no results of simnav; name an empty or a new folder")
    content = _read_marker(path)
    if content["format"] not in READABLE:
        raise StoreError(
            f"the results in {path} have format {content['format']} (simnav {content.get('simnav', 'unknown')}), this "
            f"version reads format {FORMAT}: name another folder, or use the version that wrote them"
        )
    for name in (_LOOSE, _COMPACTED):
        (path / name).mkdir(exist_ok=True)
    return True


def _opened(folder: str | os.PathLike[str]) -> Path:
    path = Path(folder)
    if not _check(path):
        raise StoreError(f"there are no results in {path}; 'simnav campaign' makes some")
    return path


def _read_marker(path: Path) -> dict[str, Any]:
    """The marker; one that is damaged is set aside, and nothing in the folder is current any more."""
    marker = path / _MARKER
    try:
        content = json.loads(marker.read_bytes())
        if not isinstance(content["format"], int) or not isinstance(content.setdefault("current", {}), dict):
            raise ValueError("no format")
        return dict(content)
    except (ValueError, KeyError, TypeError) as error:
        _set_aside(marker, error)
        _write_marker(path, {})
        return {"format": FORMAT, "current": {}}
    except OSError as error:
        raise StoreError(f"{marker} cannot be read: {error.strerror}") from None


def _write_marker(path: Path, current: Mapping[str, Any]) -> None:
    from importlib.metadata import version

    content = {"format": FORMAT, "simnav": version("simnav"), "benchmark": BENCHMARK, "current": current}
    with atomic(path / _MARKER) as file:
        file.write(json.dumps(content, indent=1, sort_keys=True).encode())


def select(folder: str | os.PathLike[str], current: Mapping[str, tuple[str, Mapping[str, str]]]) -> None:
    """Say which results are current.

    Parameters
    ----------
    folder : path
        Folder of the results.
    current : mapping
        Versioned id of a scenario -> (``Result.recording``, {label: ``Result.variant``}). Other estimators
        of the scenario stay current if they were run on the same recordings.
    """
    path = _opened(folder)
    before = _read_marker(path)["current"]
    after = dict(before)
    for scenario, (recording, variants) in current.items():
        old = before.get(scenario, {})
        kept = old.get("estimators", {}) if old.get("recording") == recording else {}
        after[scenario] = {"recording": recording, "estimators": {**kept, **variants}}
    if after != before:
        _write_marker(path, after)


# --- files --------------------------------------------------------------------------------------------


@contextlib.contextmanager
def atomic(path: Path) -> Iterator[BinaryIO]:
    """Write a file whole or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
        _sync_folder(path.parent)
    except OSError as error:
        raise _failure(path, error) from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _sync_folder(folder: Path) -> None:
    """Make a rename last through a power failure."""
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _failure(path: Path, error: OSError) -> StoreError:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return StoreError(
            f"the disk is full: {path.name} could not be written in {path.parent}; all results before it are safe, "
            "so make room and start the campaign again"
        )
    return StoreError(f"{path} cannot be written: {error.strerror or error}")


def _set_aside(path: Path, error: Exception) -> None:
    aside = path.with_name(path.name + ".broken")
    count = 1
    while aside.exists():
        count += 1
        aside = path.with_name(f"{path.name}.{count}.broken")
    with contextlib.suppress(OSError):
        path.rename(aside)
    reason = " ".join(str(error).split()) or type(error).__name__
    warnings.warn(f"{path} is not a whole file of results, set aside as {aside.name} ({reason})", StoreWarning, 3)


def _files(path: Path) -> list[Path]:
    """All files of results, those with many first."""
    loose = sorted((path / _LOOSE).glob("*.parquet"))  # listed first: what is gone by now is in a part
    return _parts(path) + loose


def _parts(path: Path) -> list[Path]:
    return sorted((path / _COMPACTED).glob("part-*.parquet"))


def _scan(
    path: Path, columns: list[str] | None = None, loose: list[str] | None = None
) -> Iterator[tuple[Path, list[pa.Table]]]:
    """The contents of every whole file; of files with one result the columns ``loose``, by default the same.

    Raises
    ------
    FileNotFoundError
        If another process compacts meanwhile.
    """
    files = _files(path)
    for file in files:
        with contextlib.suppress(_DamagedError):
            yield file, list(_read(file, columns if loose is None or file.parent.name == _COMPACTED else loose))
    if not set(_parts(path)).issubset(files):
        raise FileNotFoundError


def _steadily(scan: Callable[[], T]) -> T:
    """Repeat a scan until no other process compacts during it."""
    while True:
        with contextlib.suppress(FileNotFoundError):
            return scan()


def _sweep(path: Path) -> None:
    """Delete temporary files that a killed process left."""
    folders = (path, *(path / name for name in (_LOOSE, _COMPACTED, _TRIALS)))
    for temporary in [file for folder in folders for file in folder.glob(".*.tmp")]:
        with contextlib.suppress(OSError):
            if time.time() - temporary.stat().st_mtime > _STALE:
                temporary.unlink()


class _DamagedError(Exception):
    """The file is not whole; it was set aside, and what was read of it should be dropped."""


def _read(path: Path, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The contents of a file; one that is damaged is set aside, and `_DamagedError` raised."""
    import pyarrow as pa

    try:
        yield from batches(path, columns)
    except FileNotFoundError:
        raise  # another process compacts: see `_steadily`
    except (pa.ArrowException, ValueError, OSError, KeyError) as error:
        if isinstance(error, PermissionError):
            raise StoreError(f"{path} cannot be read: {error.strerror}") from None
        _set_aside(path, error)
        raise _DamagedError from None


# --- what others call ---------------------------------------------------------------------------------


def write(folder: str | os.PathLike[str], result: Result) -> None:
    """Write one result, atomically, and its provenance where the folder does not have it.

    Raises
    ------
    StoreError
        If it cannot be written, e.g. because the disk is full; nothing is left behind.
    """
    table = to_table(result)
    keep_provenance(Path(folder), result.provenance)
    with atomic(Path(folder) / _LOOSE / f"{result.key}.parquet") as file:
        write_tables(file, iter([table]))


def keep_provenance(path: Path, provenance: Provenance) -> None:
    """Keep a provenance in a folder of results, unless it is there."""
    target = path / _PROVENANCE / f"{provenance.id}.json"
    if not provenance.id or provenance.identity or target.exists():
        return
    try:
        target.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise _failure(target, error) from None
    with atomic(target) as file:
        file.write(json.dumps(provenance.to_dict(), indent=1).encode())


def provenances(folder: str | os.PathLike[str]) -> dict[str, Provenance]:
    """All that the folder knows, by id; a damaged file is set aside."""
    found = {}
    for file in sorted((Path(folder) / _PROVENANCE).glob("*.json")):
        try:
            one = Provenance.from_dict(json.loads(file.read_bytes()))
        except (ValueError, TypeError, AttributeError) as error:
            _set_aside(file, error)
            continue
        except OSError as error:
            raise StoreError(f"{file} cannot be read: {error.strerror}") from None
        found[file.stem] = one
    return found


def keys(folder: str | os.PathLike[str]) -> dict[str, Ending]:
    """How each result that is there and whole ended, by key; damaged files are set aside."""
    path = _opened(folder)
    _sweep(path)

    def scan() -> dict[str, Ending]:
        found: dict[str, Ending] = {}
        # A loose file is read as a whole, to know that it is. Of a part only what is asked for is read, or a resumed
        # campaign of many results would wait; what is damaged elsewhere in it is found when it is loaded.
        for _, tables in _scan(path, ["key", *Ending._fields], schema().names):
            for table in tables:
                statuses, limits, memories, codes = (listed(table.column(name)) for name in Ending._fields)
                for key, *ending in zip(listed(table.column("key")), statuses, limits, memories, codes, strict=True):
                    found.setdefault(key, Ending(*ending))
        return found

    return _steadily(scan)


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

    path = _opened(folder)
    for key in keys:
        (path / _LOOSE / f"{key}.parquet").unlink(missing_ok=True)
    _rewrite(path, keys, without)


def rescore(folder: str | os.PathLike[str], scores: Mapping[str, Mapping[str, float]], scoring: str) -> None:
    """Give results other scores.

    Each file is replaced as a whole, so that a result has its old scores or its new ones, whatever happens.

    Parameters
    ----------
    folder : path
        Folder of the results.
    scores : mapping of str to mapping
        By key: all scores of the result.
    scoring : str
        With which code they were computed.

    Raises
    ------
    StoreError
        If a file cannot be written; then the results in it have their old scores.
    """

    path = _opened(folder)
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


def _rewrite(path: Path, keys: Collection[str], change: Callable[[pa.Table], pa.Table]) -> None:
    """Write the files that hold some of the keys again, each whole or not at all."""
    for file in _files(path):
        with contextlib.suppress(_DamagedError, FileNotFoundError):
            if not any(key in keys for table in _read(file, ["key"]) for key in table.column("key").to_pylist()):
                continue
            tables = [change(table) for table in _read(file)]
            with atomic(file) as target:
                write_tables(target, iter(tables))


def load(folder: str | os.PathLike[str], *, series: bool = True, scores: Collection[str] | None = None) -> list[Result]:
    """The current results of a folder, each once, in order of scenario, estimator and seed.

    Only the columns that are needed are read, so that a hundred thousand results take seconds.

    Parameters
    ----------
    folder : path
        Folder of the results.
    series : bool
        False leaves the series out. Otherwise they stay in their files until they are asked for.
    scores : collection of str, optional
        Only these are read. Default: all.

    Raises
    ------
    StoreError
        If it is no folder of results, or one of another format.
    """
    path = _opened(folder)
    current = _read_marker(path)["current"]
    columns = [n for n in schema().names if n != "series"]
    known = provenances(path)
    found: dict[str, Result] = {}
    others: set[tuple[str, str]] = set()
    variants = {(s, e): v for s, entry in current.items() for e, v in entry.get("estimators", {}).items()}

    def scan() -> None:
        for file, tables in _scan(path, columns):
            for group, table in enumerate(tables):
                stored = partial(StoredSeries, str(file), group) if series else None
                for result in rows(table, known, scores=scores, series=stored):
                    variant = variants.get((result.scenario, result.estimator))
                    if variant == result.variant:
                        found.setdefault(result.key, result)
                    elif variant is None:
                        others.add((result.scenario, result.estimator))

    _steadily(scan)
    if others:
        scenario, label = min(others)
        more = f" (and {len(others) - 1} more)" if len(others) > 1 else ""
        warnings.warn(
            f"{path}: results of {label} on {scenario}{more} are left out, for the scenario or the simulator has "
            "changed since; run the campaign again with them",
            StoreWarning,
            2,
        )
    return sorted(found.values(), key=lambda r: (r.scenario, r.estimator, r.seed))


def described(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """What the folder says of itself: format, version of the benchmark, what is current; empty where it is new.

    Raises
    ------
    StoreError
        If it holds something else, or results of another format.
    """
    path = Path(folder)
    return _read_marker(path) if _check(path) else {}


def compact(folder: str | os.PathLike[str]) -> None:
    """Gather the files with one result into one with many; safe to kill and to run twice at once.

    Raises
    ------
    StoreError
        If it cannot be written; then all is as before.
    """
    path = _opened(folder)
    files = _files(path)
    parts = [f for f in files if f.parent.name == _COMPACTED]
    loose = files[len(parts) :]
    merged = [*(parts if len(parts) >= _MOST_PARTS else []), *loose]
    if not merged:
        return
    done: list[Path] = []

    def tables() -> Iterator[pa.Table]:
        import pyarrow as pa

        seen: set[str] = set()
        pending: list[pa.Table] = []
        for file in merged:
            with contextlib.suppress(FileNotFoundError, _DamagedError):  # its whole pages are kept
                for table in _read(file):
                    fresh = [k not in seen for k in table.column("key").to_pylist()]
                    seen.update(table.column("key").to_pylist())
                    pending.append(table.filter(pa.array(fresh)))
                done.append(file)
            if sum(map(len, pending)) >= BATCH:
                yield pa.concat_tables(pending).combine_chunks()
                pending = []
        if pending:
            yield pa.concat_tables(pending).combine_chunks()

    part = path / _COMPACTED / f"part-{uuid.uuid4().hex[:16]}.parquet"
    with atomic(part) as file:
        write_tables(file, tables())
    try:
        for old in done:
            old.unlink(missing_ok=True)
    except OSError as error:
        raise _failure(part, error) from None
