"""A folder of results: its marker, what in it is current, and files that are whole or not there.

A folder holds::

    simnav-results.json      format of the folder, version of the benchmark, and which results are current
    results/KEY.parquet      one result, fresh from a worker
    compacted/part-*.parquet many results
    provenance/ID.json       versions, machine and day of results that name the id
    trials/KEY.parquet       what the estimator gave, where trials are kept (`simnav.leaderboard.results.trials`)

A file is written under a temporary name, brought to disk and renamed, so that it is either whole or not there.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import stat
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

from .errors import StoreError
from .former_names import under_present_labels
from .provenance import BENCHMARK
from .result import FORMAT, READABLE, batches

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = [
    "COMPACTED",
    "FILES",
    "LOOSE",
    "PROVENANCE",
    "TRIALS",
    "DamagedError",
    "SetAsideWarning",
    "StoreWarning",
    "atomic",
    "contents",
    "create",
    "delete_unfinished",
    "described",
    "failure",
    "files_of",
    "opened",
    "parts_of",
    "read_marker",
    "select",
    "set_aside",
    "steadily",
    "tables_of",
]

_MARKER = "simnav-results.json"
LOOSE, COMPACTED, TRIALS, PROVENANCE = "results", "compacted", "trials", "provenance"
#: Folders inside a folder of results, those first that others refer to.
FILES = (PROVENANCE, TRIALS, COMPACTED, LOOSE)
_STALE = 3600.0  # a temporary file of this age was left behind [s]


T = TypeVar("T")


class StoreWarning(UserWarning):
    """A file of a results folder was set aside, or results in it are not current."""


class SetAsideWarning(StoreWarning):
    """Results in a folder cannot be those of a campaign, and were left out."""


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
        before = read_marker(path)
        if before["current"] and before.get("benchmark") != BENCHMARK:
            raise StoreError(
                f"the results in {path} belong to {before.get('benchmark', 'a benchmark without a version')}, this "
                f"version of simnav runs {BENCHMARK}, and the two must not be mixed: name another folder"
            )
        return path
    try:
        path.mkdir(parents=True, exist_ok=True)
        _write_marker(path, {})
        for name in (LOOSE, COMPACTED):
            (path / name).mkdir(exist_ok=True)
    except OSError as error:
        raise failure(path, error) from None
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
            (path / LOOSE).is_dir() and (path / COMPACTED).is_dir()
        ):
            return False
        raise StoreError(f"{path} holds other files and no results of simnav; name an empty or a new folder")
    content = read_marker(path)
    if content["format"] not in READABLE:
        raise StoreError(
            f"the results in {path} have format {content['format']} (simnav {content.get('simnav', 'unknown')}), this "
            f"version reads format {FORMAT}: name another folder, or use the version that wrote them"
        )
    for name in (LOOSE, COMPACTED):
        (path / name).mkdir(exist_ok=True)
    return True


def opened(folder: str | os.PathLike[str]) -> Path:
    path = Path(folder)
    if not _check(path):
        raise StoreError(f"there are no results in {path}; 'simnav campaign' makes some")
    return path


def read_marker(path: Path) -> dict[str, Any]:
    """The marker; one that is damaged is set aside, and nothing in the folder is current any more."""
    marker = path / _MARKER
    try:
        content = json.loads(marker.read_bytes())
        if not isinstance(content["format"], int) or not _is_current(content.setdefault("current", {})):
            raise ValueError("no format")
        for entry in content["current"].values():
            if "estimators" in entry:
                entry["estimators"] = under_present_labels(entry["estimators"])
        return dict(content)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        set_aside(marker, error)
        _write_marker(path, {})
        return {"format": FORMAT, "current": {}}
    except OSError as error:
        raise StoreError(f"{marker} cannot be read: {error.strerror}") from None


def _is_current(given: object) -> bool:
    """Whether it says which results are current: of each scenario the recording, and a variant by label."""

    def entry(one: object) -> bool:
        if not isinstance(one, dict) or not isinstance(one.get("recording"), str):
            return False
        rows = one.get("estimators", {})
        return isinstance(rows, dict) and all(map(_is_text, rows.values()))

    return isinstance(given, dict) and all(map(entry, given.values()))


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _write_marker(path: Path, current: Mapping[str, Any]) -> None:
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
    path = opened(folder)
    before = read_marker(path)["current"]
    after = dict(before)
    for scenario, (recording, variants) in current.items():
        old = before.get(scenario, {})
        kept = old.get("estimators", {}) if old.get("recording") == recording else {}
        after[scenario] = {"recording": recording, "estimators": {**kept, **variants}}
    if after != before:
        _write_marker(path, after)


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
        raise failure(path, error) from None
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


def failure(path: Path, error: OSError) -> StoreError:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return StoreError(
            f"the disk is full: {path.name} could not be written in {path.parent}; all results before it are safe, "
            "so make room and start the campaign again"
        )
    return StoreError(f"{path} cannot be written: {error.strerror or error}")


def set_aside(path: Path, error: Exception) -> None:
    aside = path.with_name(path.name + ".broken")
    count = 1
    while aside.exists():
        count += 1
        aside = path.with_name(f"{path.name}.{count}.broken")
    with contextlib.suppress(OSError):
        path.rename(aside)
    reason = " ".join(str(error).split()) or type(error).__name__
    warnings.warn(f"{path} is not a whole file of results, set aside as {aside.name} ({reason})", StoreWarning, 3)


def files_of(path: Path) -> list[Path]:
    """All files of results, those with many first."""
    loose = sorted((path / LOOSE).glob("*.parquet"))  # listed first: what is gone by now is in a part
    return [file for file in parts_of(path) + loose if not _is_special(file)]


def _is_special(file: Path) -> bool:
    """Whether it is a pipe or a device, on which a reader would wait for ever."""
    try:
        mode = file.stat().st_mode
    except OSError:  # gone, or not to be read: whoever opens it says so
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def parts_of(path: Path) -> list[Path]:
    return sorted((path / COMPACTED).glob("part-*.parquet"))


def contents(
    path: Path, columns: list[str] | None = None, loose: list[str] | None = None
) -> Iterator[tuple[Path, list[pa.Table]]]:
    """The contents of every whole file; of files with one result the columns ``loose``, by default the same.

    Raises
    ------
    FileNotFoundError
        If another process compacts meanwhile.
    """
    files = files_of(path)
    for file in files:
        with contextlib.suppress(DamagedError):
            yield file, list(tables_of(file, columns if loose is None or file.parent.name == COMPACTED else loose))
    if not set(parts_of(path)).issubset(files):
        raise FileNotFoundError


def steadily(scan: Callable[[], T]) -> T:
    """Repeat a scan until no other process compacts during it."""
    while True:
        with contextlib.suppress(FileNotFoundError):
            return scan()


def delete_unfinished(path: Path) -> None:
    """Delete temporary files that a killed process left."""
    folders = (path, *(path / name for name in (LOOSE, COMPACTED, TRIALS)))
    for temporary in [file for folder in folders for file in folder.glob(".*.tmp")]:
        with contextlib.suppress(OSError):
            if time.time() - temporary.stat().st_mtime > _STALE:
                temporary.unlink()


class DamagedError(Exception):
    """The file is not whole; it was set aside, and what was read of it should be dropped."""


def tables_of(path: Path, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The contents of a file; one that is damaged is set aside, and `DamagedError` raised."""
    import pyarrow as pa

    try:
        yield from batches(path, columns)
    except FileNotFoundError:
        raise  # another process compacts: see `steadily`
    except MemoryError:  # pyarrow's is an ArrowException, too; the file is whole
        raise StoreError(f"{path} cannot be read: there is not enough memory") from None
    except (pa.ArrowException, ValueError, OSError, KeyError) as error:
        if isinstance(error, PermissionError):
            raise StoreError(f"{path} cannot be read: {error.strerror}") from None
        set_aside(path, error)
        raise DamagedError from None


def described(folder: str | os.PathLike[str]) -> dict[str, Any]:
    """What the folder says of itself: format, version of the benchmark, what is current; empty where it is new.

    Raises
    ------
    StoreError
        If it holds something else, or results of another format.
    """
    path = Path(folder)
    return read_marker(path) if _check(path) else {}
