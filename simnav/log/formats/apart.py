"""Calls of libraries that a damaged file can bring down: in a process of their own."""

from __future__ import annotations

import contextlib
import multiprocessing
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

__all__ = ["ApartError", "apart"]


#: Time that a file may take: so many seconds, and one more for so many bytes.
_SECONDS, _BYTES_A_SECOND = 4.0, 5e6
#: Memory that it may take: so many bytes, and so many times its size.
_MEMORY, _EXPANSION = 1 << 30, 50


class ApartError(Exception):
    """The call raised, took too long, or its process died; the message says which."""


def _answer(connection: Connection, function: Callable[[Path], Any], path: Path, memory: int) -> None:
    warnings.simplefilter("ignore")
    _limit_memory(memory)
    try:
        connection.send((True, function(path)))
    except BaseException as error:
        text = " ".join(str(error).split())[:100]
        connection.send((False, f"{type(error).__name__}: {text or 'no more is known'}"))


def _limit_memory(size: int) -> None:
    """Let this process allocate so many bytes more (POSIX)."""
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        with open("/proc/self/statm") as file:
            now = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + size, resource.getrlimit(resource.RLIMIT_AS)[1]))


def apart(function: Callable[[Path], Any], path: Path) -> Any:
    """Call a function that reads a file in another process, and return its result.

    It gets time and memory for the size of the file: a damaged one may claim to hold any amount.

    Parameters
    ----------
    function : callable
        A function of a module; its result can be pickled.
    path : Path
        The file.

    Raises
    ------
    ApartError
        If it raises, takes too long, or its process dies.
    FileNotFoundError
        If there is no such file.
    """
    size = path.stat().st_size
    seconds = _SECONDS + size / _BYTES_A_SECOND
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("fork" if "fork" in methods else "spawn")
    ours, theirs = context.Pipe(duplex=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # fork beside threads: the child uses none of them
        process = context.Process(  # type: ignore[attr-defined]
            target=_answer, args=(theirs, function, path, _MEMORY + _EXPANSION * size), daemon=True
        )
        process.start()
    theirs.close()
    try:
        if not ours.poll(seconds):
            raise ApartError(f"it takes more than {seconds:g} s")
        good, result = ours.recv()
    except EOFError:
        raise ApartError("it brings the library down that should read it") from None
    finally:
        ours.close()
        process.kill()
        process.join()
    if not good:
        raise ApartError(result)
    return result
