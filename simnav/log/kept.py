"""What was read of a file is kept as long as the file does not change."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from functools import lru_cache, wraps
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar, cast

from simnav.log.table import LogError

__all__ = ["kept"]

P = ParamSpec("P")
T = TypeVar("T")


def kept(
    most: int, *, folders: bool = False
) -> Callable[[Callable[Concatenate[Path, P], T]], Callable[Concatenate[Path, P], T]]:
    """Keep what a function read of files, as long as their times and sizes stay (decorator).

    The function gets a path that is there, and arguments that can be hashed. An `OSError` in it becomes a `LogError`.

    Parameters
    ----------
    most : int
        Number of results that are kept, the last ones.
    folders : bool
        Whether the path may be a folder.
    """

    def wrap(read: Callable[Concatenate[Path, P], T]) -> Callable[Concatenate[Path, P], T]:
        @lru_cache(maxsize=most)
        def known(path: Path, changed: int, size: int, *args: P.args, **kwargs: P.kwargs) -> T:
            return read(path, *args, **kwargs)

        @wraps(read)
        def reading(path: Path, *args: P.args, **kwargs: P.kwargs) -> T:
            try:
                state = os.stat(path)
            except OSError:
                raise LogError(f"{path}: there is no such file") from None
            if stat.S_ISDIR(state.st_mode) and not folders:
                raise LogError(f"{path}: it is a folder, where a file is wanted")
            try:
                return known(path, state.st_mtime_ns, state.st_size, *args, **kwargs)  # type: ignore[arg-type]  # see the docstring
            except OSError as error:
                raise LogError(f"{path} cannot be read: {error.strerror or error}") from None

        return cast(Callable[Concatenate[Path, P], T], reading)

    return wrap
