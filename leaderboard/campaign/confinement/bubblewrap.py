"""Bubblewrap: a read-only file system without the results, no network, process numbers of its own (Linux).

See the manual page of ``bwrap``. The package is called ``bubblewrap``; it needs user namespaces, which some systems
forbid to ordinary users.
"""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from .server import COPY_FROM

__all__ = ["available", "wrapped"]

_PRIVATE = "/dev/shm"  # in memory, empty at first, for this sandbox only
_BASE = (
    "--unshare-all", "--die-with-parent", "--new-session", "--cap-drop", "ALL", "--ro-bind", "/", "/", "--dev", "/dev",
    "--proc", "/proc", "--tmpfs", _PRIVATE,
)  # fmt: skip


@functools.cache
def available() -> str:
    """Why it cannot be used here; empty where it can."""
    program = shutil.which("bwrap")
    if program is None:
        return "bubblewrap is not installed (the command bwrap)"
    try:
        done = subprocess.run([program, *_BASE, "true"], capture_output=True, text=True, timeout=20.0, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"bwrap does not work here: {type(error).__name__}"
    if done.returncode:
        return f"bwrap does not work here: {(done.stderr.strip().splitlines() or ['it fails'])[-1][:200]}"
    return ""


def wrapped(
    command: Sequence[str], environment: dict[str, str], hidden: Sequence[Path], writable: Path | None
) -> list[str]:
    """A command line that runs a command in a sandbox.

    Parameters
    ----------
    command : sequence of str
        Program and arguments.
    environment : dict
        Environment variables of the command; the function sets those that the sandbox needs.
    hidden : sequence of Path
        Folders and files that are shown empty.
    writable : Path or None
        Folder that stays as it is: for the kernels that estimators compile.
    """
    from simnav.compiled import cache_directory

    kernels = cache_directory()
    if kernels is not None:
        environment[COPY_FROM] = str(kernels)
    environment["SIMNAV_CACHE_DIR"] = f"{_PRIVATE}/simnav"
    environment["TMPDIR"] = _PRIVATE
    options = list(_BASE)
    if writable is not None:
        options += ["--bind", str(writable), str(writable)]
    for path in hidden:
        if path.is_dir():
            options += ["--tmpfs", str(path)]
        elif path.exists():
            options += ["--ro-bind", os.devnull, str(path)]
    return [shutil.which("bwrap") or "bwrap", *options, "--chdir", "/", "--as-pid-1", "--", *command]
