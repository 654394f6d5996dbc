"""One registry of the formats in which results and recordings are written for other programs.

A format is a function, registered by `writes`, that writes one thing to one place. A new one takes one file::

    @writes("recording", "mat")
    def write_mat(recording: Recording, path: Path) -> list[Path]: ...
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, TypeVar

from simnav.spec import closest

__all__ = ["Kind", "formats", "write", "writes"]

#: ``results``: a `simnav.leaderboard.results.export.Document`; ``recording``: a `simnav.recording.Recording`.
Kind = Literal["results", "recording"]

Writer = TypeVar("Writer", bound=Callable[[Any, Path], list[Path]])

_OURS: dict[Kind, str] = {"results": "export", "recording": "recording_export"}  # modules, imported when asked for
_writers: dict[Kind, dict[str, Callable[[Any, Path], list[Path]]]] = {"results": {}, "recording": {}}


def writes(kind: Kind, name: str) -> Callable[[Writer], Writer]:
    """Decorator: register a function that takes a thing of a kind and a path, and returns the files that it wrote."""

    def wrap(writer: Writer) -> Writer:
        _writers[kind][name] = writer
        return writer

    return wrap


def formats(kind: Kind) -> list[str]:
    """Names of the formats of a kind; of a file, its ending."""
    import_module(f"simnav.leaderboard.results.{_OURS[kind]}")
    return sorted(_writers[kind])


def write(kind: Kind, name: str, thing: Any, path: Path) -> list[Path]:
    """Write results or a recording.

    Parameters
    ----------
    kind : {"results", "recording"}
        Kind of the data to write.
    name : str
        One of `formats`.
    thing : Document or Recording
        The object to be written.
    path : Path
        Path of the file; for a recording as ``csv``, path of a folder, which is made if it does not exist.

    Returns
    -------
    list of Path
        The files that were written, each whole.

    Raises
    ------
    ValueError
        If there is no such format; one sentence.
    OSError
        If writing fails.
    """
    if name not in formats(kind):
        raise ValueError(f"there is no format {name!r} of {kind}{closest(name, formats(kind))}")
    return _writers[kind][name](thing, path)
