"""The formats in which results and recordings are written for other programs.

A format is a function, registered by `writes`, that writes one thing to one place. A new one takes one file, of simnav
or of others (``docs/how-to/add-a-format.md``)::

    @writes("recording", "mat")
    def write_mat(recording: Recording, path: Path) -> list[Path]: ...

A file of a third party is loaded by ``simnav --plugin``, or by `simnav.load_plugin`. A package names its module in the
entry-point group ``simnav.result_writers`` or ``simnav.recording_writers``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

from simnav.plugins import Registry
from simnav.spec import closest

__all__ = ["WRITERS", "Kind", "formats", "write", "writes"]

#: ``results``: a `simnav.leaderboard.results.export.Document`; ``recording``: a `simnav.recording.Recording`.
Kind = Literal["results", "recording"]

Write: TypeAlias = Callable[[Any, Path], list[Path]]
Writer = TypeVar("Writer", bound=Write)

WRITERS: dict[Kind, Registry[Write]] = {
    "results": Registry(
        "writer of results", "simnav.result_writers", "simnav.leaderboard.results.export", term="format"
    ),
    "recording": Registry(
        "writer of recordings", "simnav.recording_writers", "simnav.leaderboard.results.recording_export", term="format"
    ),
}


def writes(kind: Kind, name: str) -> Callable[[Writer], Writer]:
    """Register a function that takes a thing of a kind and a path, and returns the files that it wrote (decorator).

    Parameters
    ----------
    kind : {"results", "recording"}
        Kind of the data that it writes.
    name : str
        Name of the format in snake_case; of a file, its ending.

    Raises
    ------
    PluginError
        If the name is not in snake_case or another format of this kind has it.
    """

    def wrap(writer: Writer) -> Writer:
        WRITERS[kind].add(name, writer)
        return writer

    return wrap


def formats(kind: Kind) -> list[str]:
    """Names of the formats of a kind; of a file, its ending."""
    return sorted(WRITERS[kind].items())


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
    writer = WRITERS[kind].get(name)
    if writer is None:
        raise ValueError(f"there is no format {name!r} of {kind}{closest(name, formats(kind))}")
    return writer(thing, path)
